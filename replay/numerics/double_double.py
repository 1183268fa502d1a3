"""Numbers with twice the digits, as unevaluated sums of two doubles: what 53 bits cannot decide.

A number is (high, low) with |low| <= ulp(high)/2. Sums and products of two doubles are exact, and no fused multiply-add
is assumed; the operations on pairs have a relative error of a few 2^-104.

Source: T. J. Dekker 1971; D. E. Knuth, TAOCP 2, 4.2.2; Y. Hida, X. S. Li, D. H. Bailey 2001.
"""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats
from replay.numerics.jit import kernel, leaf_kernel

Pair = tuple[float, float]
Vector = tuple[Pair, Pair, Pair]

_SPLITTER = 134217729.0  # 2^27 + 1


@leaf_kernel
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
def _renormalised(high: float, low: float) -> Pair:
    total = high + low
    return total, low - (total - high)


@kernel
def add(a: Pair, b: Pair) -> Pair:
    """Return a + b; no loss when a and b nearly cancel."""
    high, error = two_sum(a[0], b[0])
    low, rest = two_sum(a[1], b[1])
    high, error = _renormalised(high, error + low)
    return _renormalised(high, error + rest)


@kernel
def negative(a: Pair) -> Pair:
    """Return -a."""
    return -a[0], -a[1]


@kernel
def subtract(a: Pair, b: Pair) -> Pair:
    """Return a - b."""
    return add(a, (-b[0], -b[1]))


@kernel
def multiply(a: Pair, b: Pair) -> Pair:
    """Return a b."""
    high, error = two_product(a[0], b[0])
    return _renormalised(high, error + (a[0] * b[1] + a[1] * b[0]))


@kernel
def divide(a: Pair, b: Pair) -> Pair:
    """Return a / b, b != 0."""
    first = a[0] / b[0]
    rest = subtract(a, multiply(b, (first, 0.0)))
    second = rest[0] / b[0]
    rest = subtract(rest, multiply(b, (second, 0.0)))
    high, low = _renormalised(first, second)
    return add((high, low), (rest[0] / b[0], 0.0))


@kernel
def is_positive(a: Pair) -> bool:
    """Return whether a > 0."""
    return a[0] > 0.0 or (a[0] == 0.0 and a[1] > 0.0)


@kernel
def is_less(a: Pair, b: Pair) -> bool:
    """Return whether a < b."""
    return a[0] < b[0] or (a[0] == b[0] and a[1] < b[1])


@kernel
def difference_of_products(a: Pair, b: Pair, c: Pair, d: Pair) -> Pair:
    """Return a b - c d to about 32 digits of the larger product: the sign is right, and 0 is 0, short of that."""
    p = multiply(a, b)
    q = multiply(c, d)
    s, e = two_sum(p[0], -q[0])
    t, f = two_sum(p[1], -q[1])
    e += t
    s, e = two_sum(s, e)
    return two_sum(s, e + f)


@kernel
def dot(u: Vector, v: Vector) -> Pair:
    """Return the inner product of two vectors."""
    return add(add(multiply(u[0], v[0]), multiply(u[1], v[1])), multiply(u[2], v[2]))


@kernel
def difference(u: Vector, v: Vector) -> Vector:
    """Return the vector u - v."""
    return subtract(u[0], v[0]), subtract(u[1], v[1]), subtract(u[2], v[2])


@kernel
def cross(u: Vector, v: Vector) -> Vector:
    """Return the vector product u x v."""
    return (
        subtract(multiply(u[1], v[2]), multiply(u[2], v[1])),
        subtract(multiply(u[2], v[0]), multiply(u[0], v[2])),
        subtract(multiply(u[0], v[1]), multiply(u[1], v[0])),
    )


@kernel
def scale(factor: Pair, u: Vector) -> Vector:
    """Return the vector factor u."""
    return multiply(factor, u[0]), multiply(factor, u[1]), multiply(factor, u[2])


@kernel
def triangle_area(triangle: Floats) -> float:
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
