from fractions import Fraction

import mpmath as mp
import numpy as np
import pytest

from replay.numerics.double_double import difference_of_products, triangle_area, two_product, two_sum
from tests.amounts import cases


def test_sums_and_products_are_exact():
    rng = np.random.default_rng(1)
    for _ in range(cases(300)):
        a, b = (rng.normal(size=2) * 10 ** rng.uniform(-20, 20, 2)).tolist()
        for result, exact in (
            (two_sum(a, b), Fraction(a) + Fraction(b)),
            (two_product(a, b), Fraction(a) * Fraction(b)),
        ):
            assert Fraction(result[0]) + Fraction(result[1]) == exact


def test_the_sign_of_a_difference_of_products_survives_cancellation():
    rng = np.random.default_rng(2)
    for _ in range(cases(300)):
        a, b, c = rng.normal(size=3).tolist()
        d = a * b / c * (1.0 + rng.integers(-3, 4) * 2.0**-52)
        exact = Fraction(a) * Fraction(b) - Fraction(c) * Fraction(d)
        value = difference_of_products((a, 0.0), (b, 0.0), (c, 0.0), (d, 0.0))[0]
        assert value == pytest.approx(float(exact), rel=1e-14, abs=0.0)
    assert difference_of_products((0.1, 0.0), (0.3, 0.0), (0.3, 0.0), (0.1, 0.0)) == (0.0, 0.0)


def test_the_area_of_a_sliver_has_all_its_digits():
    rng = np.random.default_rng(3)
    with mp.workdps(60):
        for _ in range(cases(200)):
            p = rng.uniform(-1, 1, (3, 3))
            p[2] = p[0] + rng.uniform() * (p[1] - p[0]) + 10 ** rng.uniform(-15, 0) * rng.normal(size=3)
            u, v = ([mp.mpf(float(x)) - mp.mpf(float(y)) for x, y in zip(p[k], p[0], strict=True)] for k in (1, 2))
            n = [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
            expected = mp.sqrt(sum(x * x for x in n)) / 2
            assert abs(float(triangle_area(p) / expected - 1)) <= 1e-15
    assert triangle_area(np.array([[0.1, 0.2, 0.3], [0.2, 0.4, 0.6], [0.4, 0.8, 1.2]])) == 0.0
