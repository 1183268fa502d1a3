"""Signs of determinants against rational arithmetic, from denormal numbers to overflowing products."""

from fractions import Fraction

import numpy as np

from replay.numerics.double_double import two_sum
from replay.numerics.exact_sign import sign_of_determinant, sign_of_difference
from tests.amounts import cases


def _sign(value: Fraction) -> int:
    return (value > 0) - (value < 0)


def _pair(rng, spread):
    a, b = rng.normal(size=2) * 2.0 ** rng.integers(-spread, spread, 2)
    return two_sum(float(a), float(b))


def _sum(pair) -> Fraction:
    return Fraction(pair[0]) + Fraction(pair[1])


def _determinant(rows) -> Fraction:
    (ua, va, za), (ub, vb, zb), (uc, vc, zc) = [(_sum(u), _sum(v), Fraction(z)) for u, v, z in rows]
    return za * (ub * vc - vb * uc) + zb * (uc * va - vc * ua) + zc * (ua * vb - va * ub)


def test_differences_that_cancel_have_the_sign_of_rational_arithmetic():
    rng = np.random.default_rng(1)
    signs = []
    for k in range(cases(3000)):
        spread = (2, 40, 300, 1000)[k % 4]
        a, b = float(rng.normal() * 2.0 ** rng.integers(-spread, spread)), _pair(rng, spread)
        factor = 2.0 ** int(rng.integers(-3, 4))
        c, d = a * factor, (b[0] / factor, b[1] / factor)
        if k % 3 == 0:
            d = (d[0], float(np.nextafter(d[1], np.inf)))
        if not np.isfinite([c, *d]).all():
            continue
        expected = _sign(Fraction(a) * _sum(b) - Fraction(c) * _sum(d))
        signs.append(expected)
        assert sign_of_difference(a, b, c, d) == expected
    assert 0.3 < np.mean(np.array(signs) == 0) < 0.9


def test_determinants_of_dependent_rows_are_zero_and_of_almost_dependent_ones_are_not():
    rng = np.random.default_rng(2)
    signs = []
    for k in range(cases(2000)):
        spread = (2, 30, 300, 700)[k % 4]
        rows = [
            [float(x) for x in rng.integers(-(2**20), 2**20, 3) * 2.0 ** rng.integers(-spread, spread)]
            for _ in range(2)
        ]
        s, t = (int(x) for x in rng.integers(-8, 9, 2))
        third = [s * Fraction(x) + t * Fraction(y) for x, y in zip(*rows, strict=True)]
        pairs = []
        for value in third:
            high = float(value)
            pairs.append((high, float(value - Fraction(high))))
        if not np.isfinite(pairs).all() or pairs[2][1] != 0.0:
            continue
        a, b = (((row[0], 0.0), (row[1], 0.0), row[2]) for row in rows)
        c = (pairs[0], pairs[1], pairs[2][0])
        if k % 2:
            c = (pairs[0], (pairs[1][0], float(np.nextafter(pairs[1][1], 1.0))), c[2])
        expected = _sign(_determinant([a, b, c]))
        signs.append(expected)
        assert sign_of_determinant(a, b, c) == expected
        assert sign_of_determinant(b, c, a) == expected
        assert sign_of_determinant(b, a, c) == -expected
    counts = np.unique(signs, return_counts=True)[1]
    assert (counts > cases(100)).all()


def test_random_determinants_have_the_sign_of_rational_arithmetic():
    rng = np.random.default_rng(3)
    for _ in range(cases(500)):
        rows = [(_pair(rng, 60), _pair(rng, 60), float(rng.normal())) for _ in range(3)]
        assert sign_of_determinant(*rows) == _sign(_determinant(rows))


def test_smallest_and_largest_numbers():
    tiny, huge = 5e-324, 1.7e308
    assert sign_of_difference(tiny, (tiny, 0.0), tiny, (tiny, 0.0)) == 0
    assert sign_of_difference(tiny, (tiny, 0.0), tiny, (2 * tiny, 0.0)) == -1
    assert sign_of_difference(huge, (huge, 0.0), huge, (-huge, 0.0)) == 1
    zero = (0.0, 0.0)
    unit = [((tiny, 0.0), zero, 0.0), (zero, (tiny, 0.0), 0.0), (zero, zero, -tiny)]
    assert sign_of_determinant(*unit) == -1
    large = [((huge, 0.0), zero, 0.0), (zero, (huge, 0.0), 0.0), (zero, zero, huge)]
    assert sign_of_determinant(*large) == 1
