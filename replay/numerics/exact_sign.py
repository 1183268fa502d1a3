"""Signs of small determinants, exact for all finite doubles: rounding, underflow and overflow cannot turn them.

A sign is taken from ordinary arithmetic where it is larger than its error bound. Else every product of three doubles is
added as an integer to one fixed-point number that is wide enough for all of them (Kulisch's long accumulator): limbs of
27 bits in 64, so that nothing has to be carried until the end.
"""

from __future__ import annotations

import math

import numpy as np

from replay.numerics.arrays import Floats, Integers
from replay.numerics.double_double import Pair, triangle_area
from replay.numerics.jit import kernel

Row = tuple[Pair, Pair, float]
"""u and v, each an unevaluated sum of two doubles, and z."""

_BITS = 27
_MASK = (1 << _BITS) - 1
_MANTISSA = 53
_LOWEST = 3 * (1074 + _MANTISSA)
"""Minus the exponent of the lowest bit: a product of three doubles, each m 2^e, 2^52 <= m < 2^53, has none below it."""

_LIMBS = (_LOWEST + 3 * 1024) // _BITS + 3

_CERTAIN = 1e-14
"""Bound of the rounding of a determinant over the sum of its terms' sizes; at most 9 roundings of 1.1e-16 meet."""

_SLIVER = 1e-20
"""Area over squared size from which on a triangle is not degenerate: twice the digits of a double leave 1e-30."""

_SMALLEST = 1e-200
"""Below it the sum of the terms may have lost something by underflow (coordinates up to 1e70)."""


@kernel
def _add(total: Integers, a: float, b: float, c: float) -> None:
    """Add a b c to a fixed-point number, exactly."""
    if a == 0.0 or b == 0.0 or c == 0.0:
        return
    fraction_a, exponent_a = math.frexp(a)
    fraction_b, exponent_b = math.frexp(b)
    fraction_c, exponent_c = math.frexp(c)
    sign = 1 if (a > 0.0) == (b > 0.0) else -1
    if c < 0.0:
        sign = -sign
    scale = float(1 << _MANTISSA)
    m_a, m_b, m_c = (
        np.int64(abs(fraction_a) * scale),
        np.int64(abs(fraction_b) * scale),
        np.int64(abs(fraction_c) * scale),
    )
    a0, a1 = m_a & _MASK, m_a >> _BITS
    b0, b1 = m_b & _MASK, m_b >> _BITS
    c0, c1 = m_c & _MASK, m_c >> _BITS
    # a b in four digits, then a b c in six
    t = a0 * b0
    p0 = t & _MASK
    t = (t >> _BITS) + a0 * b1 + a1 * b0
    p1 = t & _MASK
    t = (t >> _BITS) + a1 * b1
    p2, p3 = t & _MASK, t >> _BITS
    bit = exponent_a + exponent_b + exponent_c - 3 * _MANTISSA + _LOWEST
    place, shift = bit // _BITS, bit % _BITS
    t = np.int64(0)
    for k in range(6):
        if k == 0:
            t += p0 * c0
        elif k == 1:
            t += p1 * c0 + p0 * c1
        elif k == 2:
            t += p2 * c0 + p1 * c1
        elif k == 3:
            t += p3 * c0 + p2 * c1
        elif k == 4:
            t += p3 * c1
        digit = (t & _MASK) << shift
        t >>= _BITS
        total[place + k] += sign * (digit & _MASK)
        total[place + k + 1] += sign * (digit >> _BITS)


@kernel
def _sign(total: Integers) -> int:
    carry = np.int64(0)
    some = False
    for k in range(len(total)):
        value = total[k] + carry
        carry = value >> _BITS
        some = some or (value & _MASK) != 0
    if carry < 0:
        return -1
    return 1 if some or carry > 0 else 0


@kernel
def sign_of_difference(a: float, b: Pair, c: float, d: Pair) -> int:
    """Return the sign, -1, 0 or 1, of a b - c d, where b and d are unevaluated sums of two doubles."""
    p, q = a * b[0], c * d[0]
    size = abs(p) + abs(q)
    difference = p - q
    if size > _SMALLEST and abs(difference) > _CERTAIN * size:
        return 1 if difference > 0.0 else -1
    total = np.zeros(_LIMBS, np.int64)
    for k in range(2):
        _add(total, a, b[k], 1.0)
        _add(total, -c, d[k], 1.0)
    return _sign(total)


@kernel
def sign_of_determinant(a: Row, b: Row, c: Row) -> int:
    """Return the sign, -1, 0 or 1, of the determinant of three rows (u, v, z)."""
    bc, cb = b[0][0] * c[1][0], b[1][0] * c[0][0]
    ca, ac = c[0][0] * a[1][0], c[1][0] * a[0][0]
    ab, ba = a[0][0] * b[1][0], a[1][0] * b[0][0]
    size = abs(a[2]) * (abs(bc) + abs(cb)) + abs(b[2]) * (abs(ca) + abs(ac)) + abs(c[2]) * (abs(ab) + abs(ba))
    value = a[2] * (bc - cb) + b[2] * (ca - ac) + c[2] * (ab - ba)
    if size > _SMALLEST and abs(value) > _CERTAIN * size:
        return 1 if value > 0.0 else -1
    total = np.zeros(_LIMBS, np.int64)
    for i in range(2):
        for j in range(2):
            _add(total, a[2], b[0][i], c[1][j])
            _add(total, -a[2], b[1][i], c[0][j])
            _add(total, b[2], c[0][i], a[1][j])
            _add(total, -b[2], c[1][i], a[0][j])
            _add(total, c[2], a[0][i], b[1][j])
            _add(total, -c[2], a[1][i], b[0][j])
    return _sign(total)


@kernel
def has_area(triangle: Floats) -> bool:
    """Return whether the corners of a triangle (3, 3) are not on one line, exactly."""
    for i in range(3):
        j = (i + 1) % 3
        sign = sign_of_determinant(
            ((triangle[0, i], 0.0), (triangle[0, j], 0.0), 1.0),
            ((triangle[1, i], 0.0), (triangle[1, j], 0.0), 1.0),
            ((triangle[2, i], 0.0), (triangle[2, j], 0.0), 1.0),
        )
        if sign != 0:
            return True
    return False


@kernel
def area_or_zero(triangle: Floats) -> float:
    """Return `triangle_area`, and 0 where that is the exact area but rounding left something."""
    area = triangle_area(triangle)
    size = 0.0
    for axis in range(3):
        low = min(triangle[0, axis], triangle[1, axis], triangle[2, axis])
        size = max(size, max(triangle[0, axis], triangle[1, axis], triangle[2, axis]) - low)
    if area > _SLIVER * size * size or has_area(triangle):
        return area
    return 0.0
