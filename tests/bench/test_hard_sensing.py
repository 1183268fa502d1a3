"""Families of cones and bodies are as hard as they are called."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from replay.bench import hard_sensing

COUNT = 400


def made(family):
    """Triangles, axes, apertures of a family, and the unit normals that point away from the apex."""
    triangles, axes, apertures = hard_sensing._CONES[family](np.random.default_rng(3), COUNT)
    assert triangles.shape == (COUNT, 3, 3) and axes.shape == (COUNT, 3) and apertures.shape == (COUNT,)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, rtol=0, atol=1e-14)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    return triangles, axes, apertures, normals * np.sign(np.sum(normals * triangles[:, 0], axis=1))[:, None]


def spans(values, low, high, share=1 / 16):
    """Whether values lie between two, and come near both: by a share of the powers of ten between these."""
    logs = np.log10([low, *np.abs(values), high])
    margin = share * (logs[-1] - logs[0])
    inner = logs[1:-1]
    return (
        inner.min() >= logs[0] - 1e-9
        and inner.max() <= logs[-1] + 1e-9
        and inner.min() < logs[0] + margin
        and inner.max() > logs[-1] - margin
    )


def test_apertures_are_as_narrow_and_as_wide_as_they_are_called():
    assert spans(made("needles 1e-9..1e-2 rad")[2], 1e-9, 10.0**-1.5)
    assert spans(math.pi - made("nearly a half space")[2], 1e-9, 1e-1)
    for family in ("any", "slivers", "region borders"):
        apertures = made(family)[2]
        assert 0.1 <= apertures.min() < 0.3 and 2.0 < apertures.max() <= 2.2


def test_planes_lie_to_axis_and_apex_as_they_are_called():
    _, axes, _, normals = made("plane along the axis")
    assert np.abs(np.sum(axes * normals, axis=1)).max() < 1e-13
    _, axes, _, normals = made("axis meets plane behind apex")
    sine = -np.sum(axes * normals, axis=1)
    assert (sine > 0.0).all() and spans(sine, 0.9e-9, math.sin(10.0**-0.5))
    triangles, _, _, normals = made("apex 1e-9..1e-3 off surface")
    assert spans(np.sum(triangles[:, 0] * normals, axis=1), 0.9e-9, 1.1e-3)


def test_triangles_are_as_large_and_as_thin_as_they_are_called():
    sides = [np.linalg.norm(t - np.roll(t, 1, axis=0), axis=1).max() for t in made("scale 1e-9..1e6")[0]]
    assert min(sides) < 1e-7 and max(sides) > 1e5
    thin = []
    for a, b, c in made("slivers")[0]:
        longest = max(np.linalg.norm(b - a), np.linalg.norm(c - a), np.linalg.norm(c - b))
        thin.append(np.linalg.norm(np.cross(b - a, c - a)) / longest**2)
    assert max(thin) < 1e-2 and min(thin) < 1e-10 and np.median(thin) < 1e-6
    triangles, axes, apertures, _ = made("small, at the cone's border")
    size = np.linalg.norm(triangles - triangles.mean(axis=1)[:, None], axis=2).max(axis=1)
    assert spans(size, 1e-6, 0.3, share=1 / 4)
    centre = triangles.mean(axis=1)
    angle = np.arccos(np.sum(centre * axes, axis=1) / np.linalg.norm(centre, axis=1))
    assert np.median(np.abs(angle - 0.5 * apertures) / size) < 1.5


def test_the_foot_of_the_apex_is_on_an_edge_a_corner_or_the_border():
    triangles, axes, apertures, normals = made("region borders")
    foot = normals * np.sum(normals * triangles[:, 0], axis=1)[:, None]
    for k in range(COUNT):
        a, b = triangles[k, 0], triangles[k, 1]
        if k % 4 == 2:
            along = (b - a) / np.linalg.norm(b - a)
            assert abs(abs(along @ axes[k]) - 1.0) < 1e-12
            continue
        share = (foot[k] - a) @ (b - a) / ((b - a) @ (b - a))
        assert np.linalg.norm(a + share * (b - a) - foot[k]) < 1e-12
        assert abs(share) < 1e-12 if k % 4 == 1 else 0.0 < share < 1.0
        if k % 4 == 3:
            angle = math.acos(foot[k] @ axes[k] / np.linalg.norm(foot[k]))
            assert angle == pytest.approx(0.5 * apertures[k], abs=1e-12)


def test_a_body_is_no_larger_than_the_box_that_is_known_and_often_as_large():
    for question in hard_sensing.hard_boxes(2):
        points, volume = question["points"], question["volume"]
        extent = np.ptp(points, axis=0).max()
        far = np.abs(points).max() / extent
        if far < 1e6:
            scaled = (points - points.mean(axis=0)) / extent
            filled = ConvexHull(scaled, qhull_options="QJ").volume * extent**3 / volume
            assert filled <= 1.0 + 1e-6 + 1e-14 * far
            if "cube" in question["family"] or "plate" in question["family"]:
                assert filled > 1.0 - 1e-6 - 1e-14 * far
