"""The smallest box about an axis, against every rectangle along an edge of the projection's hull."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from replay.geometry.box_search import box_volume
from replay.geometry.calipers import turn_about
from tests.amounts import cases

AXES = [(1.0, 0, 0), (0, 1.0, 0), (0, 0, 1.0), (-1.0, 0, 0), (0.6, 0.8, 0), (0.48, 0.6, 0.64), (-0.64, 0.48, -0.6)]


def brute(points, axis):
    """The volume of the smallest box with a side along `axis`: one rectangle for each edge of the hull."""
    u = np.linalg.svd(np.array(axis)[None])[2][1:]
    flat = points @ u.T
    hull = flat[ConvexHull(flat).vertices]
    edges = np.roll(hull, -1, axis=0) - hull
    edges = edges[np.hypot(*edges.T) > 1e-14]
    areas = []
    for edge in edges / np.hypot(*edges.T)[:, None]:
        turn = np.array([edge, (-edge[1], edge[0])])
        areas.append(np.prod(np.ptp(hull @ turn.T, axis=0)))
    return min(areas) * np.ptp(points @ np.array(axis))


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("count", [3, 4, 5, 12, 60])
def test_it_is_the_smallest_of_all_rectangles_along_an_edge(axis, count):
    rng = np.random.default_rng([count, *np.float64(axis).view(np.uint64) % 1000])
    for _ in range(cases(20) if count > 4 else 20):
        points = rng.normal(size=(count, 3)) * rng.uniform(0.1, 1.0, size=3) * 0.3 + rng.normal(size=3)
        axes = np.empty((3, 3))
        volume = turn_about(points, np.array(axis), axes)
        assert volume == pytest.approx(brute(points, axis), rel=1e-9, abs=1e-16)
        assert box_volume(points, axes) == pytest.approx(volume, rel=1e-9, abs=1e-16)
        np.testing.assert_array_equal(axes[0], axis)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-14)
        assert np.linalg.det(axes) > 0.0


def prism(sides, turn):
    angles = turn + 2 * math.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.concatenate([np.insert(ring, 2, z, axis=1) for z in (-0.5, 1.0)])


@pytest.mark.parametrize("turn", [0.0, 0.1, 0.7, math.pi / 4])
@pytest.mark.parametrize(
    ("sides", "area"),
    [(3, 1.5 * math.sqrt(3)), (4, 2.0), (6, 2 * math.sqrt(3)), (8, 4 * math.cos(math.pi / 8) ** 2)],
)
def test_prisms_have_boxes_of_closed_form(sides, area, turn):
    """With corners that are there twice, as a mesh has them, and in any order."""
    points = np.concatenate([prism(sides, turn)] * 2)
    points = points[np.random.default_rng(sides).permutation(len(points))]
    axes = np.empty((3, 3))
    assert turn_about(points, np.array([0.0, 0.0, 1.0]), axes) == pytest.approx(1.5 * area, rel=1e-12)


def test_what_is_thin_about_the_axis_has_no_volume():
    axis, axes = np.array([0.0, 0.0, 1.0]), np.empty((3, 3))
    line = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 2]])
    sheet = np.array([[0.0, 0, 0], [1, 1, 0], [2, 2, 3], [0.5, 0.5, 1]])
    flat = np.array([[0.0, 0, 1], [1, 0, 1], [0, 1, 1]])
    for points in (line, sheet, flat, line[:1]):
        assert turn_about(points, axis, axes) == pytest.approx(0.0, abs=1e-15)
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), rtol=0, atol=1e-15)
    turn_about(sheet, axis, axes)
    assert abs(axes[1, 0]) == pytest.approx(math.sqrt(0.5)) and abs(axes[1, 1]) == pytest.approx(math.sqrt(0.5))
