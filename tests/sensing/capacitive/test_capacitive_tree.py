"""The tree sum against the exact sum: the tolerance holds near and far, and nothing is lost at contact."""

import numpy as np
import pytest

from replay.geometry.primitives import sphere
from replay.geometry.tree import triangle_tree
from replay.numerics import transforms
from replay.sensing.capacitive.tree.clusters import make_clusters
from replay.sensing.capacitive.tree.registers import (
    AREA,
    CENTROID,
    CORNER5,
    EDGE5,
    FOURTH,
    HALF,
    MEAN2,
    MEAN6,
    MIDDLE,
    RADIUS,
    SECOND,
    SIGMA,
    SIZE,
)
from replay.sensing.capacitive.tree.tree_sum import COUNTS, sum_tree
from replay.sensing.capacitive.triangle_sum import EXACT, sum_triangles, triangle_areas

_HALF_SIZES = np.array([[0.025, 0.1], [0.004, 0.006]])


@pytest.fixture(scope="module")
def body():
    """A bumpy, bent body of 980 triangles, about 0.6 m long, with slivers at its poles."""
    triangles = sphere(0.3, 0.002).triangles
    x, y, z = triangles[..., 0], triangles[..., 1], triangles[..., 2]
    bumps = 1.0 + 0.15 * np.sin(17.0 * x) * np.cos(13.0 * y) + 0.1 * np.sin(23.0 * z)
    return np.ascontiguousarray(np.stack([0.5 * x * bumps + 0.4 * z * z, 0.7 * y * bumps, z * bumps], axis=-1))


def _poses(triangles, count, lowest, highest, seed):
    """Plates before random triangles, 10^lowest..10^highest m away, tilted, mostly facing the body."""
    rng = np.random.default_rng(seed)
    poses = []
    for _ in range(count):
        a, b, c = triangles[rng.integers(len(triangles))]
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        z = -normal + rng.normal(size=3) * rng.choice([0.02, 0.5, 2.0])
        z /= np.linalg.norm(z)
        x = np.cross(z, rng.normal(size=3))
        x /= np.linalg.norm(x)
        pose = transforms.identity()
        pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=-1)
        pose[:3, 3] = (a + b + c) / 3.0 + normal * 10 ** rng.uniform(lowest, highest)
        poses.append(transforms.invert(pose))
    return np.array(poses)[:, None].repeat(len(_HALF_SIZES), axis=1)


@pytest.mark.parametrize(("lowest", "highest"), [(-0.5, 1.0), (-2.0, -0.5), (-7.0, -2.0)])
@pytest.mark.parametrize("both", [False, True])
@pytest.mark.parametrize("facing", [False, True])
def test_the_error_never_exceeds_the_tolerance(body, lowest, highest, both, facing):
    tree = triangle_tree(body)
    clusters = make_clusters(body, tree)
    T = _poses(body, 25, lowest, highest, seed=17)
    exact, touching = sum_triangles(body, triangle_areas(body), T, np.zeros(len(T)), _HALF_SIZES, both, facing, EXACT)
    finite = np.isfinite(exact)
    for rtol in (1e-1, 1e-3, 1e-6, 1e-9):
        value, touches, bound = sum_tree(
            clusters, T, np.zeros(len(T)), _HALF_SIZES, both, facing, rtol, np.zeros(COUNTS, np.int64)
        )
        np.testing.assert_array_equal(np.isinf(value), ~finite)
        np.testing.assert_array_equal(touches, touching)
        expected, error = exact[finite], np.abs(value[finite] - exact[finite])
        assert (error <= rtol * expected + 1e-13 * expected).all()
        assert (error <= bound[finite] + 1e-13 * expected).all()
        assert (bound[finite] <= rtol * expected * (1.0 + rtol)).all()


def _sphere():
    """Directions (128, 3) and weights of a rule on the sphere that is exact up to degree 15."""
    heights, weights = np.polynomial.legendre.leggauss(8)
    angles = (np.arange(16) + 0.5) * np.pi / 8.0
    x, y = np.outer(np.sqrt(1.0 - heights**2), np.cos(angles)), np.outer(np.sqrt(1.0 - heights**2), np.sin(angles))
    directions = np.stack([x, y, np.repeat(heights[:, None], 16, axis=1)], axis=-1).reshape(-1, 3)
    return directions, np.repeat(weights, 16) / 32.0


