"""The tree on a body of real size: its error stays below the tolerance at poses near, far and at touching distance."""

import math

import numpy as np
import pytest

from replay.bench.inputs import around, phantom
from replay.geometry.tree import triangle_tree
from replay.numerics import transforms
from replay.sensing.capacitive.tree.clusters import make_clusters
from replay.sensing.capacitive.tree.tree_sum import COUNTS, sum_tree
from replay.sensing.capacitive.triangle_sum import EXACT, sum_triangles, triangle_areas

pytestmark = pytest.mark.compiled  # a phantom of 26 756 triangles

_PLATE = np.array([[0.025, 0.1]])
_REGIMES = {
    "touching": (1e-9, 0.01, 30.0),
    "near": (0.01, 0.1, 10.0),
    "middle": (0.1, 0.5, 60.0),
    "far": (0.5, 5.0, 90.0),
}
_ROUNDING = 1e-12
"""Relative rounding of two sums over 26 756 triangles."""


@pytest.fixture(scope="module")
def body():
    triangles = phantom(26_756)
    tree = triangle_tree(triangles)
    return triangles, make_clusters(triangles, tree)


def _back_off(T, triangles, gaps):
    """Move plates back along their normals until what is before them begins at a gap [m]."""
    T, (half_x, half_y) = T.copy(), _PLATE[0]
    for pose, gap in zip(T, gaps, strict=True):
        corners = transforms.apply(pose, triangles)
        low, high = corners.min(axis=1), corners.max(axis=1)
        x, y = (low[:, 0] <= half_x) & (high[:, 0] >= -half_x), (low[:, 1] <= half_y) & (high[:, 1] >= -half_y)
        pose[2, 3] += gap - low[x & y, 2].min()
    return T


def _worst(body, regime, count, both, facing, seed):
    """The largest error over rtol, at poses of which some lie in the body."""
    triangles, clusters = body
    near, far, tilt = _REGIMES[regime]
    T_body_plate = around(triangles, count, near=near, far=far, tilt=math.radians(tilt), seed=seed)
    T = transforms.invert(T_body_plate)
    if regime == "touching":
        T = _back_off(T, triangles, np.geomspace(near, far, count))
    T = np.ascontiguousarray(T[:, None])
    exact, touching = sum_triangles(
        triangles, triangle_areas(triangles), T, np.zeros(len(T)), _PLATE, both, facing, EXACT
    )
    finite = np.isfinite(exact) & (exact > 0.0)
    worst = 0.0
    for rtol in (1e-2, 1e-4, 1e-6, 1e-9):
        value, touches, bound = sum_tree(
            clusters, T, np.zeros(len(T)), _PLATE, both, facing, rtol, np.zeros(COUNTS, np.int64)
        )
        np.testing.assert_array_equal(touches, touching)
        np.testing.assert_array_equal(value[~finite], exact[~finite])
        error = np.abs(value[finite] - exact[finite])
        assert (error <= bound[finite] + _ROUNDING * exact[finite]).all()
        assert (bound[finite] <= rtol * exact[finite] * (1.0 + _ROUNDING)).all()
        worst = max(worst, ((error - _ROUNDING * exact[finite]) / (rtol * exact[finite])).max(initial=0.0))
    return worst, int(finite.sum())


@pytest.mark.parametrize("regime", list(_REGIMES))
def test_the_tolerance_holds_on_the_phantom(body, regime):
    worst, finite = _worst(body, regime, 8, False, False, seed=5)
    assert worst <= 1.0
    assert finite >= 4
    assert _worst(body, regime, 2, True, True, seed=6)[0] <= 1.0


@pytest.mark.soak
@pytest.mark.parametrize("regime", list(_REGIMES))
@pytest.mark.parametrize(("both", "facing", "count"), [(False, False, 250), (True, False, 50), (False, True, 100)])
def test_the_tolerance_holds_on_the_phantom_at_a_thousand_poses(body, regime, both, facing, count):
    worst, finite = _worst(body, regime, count, both, facing, seed=29)
    print(f"{regime}, side both: {both}, facing: {facing}: {finite} poses, worst error {worst:.3f} rtol")
    assert worst <= 1.0
    assert finite >= count // 5
