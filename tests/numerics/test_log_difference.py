import math

import mpmath as mp
import numpy as np
import pytest

from replay.numerics.log_difference import mean_inverse_linear
from tests.amounts import cases
from tests.numerics import references

_TOLERANCE = 2e-14  # measured worst of 20 000 cases: 7e-15, next to the border of the series


def _values(family: str, rng: np.random.Generator) -> np.ndarray:
    scale = 10 ** rng.uniform(-6, 3)
    if family == "random":
        return scale * rng.uniform(0.01, 1, 3)
    if family == "close":
        return scale * (1 + 10 ** rng.uniform(-15, 0) * rng.uniform(-0.5, 0.5, 3))
    if family == "two equal":
        return scale * np.array([1, 1, 1 + 10 ** rng.uniform(-14, 6)])
    if family == "scales":
        return 10 ** rng.uniform(-12, 2, 3)
    values = scale * rng.uniform(0.01, 1, 3)
    values[rng.integers(3)] = 0.0
    return values


@pytest.mark.parametrize("family", ["random", "close", "two equal", "scales", "one zero"])
def test_it_is_the_second_divided_difference_of_z_ln_z(family):
    rng = np.random.default_rng(7)
    for _ in range(cases(100)):
        z = rng.permutation(_values(family, rng)).tolist()
        expected = references.mean_inverse_linear(*z)
        assert abs(float((mp.mpf(mean_inverse_linear(*z)) - expected) / expected)) <= _TOLERANCE, z


def test_equal_values_give_their_inverse_and_two_zeros_give_infinity():
    assert mean_inverse_linear(0.3, 0.3, 0.3) == pytest.approx(1 / 0.3, rel=1e-15)
    assert mean_inverse_linear(0.0, 1.0, 0.0) == math.inf
    assert mean_inverse_linear(0.0, 1.0, 1.0) == pytest.approx(2.0, rel=1e-15)
