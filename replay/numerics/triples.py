"""Vectors as triples of numbers, which kernels pass in registers."""

from __future__ import annotations

import math

from replay.numerics.jit import inlined_kernel, leaf_kernel

Triple = tuple[float, float, float]

UNDERFLOW = 1e-280
"""Below it a square has lost digits, or all of them."""


@inlined_kernel
def minus(a: Triple, b: Triple) -> Triple:
    """Return a - b."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2])


@inlined_kernel
def scaled(factor: float, a: Triple) -> Triple:
    """Return factor a."""
    return (factor * a[0], factor * a[1], factor * a[2])


@inlined_kernel
def along(a: Triple, factor: float, b: Triple) -> Triple:
    """Return a + factor b."""
    return (a[0] + factor * b[0], a[1] + factor * b[1], a[2] + factor * b[2])


@inlined_kernel
def combined(p: float, a: Triple, q: float, b: Triple) -> Triple:
    """Return p a + q b."""
    return (p * a[0] + q * b[0], p * a[1] + q * b[1], p * a[2] + q * b[2])


@inlined_kernel
def dot(a: Triple, b: Triple) -> float:
    """Return the scalar product of a and b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined_kernel
def cross(a: Triple, b: Triple) -> Triple:
    """Return the vector product of a and b."""
    return (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])


@leaf_kernel
def norm(a: Triple) -> float:
    """Return the length of a, without underflow."""
    square = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    if square < UNDERFLOW:
        largest = max(abs(a[0]), abs(a[1]), abs(a[2]))
        if largest > 0.0:
            x, y, z = a[0] / largest, a[1] / largest, a[2] / largest
            return largest * math.sqrt(x * x + y * y + z * z)
    return math.sqrt(square)
