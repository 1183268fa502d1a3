"""Lower bounds of boxes and triangles: never above what is there, and close to it."""

import math

import numpy as np
import pytest

from replay.geometry.surface_boxes import HALVES
from replay.geometry.tree import triangle_tree
from replay.geometry.wide_tree import LANES, widen
from replay.numerics.jit import kernel
from replay.sensing.distance.bounds import box_bounds, triangle_bounds
from replay.sensing.distance.cone import Cone, half_angle
from replay.sensing.distance.query import on_triangle, query_slack
from tests.sensing.distance.meshes import torus
from tests.sensing.distance.test_query import MESHES


@kernel
def every_bound(triangles, tree, apex, cone, slack, of_boxes, of_leaves, distances):
    middle = (tree.middle[0] - apex[0], tree.middle[1] - apex[1], tree.middle[2] - apex[2])
    for node in range(len(tree.boxes)):
        box_bounds(tree.boxes[node], middle, cone, slack, of_boxes[node])
    for leaf in range(len(tree.corners)):
        triangle_bounds(tree.corners[leaf], apex, cone, slack, of_leaves[leaf])
    for k in range(len(triangles)):
        distances[k] = on_triangle(triangles, k, apex, cone)[0]


def compare(triangles, apex, axis, aperture):
    """Return (bounds, distances) of all triangles, and of all boxes; distances are the exact kernel's."""
    tree = widen(triangle_tree(triangles), triangles)
    of_boxes, of_leaves = np.empty((len(tree.boxes), LANES)), np.empty((len(tree.corners), LANES))
    distances = np.empty(len(triangles))
    slack = query_slack(tree, tuple(apex), 0.0)
    every_bound(
        triangles, tree, tuple(apex), Cone(*axis, *half_angle(aperture), 0.0), slack, of_boxes, of_leaves, distances
    )
    held = tree.indices >= 0
    exact_of_leaves = np.where(held, distances[tree.indices], np.inf)
    exact_of_boxes = np.full(of_boxes.shape, np.inf)
    for node in range(len(of_boxes) - 1, -1, -1):  # children come after their parents
        for lane in np.flatnonzero(tree.boxes[node, LANES * HALVES : LANES * (HALVES + 1)] != -np.inf):
            child = tree.children[node, lane]
            exact = exact_of_leaves[-1 - child] if child < 0 else exact_of_boxes[child]
            exact_of_boxes[node, lane] = exact.min()
    used = tree.boxes[:, LANES * HALVES : LANES * (HALVES + 1)] != -np.inf
    assert (of_boxes[~used] == np.inf).all()
    triangle_pair = np.sqrt(of_leaves[held]), exact_of_leaves[held]
    return triangle_pair, (np.sqrt(of_boxes[used]), exact_of_boxes[used]), slack


@pytest.mark.parametrize("name", MESHES)
def test_bounds_are_never_above_the_distance(name):
    rng = np.random.default_rng(20153)
    triangles = np.ascontiguousarray(MESHES[name](rng))
    centre, size = triangles.mean(axis=(0, 1)), np.ptp(triangles, axis=(0, 1)).max()
    apertures = [1e-9, 1e-3, 0.1, 0.5, 2.0, 3.0, math.pi, 3.3, 5.0, 2.0 * math.pi]
    for aperture in np.repeat(apertures, 6):
        apex = centre + size * rng.uniform(0.0, 1.5) * rng.normal(size=3)
        if rng.uniform() < 0.3:
            apex = triangles[rng.integers(len(triangles)), 0]
        axis = triangles[rng.integers(len(triangles))].mean(axis=0) + 0.1 * size * rng.normal(size=3) - apex
        axis = axis / np.linalg.norm(axis)
        for bound, exact, slack in _pairs(triangles, apex, axis, aperture):
            assert (bound <= exact + slack).all()


def _pairs(triangles, apex, axis, aperture):
    of_triangles, of_boxes, slack = compare(triangles, apex, axis, aperture)
    return (*of_triangles, slack), (*of_boxes, slack)


def test_a_triangle_seen_from_all_sides_is_bounded_by_its_distance():
    rng = np.random.default_rng(7)
    triangles = rng.normal(size=(500, 3, 3))
    of_triangles, _, _ = compare(triangles, np.zeros(3), (0.0, 0.0, 1.0), 2.0 * math.pi)
    np.testing.assert_allclose(*of_triangles, rtol=0, atol=1e-12)


def test_triangles_that_reach_into_the_cone_between_their_corners_are_kept():
    rng = np.random.default_rng(9)
    angle = 2.0 * math.pi / 3.0 * np.arange(3)
    around = np.stack([np.cos(angle), np.sin(angle), np.zeros(3)], axis=1)
    pierced = [size * around + [0.0, 0.0, 1.0] for size in 10.0 ** rng.uniform(-6.0, 2.0, 50)]
    of_triangles, _, slack = compare(np.array(pierced), np.zeros(3), (0.0, 0.0, 1.0), 1e-6)
    np.testing.assert_allclose(of_triangles[1], 1.0, rtol=1e-15)
    np.testing.assert_allclose(of_triangles[0], 1.0, rtol=0, atol=slack)

    tan = math.tan(math.radians(15.0))  # an edge, square to the axis, that the cone only just reaches
    half = 10.0 ** rng.uniform(-6.0, 1.0, 50)
    inward = tan * (1.0 - 1e-12)
    edges = [[[inward, -w, 1.0], [inward, w, 1.0], [inward + w, 0.0, 1.0]] for w in half]
    of_triangles, _, slack = compare(np.array(edges), np.zeros(3), (0.0, 0.0, 1.0), math.radians(30.0))
    assert np.isfinite(of_triangles[1]).all()
    assert (of_triangles[0] <= of_triangles[1] + slack).all()


def test_bounds_leave_little_to_do():
    triangles = torus(200, 80)
    rng = np.random.default_rng(8)
    boxes, extra = [], []
    for _ in range(20):
        apex = rng.normal(size=3)
        apex *= 2.5 / np.linalg.norm(apex)
        axis = -apex / 2.5
        of_triangles, of_boxes, _ = compare(triangles, apex, axis, math.radians(30.0))
        closest = of_triangles[1].min()
        boxes.append(np.sum(of_boxes[0] <= closest))
        extra.append(np.sum(of_triangles[0] <= closest))
    assert np.mean(boxes) < 30  # of 5 000
    assert np.mean(extra) < 15  # of 32 000
