"""The error bounds of the point rules against the worst triangles that a search finds."""

import numpy as np
import pytest

from replay.numerics.gauss import NODES_16, TRIANGLE_7, TRIANGLE_16, WEIGHTS_16
from replay.sensing.capacitive import plate_integral
from replay.sensing.capacitive.tree.registers import POINTS_1, POINTS_3, POINTS_7, POINTS_16
from replay.sensing.capacitive.tree.triangle_bounds import part_above, rule_error
from tests.amounts import cases

_ONE = np.array([[1.0, 1.0, 1.0, 3.0]]).T / 3.0
_THREE = np.array([[4.0, 1.0, 1.0, 2.0], [1.0, 4.0, 1.0, 2.0], [1.0, 1.0, 4.0, 2.0]]).T / 6.0
_RULES = {POINTS_1: _ONE, POINTS_3: _THREE, POINTS_7: TRIANGLE_7, POINTS_16: TRIANGLE_16}
_U, _V = (grid.ravel() for grid in np.meshgrid(NODES_16, NODES_16))
_FINE = np.stack([1.0 - _U, _U * (1.0 - _V), _U * _V, 2.0 * np.outer(WEIGHTS_16, WEIGHTS_16 * NODES_16).ravel()])


def _ratios(rule, triangles, axes, ratios):
    """Error over bound; triangles (n, 3, 2) of radius 1, h/r (n,), axes (n, 3, dims), the first along r."""

    def mean(points):
        places = np.einsum("bk,nbc->nkc", points[:3], triangles) * ratios[:, None, None]
        offsets = np.einsum("nkc,ncd->nkd", places, axes[:, :2])
        offsets[..., 0] += 1.0
        return (points[3] / np.sqrt((offsets**2).sum(axis=-1))).sum(axis=1)

    spreads = (triangles**2).sum(axis=(1, 2)) / 12.0
    bounds = [
        rule_error(rule, 1.0, s * x * x, x, (1.0, 1.0 / (1.0 - x)), 0.0) for s, x in zip(spreads, ratios, strict=True)
    ]
    return np.abs(mean(_RULES[rule]) - mean(_FINE)) / np.array(bounds)


def _climb(rule, dims, samples, rounds, rng):
    """The largest error over bound, by random changes of the worst triangles; 6 numbers say which they are."""

    def value(p):
        triangles = np.stack([np.tile([1.0, 0.0], (len(p), 1)), p[:, :2], -p[:, :2] - [1.0, 0.0]], axis=1)
        triangles /= np.sqrt((triangles**2).sum(axis=2).max(axis=1))[:, None, None]
        q = np.linalg.qr(p[:, 3:].reshape(-1, 3, 3))[0][..., :dims]
        smallest = {POINTS_16: 0.2, POINTS_7: 0.06}.get(rule, 0.01)  # below, rounding is seen
        return _ratios(rule, triangles, q, np.clip(np.abs(p[:, 2]), smallest, 2.0 / 3.0))

    p = rng.normal(size=(samples, 12))
    p[:, 1] *= rng.choice([0.03, 1.0], samples)
    found = value(p)
    worst = np.argsort(-found)[:100]
    p, found = p[worst], found[worst]
    for step in range(rounds):
        changed = p + rng.normal(size=p.shape) * 0.3 * 0.95**step * rng.choice([1.0, 0.1], (len(p), 1))
        better = value(changed)
        p[better > found], found = changed[better > found], np.maximum(better, found)
    return found.max()


@pytest.mark.parametrize("rule", list(_RULES))
@pytest.mark.parametrize("dims", [1, 2, 3])
def test_the_bound_holds_for_the_worst_triangle_of_a_search(rule, dims):
    worst = _climb(rule, dims, 3_000, 30, np.random.default_rng(7 + dims))
    # one point in a plane with r reaches its bound of the Hessian; the others were given twice what is needed
    assert 0.3 < worst <= (1.0 if rule == POINTS_1 else 0.6)


@pytest.mark.soak
@pytest.mark.parametrize("rule", list(_RULES))
@pytest.mark.parametrize("dims", [1, 2, 3])
def test_the_bound_holds_for_the_worst_triangle_of_a_long_search(rule, dims):
    assert _climb(rule, dims, 30_000, 300, np.random.default_rng(99)) <= (1.0 if rule == POINTS_1 else 0.6)


def test_a_part_above_the_plane_is_within_its_bound():
    rng = np.random.default_rng(3)
    half = 0.3
    seen = 0
    for _ in range(cases(400)):
        triangle = rng.normal(size=(3, 3)) * rng.choice([0.05, 0.5]) + [*rng.normal(size=2) * 3.0, 0.0]
        low, high = triangle[:, 2].min(), triangle[:, 2].max()
        offsets = triangle - triangle.mean(axis=0)
        area = 0.5 * np.linalg.norm(np.cross(triangle[1] - triangle[0], triangle[2] - triangle[0]))
        radius = np.sqrt((offsets**2).sum(axis=1).max())
        if low * high >= 0.0:
            continue
        corners = [tuple(corner) for corner in triangle]
        value, bound, _ = part_above(*corners, area, (offsets**2).sum() / 12.0, radius, half, half)
        if np.isinf(bound):
            continue
        seen += 1
        assert abs(value - plate_integral(triangle[None], [half, half])[0]) <= bound
    assert seen > cases(150)
