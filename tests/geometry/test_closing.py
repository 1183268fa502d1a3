"""Caps that close a surface, and how open it is, against the sky that its holes take up."""

from __future__ import annotations

import math

import numpy as np
import pytest

from replay.geometry import primitives
from replay.geometry.closing import MOST_OPEN, NO_CAPS, caps, openness
from replay.geometry.winding import corner_indices, sides, topology

CUBE = primitives.cube(1.0).triangles


def is_closed(triangles):
    return topology(sides(corner_indices(triangles)[1])).is_closed


def volume(triangles):
    return float(np.sum(np.einsum("ki,ki->k", triangles[:, 0], np.cross(triangles[:, 1], triangles[:, 2]))) / 6)


@pytest.mark.parametrize(
    "surface",
    [
        CUBE[1:],
        CUBE[2:],
        np.concatenate([CUBE[2:], CUBE[2:] + 5.0]),
        CUBE[:1],
        np.concatenate([CUBE[:1], CUBE[:1]]),  # each edge is walked twice
        primitives.sphere(0.5, 0.01).triangles[::3],
    ],
)
def test_caps_close_a_surface(surface):
    added = caps(surface)
    whole = np.concatenate([surface, added])
    assert len(added) and not is_closed(surface)
    balance = sides(corner_indices(whole)[1]).balance
    assert not balance.any()


def test_a_closed_surface_has_no_caps():
    assert caps(CUBE) is NO_CAPS
    assert openness(CUBE, NO_CAPS) == (0.0, 0.0) and openness(CUBE, NO_CAPS).has_inside


def test_the_apex_lies_beside_the_middle_of_the_boundary():
    added = caps(CUBE[2:])
    assert (added[:, 0] == added[0, 0]).all()
    rim = np.unique(added[:, 1:].reshape(-1, 3), axis=0)
    np.testing.assert_allclose(added[0, 0], rim.mean(axis=0) + np.array([0.0711, 0.1093, 0.0837]), rtol=0, atol=1e-15)


def sky(point, x, y):
    """Share of all directions that the rectangle [-x, x] [-y, y] in the plane z = 0 takes up, seen from a point."""
    total = 0.0
    for sx in (-1, 1):
        for sy in (-1, 1):
            a, b, h = sx * x - point[0], sy * y - point[1], abs(point[2])
            total += sx * sy * math.atan2(a * b, h * math.sqrt(a * a + b * b + h * h))
    return abs(total) / (4 * math.pi)


def test_how_open_a_box_without_a_lid_is():
    """A cuboid whose top face is missing: the mean over its walls and floor of what the hole takes up of the sky."""
    x, y, h = 0.5, 1.0, 0.8
    count = 12
    walls = []

    def patch(corner, u, v):
        for i in range(count):
            for j in range(count):
                a = corner + u * i / count + v * j / count
                b, c = a + u / count, a + v / count
                walls.extend([(a, b, c), (b, b + v / count, c)])

    down = np.array([0.0, 0, -h])
    ring = [np.array(p) for p in ((x, y, 0.0), (-x, y, 0.0), (-x, -y, 0.0), (x, -y, 0.0))]
    for k in range(4):
        patch(ring[k], ring[(k + 1) % 4] - ring[k], down)
    patch(ring[3] + down, ring[0] - ring[3], ring[2] - ring[3])
    surface = np.array(walls)
    area = 0.5 * np.linalg.norm(np.cross(surface[:, 1] - surface[:, 0], surface[:, 2] - surface[:, 0]), axis=1)
    seen = np.array([sky(point, x, y) for point in surface.mean(axis=1)])
    found = openness(surface, caps(surface))
    assert found.mean == pytest.approx(float(np.average(seen, weights=area)), rel=0.02)
    assert found.largest == pytest.approx(seen.max(), rel=0.02)
    assert found.has_inside


@pytest.mark.parametrize(("sheet", "mean"), [(CUBE[:2], 0.5), (CUBE[:1], 0.5)])
def test_a_flat_sheet_has_no_inside(sheet, mean):
    found = openness(sheet, caps(sheet))
    assert found.mean == pytest.approx(mean, abs=1e-9) and found.largest == pytest.approx(mean, abs=1e-9)
    assert not found.has_inside and mean > MOST_OPEN


def test_each_triangle_counts_by_its_area():
    """A large closed-but-for-one-triangle body and a small sheet far away: the sheet hardly counts."""
    body = 10.0 * CUBE[1:]
    sheet = 0.1 * CUBE[:1] + 100.0
    both = np.concatenate([sheet, body])
    alone, together = openness(body, caps(body)), openness(both, caps(both))
    assert together.mean == pytest.approx(alone.mean, rel=0.02)