def test_moments_are_those_of_the_triangles(body):
    tree = triangle_tree(body)
    clusters = make_clusters(body, tree)
    # midpoints of 4^3 sub-triangles of each triangle, as a cloud of points
    steps = [((i + k) / 8, (j + k) / 8) for k in (1 / 3, 2 / 3) for i in range(8) for j in range(8) if i + j + k < 7.7]
    steps = np.array([(s, t) for s, t in steps if s + t < 1.0])
    assert len(steps) == 64
    for node in (0, 1, int(tree.second[0]), len(tree.begin) - 1):
        corners = clusters.triangles[tree.begin[node] : tree.end[node], :9].reshape(-1, 3, 3)
        areas = clusters.triangles[tree.begin[node] : tree.end[node], SIZE]
        a, b, c = corners[:, None, 0], corners[:, None, 1], corners[:, None, 2]
        points = a + steps[None, :, :1] * (b - a) + steps[None, :, 1:] * (c - a) - clusters.nodes[node, CENTROID:3]
        weights = np.repeat(areas[:, None] / 64.0, 64, axis=1) / areas.sum()
        squares = (points**2).sum(axis=-1)
        scale = (weights * squares).sum()
        assert clusters.nodes[node, AREA] == pytest.approx(areas.sum(), rel=1e-12)
        assert clusters.nodes[node, MEAN6] == pytest.approx((weights * squares**3).sum(), rel=8e-2)
        mean5 = np.sqrt((weights * squares**2).sum() * (weights * squares**3).sum())
        fifth = np.einsum("np,npa,npb,npc,npd,npe->abcde", weights, *[points] * 5)
        edge = min(np.sqrt(4.203125 * (fifth**2).sum()), mean5)
        assert clusters.nodes[node, EDGE5] == pytest.approx(edge, abs=6e-2 * scale**2.5)
        # order 5 is a harmonic in the direction of the plate: the mean of its square tells how large it may be
        directions, shares = _sphere()
        along = points @ directions.T
        order5 = (63.0 * along**5 - 70.0 * along**3 * squares[..., None] + 15.0 * along * squares[..., None] ** 2) / 8.0
        order5 = (weights[..., None] * order5).sum(axis=(0, 1))
        corner = min(np.sqrt(11.0 * (shares * order5**2).sum()), mean5)
        assert clusters.nodes[node, CORNER5] == pytest.approx(corner, abs=6e-2 * scale**2.5)
        assert np.abs(order5).max() <= clusters.nodes[node, CORNER5] + 6e-2 * scale**2.5
        xy = clusters.moments[node, SECOND + 3]
        assert xy == pytest.approx((weights * points[..., 0] * points[..., 1]).sum(), abs=2e-2 * scale)
        xxxx = clusters.moments[node, FOURTH]
        assert xxxx == pytest.approx((weights * points[..., 0] ** 4).sum(), abs=3e-2 * scale**2)


def test_a_body_behind_the_plate_counts_on_side_both_only(body):
    tree = triangle_tree(body)
    clusters = make_clusters(body, tree)
    T = transforms.from_translation(np.array([0.0, 0.0, -2.0]))[None, None].repeat(2, axis=1)
    front, _, _ = sum_tree(clusters, T, np.zeros(len(T)), _HALF_SIZES, False, False, 1e-6, np.zeros(COUNTS, np.int64))
    both, _, _ = sum_tree(clusters, T, np.zeros(len(T)), _HALF_SIZES, True, False, 1e-6, np.zeros(COUNTS, np.int64))
    assert (front == 0.0).all()
    assert (both > 0.0).all()


def test_outlines_are_rounded_to_the_safe_side(body):
    tree = triangle_tree(body)
    clusters = make_clusters(body, tree)
    nodes, outlines = clusters.nodes, clusters.outlines.astype(float)
    for column, size in ((RADIUS, nodes[:, RADIUS]), (MEAN2, nodes[:, MEAN2])):
        assert (outlines[:, column] >= size).all()
    for column in (CORNER5, EDGE5, MEAN6):
        assert (outlines[:, column] >= nodes[:, AREA] * nodes[:, column]).all()
    assert (outlines[:, AREA] <= nodes[:, AREA]).all()
    matrices = clusters.moments[:, [SECOND + k for k in (0, 3, 4, 3, 1, 5, 4, 5, 2)]].reshape(-1, 3, 3)
    largest = np.sqrt(np.linalg.eigvalsh(matrices)[:, 2])
    assert (outlines[:, SIGMA] >= largest).all()
    assert (outlines[:, SIGMA] <= 1.02 * largest).all()
    middle = outlines[:, CENTROID : CENTROID + 3] + outlines[:, MIDDLE : MIDDLE + 3]
    half = outlines[:, HALF : HALF + 3] + clusters.blur
    assert (middle - half <= tree.lower).all()
    assert (middle + half >= tree.upper).all()


@pytest.mark.parametrize("scale", [1e-30, 1e-10, 1e10, 1e30])
def test_sizes_that_half_the_digits_do_not_hold_are_summed_within_the_tolerance(body, scale):
    T = _poses(body, 6, -2.0, 0.5, seed=23)
    T[..., :3, 3] *= scale
    scaled = scale * body
    exact, _ = sum_triangles(
        scaled, triangle_areas(scaled), T, np.zeros(len(T)), scale * _HALF_SIZES, False, False, EXACT
    )
    clusters = make_clusters(scaled, triangle_tree(scaled))
    value, _, bound = sum_tree(
        clusters, T, np.zeros(len(T)), scale * _HALF_SIZES, False, False, 1e-4, np.zeros(COUNTS, np.int64)
    )
    finite = np.isfinite(exact)
    assert finite.sum() >= 6
    assert (np.abs(value[finite] - exact[finite]) <= bound[finite] + 1e-13 * exact[finite]).all()
    assert (bound[finite] <= 1e-4 * exact[finite] * (1.0 + 1e-4)).all()
