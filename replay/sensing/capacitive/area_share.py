"""Corners of the pieces that a triangle is cut into, and the share of its area that lies between three of them.

A share is taken from barycentric coordinates, which lose nothing however small the triangle is against its place, or
from the distances beyond the borders and z, which lose nothing however small the piece is against the triangle: areas
projected on one plane have the ratio of the areas. The share with the smallest bound of its rounding is taken.
"""

from __future__ import annotations

from replay.numerics.arrays import Floats
from replay.numerics.double_double import difference_of_products, two_sum
from replay.numerics.jit import kernel

SHARE_A, SHARE_B, SHARE_C, HEIGHT, EAST, WEST, NORTH, SOUTH = range(8)
LOW = 4
COLUMNS = 12
"""Columns of a polygon's corner: barycentric coordinates, |z|, distances beyond the borders. What
rounding took from a distance is LOW columns behind it."""

_EPSILON = 2.3e-16
_PLENTY = 1e-14
"""Relative error of a share from which on the other way is tried."""


@kernel
def share(piece: Floats, a: int, b: int, c: int, triangle: Floats) -> float:
    """Return the area between three corners of a piece over that of the whole triangle (3, 3)."""
    in_a = piece[a, SHARE_A] + piece[b, SHARE_A] + piece[c, SHARE_A]
    in_b = piece[a, SHARE_B] + piece[b, SHARE_B] + piece[c, SHARE_B]
    in_c = piece[a, SHARE_C] + piece[b, SHARE_C] + piece[c, SHARE_C]
    # the two coordinates that are smallest there
    first, second = SHARE_B, SHARE_C
    if in_b >= in_a and in_b >= in_c:
        first = SHARE_A
    elif in_c >= in_a:
        second = SHARE_A
    result, bound = _parallelogram(piece, a, b, c, first, second)
    if bound <= _PLENTY * result:
        return result
    east = _nearer(piece, a, b, c, EAST)
    north = _nearer(piece, a, b, c, NORTH)
    for axis in range(3):
        u, v = (north, HEIGHT) if axis == 0 else ((HEIGHT, east) if axis == 1 else (east, north))
        projected, error = _parallelogram(piece, a, b, c, u, v)
        if projected > 0.0:
            # bounds of shares: seen edge-on, the whole triangle is no larger than the rounding of a piece either
            whole = _projected(triangle, axis)
            if error < bound * whole:
                result, bound = projected / whole, error / whole
    return result


@kernel
def _nearer(piece: Floats, a: int, b: int, c: int, border: int) -> int:
    """Return the column of this border or of the opposite one, from whichever the three corners are less far away."""
    this = max(abs(piece[a, border]), abs(piece[b, border]), abs(piece[c, border]))
    other = max(abs(piece[a, border + 1]), abs(piece[b, border + 1]), abs(piece[c, border + 1]))
    return border if this <= other else border + 1


@kernel
def _parallelogram(piece: Floats, a: int, b: int, c: int, i: int, j: int) -> tuple[float, float]:
    """Return twice the area of three corners in the plane of two columns, and the bound of its rounding."""
    bi, bj = piece[b, i] - piece[a, i], piece[b, j] - piece[a, j]
    ci, cj = piece[c, i] - piece[a, i], piece[c, j] - piece[a, j]
    size_i = max(abs(piece[a, i]), abs(piece[b, i]), abs(piece[c, i]))
    size_j = max(abs(piece[a, j]), abs(piece[b, j]), abs(piece[c, j]))
    error = _EPSILON * (size_i * (abs(bj) + abs(cj)) + size_j * (abs(bi) + abs(ci)))
    return abs(bi * cj - bj * ci), error


@kernel
def _projected(triangle: Floats, axis: int) -> float:
    """Return twice the area of a triangle, projected along an axis."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    bi, bj = two_sum(triangle[1, i], -triangle[0, i]), two_sum(triangle[1, j], -triangle[0, j])
    ci, cj = two_sum(triangle[2, i], -triangle[0, i]), two_sum(triangle[2, j], -triangle[0, j])
    return abs(difference_of_products(bi, cj, bj, ci)[0])
