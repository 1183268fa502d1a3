"""The point of a simplex nearest to the origin, in doubles and in double-doubles, against all features one by one."""

from __future__ import annotations

import itertools

import numba
import numpy as np
import pytest

from replay.collision import exact_simplex
from replay.collision.simplex import (
    INSIDE,
    OUTSIDE,
    UNSURE,
    nearest_on_segment,
    nearest_on_tetrahedron,
    nearest_on_triangle,
)
from tests.amounts import COMPILED, cases


@numba.njit
def _triple(p):
    return p[0], p[1], p[2]


@numba.njit
def segment(p):
    v, square, a, b = nearest_on_segment(_triple(p[0]), _triple(p[1]))
    return 0, v, square, (a, b, 0.0, 0.0)


@numba.njit
def triangle(p):
    v, square, a, b, c = nearest_on_triangle(_triple(p[0]), _triple(p[1]), _triple(p[2]))
    return 0, v, square, (a, b, c, 0.0)


@numba.njit
def tetrahedron(p):
    size = 2.0 * np.abs(p).max()
    s, v, square, a, b, c, d = nearest_on_tetrahedron(_triple(p[0]), _triple(p[1]), _triple(p[2]), _triple(p[3]), size)
    return s, v, square, (a, b, c, d)


@numba.njit
def wide(points, newest, size):
    doubled = np.zeros((4, 3, 2))
    doubled[: len(points), :, 0] = points
    weights = np.zeros(4)
    inside, point, square = exact_simplex.nearest(doubled, len(points), newest, size, weights)
    v = (point[0][0] + point[0][1], point[1][0] + point[1][1], point[2][0] + point[2][1])
    return inside, v, square[0] + square[1], (weights[0], weights[1], weights[2], weights[3])


FAST = {2: segment, 3: triangle, 4: tetrahedron}


def brute(points):
    """The nearest point: of each feature's foot that lies in it, the nearest."""
    best, nearest = np.inf, None
    for size in range(1, len(points) + 1):
        for chosen in itertools.combinations(range(len(points)), size):
            p = points[list(chosen)].astype(np.longdouble)
            ways = p[1:] - p[0]
            shares = (
                np.linalg.lstsq(ways.T.astype(float), -p[0].astype(float), rcond=None)[0] if size > 1 else np.zeros(0)
            )
            if size == 1 or (shares.min() >= 0.0 and shares.sum() <= 1.0):
                foot = (p[0] + shares @ ways).astype(float)
                if foot @ foot < best:
                    best, nearest = foot @ foot, foot
    return nearest


def place(rng, count):
    """Corners whose nearest feature is any: about the origin, or beside it."""
    points = rng.normal(size=(count, 3))
    return points + rng.choice((0.0, 0.3, 1.5, 5.0)) * rng.normal(size=3)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_the_nearest_point_is_that_of_the_nearest_feature(count):
    rng = np.random.default_rng(count)
    features = set()
    for _ in range(cases(500)):
        points = place(rng, count)
        expected = brute(points)
        size = float(np.linalg.norm(points, axis=1).max())
        for status, v, square, weights in (FAST[count](points), wide(points, -1, size)):
            shares = np.array(weights[:count])
            assert (shares >= 0.0).all() and shares.sum() > 0.0
            if status == INSIDE and count == 4:
                assert np.linalg.norm(expected) <= 1e-9 and square == 0.0
                np.testing.assert_allclose(shares @ points / shares.sum(), 0.0, rtol=0, atol=1e-9 * size)
                continue
            np.testing.assert_allclose(shares @ points / shares.sum(), expected, rtol=0, atol=1e-9 * size)
            assert square == pytest.approx(expected @ expected, rel=1e-9, abs=1e-20)
            length = np.linalg.norm(v)
            assert np.asarray(v) @ expected == pytest.approx(length * np.linalg.norm(expected), rel=1e-9, abs=1e-18)
            features.add(tuple(shares > 0.0))
    if COMPILED:  # every corner, edge and face was nearest at some time
        assert len(features) >= 2**count - 1 - (count == 4)


@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_feature_with_the_newest_corner_is_nearest_where_that_is_asked_for(count):
    """The newest corner is lowest along the way to the nearest point of the others, as a support point is."""
    rng = np.random.default_rng(10 + count)
    for _ in range(cases(500)):
        others = place(rng, count - 1) + 3.0
        foot = brute(others)
        newest = others[0] + rng.normal(size=3)
        if newest @ foot > foot @ foot:
            newest = newest - foot * (1.001 + rng.uniform()) * (newest @ foot - foot @ foot) / (foot @ foot)
        points = np.concatenate([others, newest[None]])
        size = float(np.linalg.norm(points, axis=1).max())
        _, v, _, weights = wide(points, count - 1, size)
        assert weights[count - 1] > 0.0
        np.testing.assert_allclose(v, brute(points), rtol=0, atol=1e-9 * size)


@pytest.mark.parametrize(
    "points",
    [
        [(1, 1, 1)] * 2,
        [(1, 2, 3)] * 3,
        [(0, 1, 0), (1, 1, 0), (2, 1, 0)],
        [(-1, 1, 0), (0, 1, 0), (1, 1, 0)],
        [(1, 1, 0), (1, 1, 0), (-1, 1, 0)],
        [(-1, 1, -1), (1, 1, -1), (1, 1, 1), (-1, 1, 1)],
        [(1, 0, 1), (2, 0, 1), (3, 0, 1), (4, 0, 1)],
        [(1, 1, 1)] * 4,
    ],
)
def test_degenerate_simplices_have_a_nearest_point_too(points):
    """In doubles it may be another one, whose shares tell where it is."""
    points = np.array(points, dtype=float)
    expected = brute(points)
    for order in itertools.permutations(range(len(points))):
        moved = np.ascontiguousarray(points[list(order)])
        inside, _, square, weights = wide(moved, -1, 5.0)
        shares = np.array(weights[: len(points)])
        assert not inside and square == pytest.approx(expected @ expected, rel=1e-12)
        np.testing.assert_allclose(shares @ moved / shares.sum(), expected, rtol=0, atol=1e-12)
        status, _, square, weights = FAST[len(points)](moved)
        shares = np.array(weights[: len(points)])
        found = shares @ moved / shares.sum()
        assert status == OUTSIDE and square == pytest.approx(found @ found, rel=1e-12)
        assert square >= expected @ expected * (1.0 - 1e-12)


def test_where_rounding_decides_a_tetrahedron_is_unsure_and_double_doubles_are_not():
    """A face that passes the origin at last digits of the corners, on either side; far off it neither is in doubt."""
    corners = np.array([(1.0, 0, 0), (-0.5, 0.75, 0), (-0.5, -0.75, 0), (0.1, 0.1, 1.0)])
    turn = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))[0]
    for height, fast, inside in ((1e-3, OUTSIDE, False), (-1e-3, INSIDE, True)):
        points = np.ascontiguousarray((corners + np.array([0, 0, height])) @ turn.T)
        assert tetrahedron(points)[0] == fast and wide(points, -1, 2.0)[0] == inside
    for height, inside in ((1e-17, False), (-1e-17, True), (1e-15, False), (-1e-15, True)):
        points = corners + np.array([0, 0, height])
        points[3, 2] = 1.0
        assert tetrahedron(points)[0] == UNSURE and wide(points, -1, 2.0)[0] == inside
