"""Differences of products with twice the digits: signs that rounding cannot turn, areas of slivers.

A number is kept as an unevaluated sum (high, low) with |low| <= ulp(high)/2. Sums and products are error-free
transformations (Knuth 1969, Dekker 1971); no fused multiply-add is assumed.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel

Pair = tuple[float, float]

_SPLITTER = 134217729.0  # 2^27 + 1


@kernel
def two_sum(a: float, b: float) -> Pair:
    """Return a + b exactly, as a pair."""
    s = a + b
    t = s - a
    return s, (a - (s - t)) + (b - t)


@kernel
def two_product(a: float, b: float) -> Pair:
    """Return a b exactly, as a pair (|a|, |b| < 1e150, no underflow)."""
    p = a * b
    t = _SPLITTER * a
    a_high = t - (t - a)
    a_low = a - a_high
    t = _SPLITTER * b
    b_high = t - (t - b)
    b_low = b - b_high
    return p, a_low * b_low - (((p - a_high * b_high) - a_low * b_high) - a_high * b_low)


@kernel
def product(a: Pair, b: Pair) -> Pair:
    """Return a b to about 32 digits."""
    p, e = two_product(a[0], b[0])
    e += a[0] * b[1] + a[1] * b[0]
    return two_sum(p, e)


@kernel
def difference_of_products(a: Pair, b: Pair, c: Pair, d: Pair) -> Pair:
    """Return a b - c d to about 32 digits of the larger product: the sign is right, and 0 is 0, short of that."""
    p = product(a, b)
    q = product(c, d)
    s, e = two_sum(p[0], -q[0])
    t, f = two_sum(p[1], -q[1])
    e += t
    s, e = two_sum(s, e)
    return two_sum(s, e + f)


@kernel
def triangle_area(triangle: NDArray[np.float64]) -> float:
    """Return the area [m^2] of a triangle (3, 3) [m], with full relative precision however thin it is."""
    x0, y0, z0 = triangle[0, 0], triangle[0, 1], triangle[0, 2]
    ux, uy, uz = two_sum(triangle[1, 0], -x0), two_sum(triangle[1, 1], -y0), two_sum(triangle[1, 2], -z0)
    vx, vy, vz = two_sum(triangle[2, 0], -x0), two_sum(triangle[2, 1], -y0), two_sum(triangle[2, 2], -z0)
    x = difference_of_products(uy, vz, uz, vy)[0]
    y = difference_of_products(uz, vx, ux, vz)[0]
    z = difference_of_products(ux, vy, uy, vx)[0]
    largest = max(abs(x), abs(y), abs(z))
    if largest <= 0.0:
        return 0.0
    x, y, z = x / largest, y / largest, z / largest
    return 0.5 * largest * math.sqrt(x * x + y * y + z * z)
