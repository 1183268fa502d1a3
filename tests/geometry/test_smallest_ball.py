"""The smallest ball around points, against the balls through all sets of at most four of them."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from replay.geometry.smallest_ball import smallest_ball_centre
from tests.amounts import cases


def through(points):
    """Centre of the smallest sphere through points, by least squares; None where they determine none."""
    first, ways = points[0], points[1:] - points[0]
    if len(ways) == 0:
        return first
    shares, _, rank, _ = np.linalg.lstsq(2 * ways @ ways.T, np.sum(ways * ways, axis=1), rcond=1e-12)
    return first + shares @ ways if rank == len(ways) else None


def brute(points):
    """Radius of the smallest ball: of all through one to four points that hold the others, the smallest."""
    best = np.inf
    for size in range(1, 5):
        for chosen in itertools.combinations(range(len(points)), min(size, len(points))):
            centre = through(points[list(chosen)])
            if centre is not None:
                best = min(best, float(np.max(np.linalg.norm(points - centre, axis=1))))
    return best


def radius(points):
    return float(np.max(np.linalg.norm(points - smallest_ball_centre(points), axis=1)))


@pytest.mark.parametrize("count", [1, 2, 3, 4, 5, 9])
@pytest.mark.parametrize("flat", [1.0, 0.05, 0.0])
def test_no_ball_through_at_most_four_points_is_smaller(count, flat):
    rng = np.random.default_rng([count, int(100 * flat)])
    for _ in range(10):
        points = rng.normal(size=(count, 3)) * (0.4, 0.4, 0.4 * flat) + 0.1
        assert radius(points) == pytest.approx(brute(points), rel=1e-9)


@pytest.mark.parametrize("support", [2, 3, 4])
def test_a_ball_that_is_known_is_found_among_many_points_inside(support):
    """The support of two to four points lies on a unit sphere and holds its centre between them."""
    rng = np.random.default_rng(support)
    for _ in range(cases(100)):
        while True:
            on = rng.normal(size=(support, 3))
            on /= np.linalg.norm(on, axis=1)[:, None]
            if support == 2:
                on[1] = -on[0]
            if support == 3:  # on one great circle
                on[2] -= np.cross(on[0], on[1]) * (on[2] @ np.cross(on[0], on[1])) / np.sum(np.cross(on[0], on[1]) ** 2)
                on[2] /= np.linalg.norm(on[2])
            shares = np.linalg.lstsq(np.vstack([on.T, np.ones(support)]), (0, 0, 0, 1), rcond=None)[0]
            if shares.min() > 0.02:
                break
        inside = rng.normal(size=(30, 3))
        inside *= (rng.uniform(0, 0.999, size=30) / np.linalg.norm(inside, axis=1))[:, None]
        points = 0.5 * np.concatenate([on, inside])[rng.permutation(support + 30)]
        np.testing.assert_allclose(smallest_ball_centre(points), 0.0, rtol=0, atol=1e-7)
        assert radius(points) == pytest.approx(0.5, rel=1e-12)


def test_equal_points_and_points_on_a_line_have_a_ball():
    assert radius(np.array([[0.3, -0.2, 0.1]] * 5)) == 0.0
    line = np.array([[0.0, 0, 0], [0.1, 0.1, 0], [0.4, 0.4, 0], [0.2, 0.2, 0]])
    np.testing.assert_allclose(smallest_ball_centre(line), (0.2, 0.2, 0.0), rtol=0, atol=1e-15)
