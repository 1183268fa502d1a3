"""Cross products that must not lose digits.

A cross product of nearly parallel vectors cancels: in plain arithmetic an edge that points almost at the apex has a
plane whose normal is noise. With a fused multiply-add the rounding error of a product is known exactly, so a difference
of two products costs two operations more and is right to two units in the last place, always (Kahan; proved by
Jeannerod, Louvet and Muller 2013).
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from numba import types
from numba.extending import intrinsic, overload

from replay.numerics.jit import kernel
from replay.numerics.triples import Triple


def fma(x: float, y: float, z: float) -> float:
    """Return x y + z, rounded once."""
    return float(Fraction(x) * Fraction(y) + Fraction(z))


@intrinsic
def _hardware_fma(_typing: Any, x: Any, y: Any, z: Any) -> Any:
    def generate(_context: Any, builder: Any, _signature: Any, arguments: Any) -> Any:
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), generate


@overload(fma)
def _compiled_fma(x: Any, y: Any, z: Any) -> Any:
    def fused(x: Any, y: Any, z: Any) -> Any:
        return _hardware_fma(x, y, z)

    return fused


@kernel
def difference_of_products(a: float, b: float, c: float, d: float) -> float:
    """Return a b - c d, right to two units in the last place."""
    cd = c * d
    return fma(a, b, -cd) + fma(-c, d, cd)


@kernel
def accurate_cross(a: Triple, b: Triple) -> Triple:
    """Return a × b, each component right to two units in the last place."""
    return (
        difference_of_products(a[1], b[2], a[2], b[1]),
        difference_of_products(a[2], b[0], a[0], b[2]),
        difference_of_products(a[0], b[1], a[1], b[0]),
    )


@kernel
def _add_product(high: float, low: float, x: float, y: float) -> tuple[float, float]:
    """Return the pair high + low plus the exact product x y."""
    product = x * y
    error = fma(x, y, -product)
    total = high + product
    part = total - high
    return total, low + ((high - (total - part)) + (product - part)) + error


@kernel
def _doubled_area(ay: float, az: float, by: float, bz: float, cy: float, cz: float) -> float:
    """Return (b - a) × (c - a) of three points of a plane in twice the working precision, rounded."""
    high, low = _add_product(0.0, 0.0, ay, bz)
    high, low = _add_product(high, low, -az, by)
    high, low = _add_product(high, low, by, cz)
    high, low = _add_product(high, low, -bz, cy)
    high, low = _add_product(high, low, cy, az)
    high, low = _add_product(high, low, -cz, ay)
    return high + low


@kernel
def accurate_normal(a: Triple, b: Triple, c: Triple) -> Triple:
    """Return a × b + b × c + c × a, in twice the working precision before it is rounded; for slivers."""
    return (
        _doubled_area(a[1], a[2], b[1], b[2], c[1], c[2]),
        _doubled_area(a[2], a[0], b[2], b[0], c[2], c[0]),
        _doubled_area(a[0], a[1], b[0], b[1], c[0], c[1]),
    )
