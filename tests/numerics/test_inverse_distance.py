"""The means of 1/|r| against Wilton's form with 200 digits, on families that break the textbook forms."""

import math

import mpmath as mp
import numpy as np
import pytest

from replay.numerics.inverse_distance import mean_over_segment, mean_over_triangle
from tests.numerics import references

_TOLERANCE = 3e-14  # measured worst of 60 000 cases: 1e-14 (thin, seen along its plane)


def _corners(family: str, rng: np.random.Generator) -> np.ndarray:
    scale = 10 ** rng.uniform(-3, 1)
    p = scale * rng.uniform(0, 1, (3, 3))
    if family == "far":
        direction = rng.uniform(0, 1, 3)
        return p + scale * 10 ** rng.uniform(0, 6) * direction
    if family == "tiny":
        return np.abs(scale * (rng.uniform(0, 1, 3) + 10 ** rng.uniform(-15, -5) * rng.normal(size=(3, 3))))
    if family == "sliver":
        p[2] = np.abs(p[0] + (p[1] - p[0]) * rng.uniform() + scale * 10 ** rng.uniform(-9, -2) * rng.normal(size=3))
    if family == "sliver near":
        p *= 10 ** rng.uniform(-9, 0, (3, 1))
        width = 10 ** rng.uniform(-9, -1) * np.linalg.norm(p[0])
        p[2] = np.abs(p[0] + (p[1] - p[0]) * rng.uniform() + width * rng.normal(size=3))
    if family == "near":
        p *= 10 ** rng.uniform(-12, 0, (3, 3))
    if family == "line":
        p *= 10 ** rng.uniform(-12, 0, (3, 3))
        p[:, rng.integers(3)] = 0.0
    if family == "line along the plane":
        p[:, 1] = 0.0
        p[:, 2] *= 10 ** rng.uniform(-12, 0)
        p[: rng.integers(3), 0] = 0.0
    if family == "needle before its tip":
        # its short edge, of last digits, passes the origin: both long ones have the same length when rounded
        p[0] = rng.choice([0.01, 0.02, 0.1]), 0.0, rng.choice([0.3, 0.84])
        p[1], p[2] = [np.spacing(p[0, 0]) * rng.integers(1, 4), 0.0, 0.0], [0.0, 0.0, 1e-17 * rng.integers(1, 4)]
    if family == "degenerate":
        p[:, 1] = p[:, 0]
        p[:, 2] = 0.0
    if family == "origin at a corner":
        p[rng.integers(3)] = 0.0
    return p


_FAMILIES = ["random", "far", "tiny", "sliver", "sliver near", "near", "line", "line along the plane", "degenerate"]


@pytest.mark.parametrize("family", [*_FAMILIES, "needle before its tip", "origin at a corner"])
def test_mean_over_a_triangle_agrees_with_200_digits(family):
    rng = np.random.default_rng(11)
    for _ in range(60):
        corners = rng.permutation(_corners(family, rng)).tolist()
        expected = references.mean_over_triangle(*corners)
        value = mean_over_triangle(*map(tuple, corners))
        assert abs(float((mp.mpf(value) - expected) / expected)) <= _TOLERANCE, corners


def test_mean_over_a_segment_agrees_with_its_closed_form():
    assert mean_over_segment((1.0, 0.0, 0.0), (math.e, 0.0, 0.0)) == pytest.approx(1 / (math.e - 1), rel=1e-15)
    assert mean_over_segment((-1.0, 1.0, 0.0), (1.0, 1.0, 0.0)) == pytest.approx(math.asinh(1.0), rel=1e-15)
    assert mean_over_segment((0.0, 0.0, 2.0), (0.0, 0.0, 2.0)) == 0.5
    assert mean_over_segment((-1.0, 0.0, 0.0), (2.0, 0.0, 0.0)) == math.inf


def test_degenerate_triangles_have_finite_means_unless_they_contain_the_origin():
    assert mean_over_triangle((0.0, 3.0, 4.0), (0.0, 3.0, 4.0), (0.0, 3.0, 4.0)) == 0.2
    assert mean_over_triangle((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 0.0, 0.0)) == pytest.approx(2.0, rel=1e-15)
    assert mean_over_triangle((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 0.0)) == math.inf
