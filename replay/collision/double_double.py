"""Numbers as unevaluated sums of two doubles: 106 bits, for the few queries that 53 bits cannot decide.

A number is (high, low) with |low| <= ulp(high)/2. Sums and products of two doubles are exact (see
`numerics.double_double`); the operations here have a relative error of a few 2^-104.

Source: T. J. Dekker 1971; D. E. Knuth, TAOCP 2, 4.2.2; Y. Hida, X. S. Li, D. H. Bailey 2001.
"""

from __future__ import annotations

from replay.numerics.double_double import two_product, two_sum
from replay.numerics.jit import kernel

Number = tuple[float, float]
Vector = tuple[Number, Number, Number]


@kernel
def _renormalised(high: float, low: float) -> Number:
    total = high + low
    return total, low - (total - high)


@kernel
def add(a: Number, b: Number) -> Number:
    """Return a + b; no loss when a and b nearly cancel."""
    high, error = two_sum(a[0], b[0])
    low, rest = two_sum(a[1], b[1])
    high, error = _renormalised(high, error + low)
    return _renormalised(high, error + rest)


@kernel
def negative(a: Number) -> Number:
    """Return -a."""
    return -a[0], -a[1]


@kernel
def subtract(a: Number, b: Number) -> Number:
    """Return a - b."""
    return add(a, (-b[0], -b[1]))


@kernel
def multiply(a: Number, b: Number) -> Number:
    """Return a b."""
    high, error = two_product(a[0], b[0])
    return _renormalised(high, error + (a[0] * b[1] + a[1] * b[0]))


@kernel
def divide(a: Number, b: Number) -> Number:
    """Return a / b, b != 0."""
    first = a[0] / b[0]
    rest = subtract(a, multiply(b, (first, 0.0)))
    second = rest[0] / b[0]
    rest = subtract(rest, multiply(b, (second, 0.0)))
    high, low = _renormalised(first, second)
    return add((high, low), (rest[0] / b[0], 0.0))


@kernel
def is_positive(a: Number) -> bool:
    """Return whether a > 0."""
    return a[0] > 0.0 or (a[0] == 0.0 and a[1] > 0.0)


@kernel
def is_less(a: Number, b: Number) -> bool:
    """Return whether a < b."""
    return a[0] < b[0] or (a[0] == b[0] and a[1] < b[1])


@kernel
def dot(u: Vector, v: Vector) -> Number:
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
def scale(factor: Number, u: Vector) -> Vector:
    """Return the vector factor u."""
    return multiply(factor, u[0]), multiply(factor, u[1]), multiply(factor, u[2])
