"""The plate integral of single triangles, method by method."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import InvalidValue
from replay.numerics.arguments import as_floats
from replay.numerics.arrays import Floats
from replay.numerics.exact_sign import area_or_zero
from replay.numerics.jit import kernel
from replay.sensing.capacitive.contact import SATURATED, contact
from replay.sensing.capacitive.exact import SCRATCH, integral_over_triangle
from replay.sensing.capacitive.placed_plate import beyond_borders

SIDES = ("front", "both")
METHODS = ("exact", "midpoint")
LARGEST_COORDINATE = 1e70
"""[m] Squares of products of coordinates stay finite below it."""

MAX_SPLITS = 12

_SIZE_EXPONENT = 200
"""Sizes are scaled to 2^200: their fourth powers do not overflow, and 2^-1074 of them has a square above 2^-1750."""

_LARGEST_EXPONENT = 1000


def plate_integral(
    triangles: ArrayLike, half_size: ArrayLike, *, side: str = "front", method: str = "exact", splits: int = 4
) -> Floats:
    """Return the integral of dA / dist(x, plate) over each triangle, in the plate's frame.

    The plate is the rectangle |x| <= hx, |y| <= hy, z = 0.

    Args:
        triangles: (n, 3, 3) [m], corners in the plate's frame; a triangle without area contributes 0.
        half_size: (2,) [m], hx and hy, both > 0.
        side: "front" counts the part with z > 0 only, "both" counts all.
        method: "exact", or "midpoint" for the thesis's 4^splits equal sub-triangles.
        splits: of "midpoint", 0..12; checked for every method.

    Returns:
        (n,) [m]; inf where the counted part has positive area and meets the plate in more than one point.

    Raises:
        InvalidValue: a shape, a number or an option is not as stated.

    Accuracy: "exact" 2e-14 relative to the integral, for triangles 1e10 times as wide as the plate too
        (test_plate_integral); 4e-11 for a sliver that passes the plate's edge within 1e-12 of its length, 1e-8 for a
        triangle whose section with z = 0 passes the plate's corner within 1e-16, 3e-8 for one that leaves the plate's
        edge by last digits of its coordinates (a needle as narrow as that there: 2e-7 to 4 % of its own 1e-15 m and
        less). Whether it is infinite is decided without rounding; a finite one above
        1.8e308 m is inf as well. Triangle and plate are scaled by a power of two first, so that their size does not
        matter; distances below 1e-250 of it are not resolved. "midpoint" has an error of order 4^-splits away from the
        plate's plane; a triangle that crosses it on side "front" converges at order 2^-splits.

    Source: Huijgens 2015 for the model and "midpoint"; closed forms of all regions derived in `exact` and `numerics`.
    """
    corners = check_triangles(triangles)
    half_x, half_y = check_half_size(half_size)
    if not isinstance(side, str) or side not in SIDES:
        raise InvalidValue("side", side, f"must be one of {', '.join(SIDES)}")
    if not isinstance(method, str) or method not in METHODS:
        raise InvalidValue("method", method, f"must be one of {', '.join(METHODS)}")
    check_splits(splits)
    if method == "exact":
        return _exact(corners, half_x, half_y, side == "both")
    return _midpoint(corners, half_x, half_y, side == "both", int(splits))


def check_triangles(triangles: ArrayLike) -> Floats:
    """Return triangles (n, 3, 3) as contiguous float64; InvalidValue if they are not that, or not finite."""
    corners = as_floats("triangles", triangles, (None, 3, 3))
    if not (np.abs(corners) <= LARGEST_COORDINATE).all():
        raise InvalidValue("triangles", "array", f"coordinates must be finite and at most {LARGEST_COORDINATE:g} m")
    return corners


def check_half_size(half_size: ArrayLike) -> tuple[float, float]:
    """Return hx and hy [m]; InvalidValue unless both are finite and > 0."""
    size = as_floats("half_size", half_size, (2,))
    if not ((size > 0.0) & (size <= LARGEST_COORDINATE)).all():
        raise InvalidValue("half_size", half_size, "must be two finite lengths > 0 m")
    return float(size[0]), float(size[1])


def check_splits(splits: int) -> None:
    """Raise InvalidValue unless splits is a whole number from 0 to 12."""
    if isinstance(splits, bool) or not isinstance(splits, int | np.integer) or not 0 <= splits <= MAX_SPLITS:
        raise InvalidValue("splits", splits, f"must be a whole number from 0 to {MAX_SPLITS}")


@kernel
def inverse_distance(x: float, y: float, z: float, half_x: float, half_y: float) -> float:
    """Return 1/dist [1/m] of a point to the plate; inf on the plate."""
    u, v = beyond_borders(x, y, half_x, half_y)
    return 1.0 / math.sqrt(u * u + v * v + z * z)


@kernel
def midpoint_over_triangle(
    triangle: Floats, area: float, half_x: float, half_y: float, both: bool, splits: int
) -> float:
    """Return the thesis's midpoint sum [m] for a triangle (3, 3) [m]; inf if saturated, as for every method.

    An edge is divided into 2^n parts; sub-triangle (i, j) has its corner at (i, j)/2^n in the coordinates of the edges
    ab and ac, and the centroids of the upright ones lie 1/3, of the inverted ones 2/3, of a part beyond it.
    """
    if area <= 0.0:
        return 0.0
    if contact(triangle, half_x, half_y, both) == SATURATED:
        return math.inf
    parts = 1 << splits
    a = triangle[0]
    b0, b1, b2 = triangle[1, 0] - a[0], triangle[1, 1] - a[1], triangle[1, 2] - a[2]
    c0, c1, c2 = triangle[2, 0] - a[0], triangle[2, 1] - a[1], triangle[2, 2] - a[2]
    total = 0.0
    for i in range(parts):
        for j in range(parts - i):
            for inverted in range(2 if i + j < parts - 1 else 1):
                offset = (1.0 + inverted) / 3.0
                s, t = (i + offset) / parts, (j + offset) / parts
                z = a[2] + s * b2 + t * c2
                if z > 0.0 or both:
                    total += inverse_distance(a[0] + s * b0 + t * c0, a[1] + s * b1 + t * c1, z, half_x, half_y)
    return total * area / (float(parts) * float(parts))


@kernel
def _scale(triangle: Floats, half_x: float, half_y: float, result: Floats) -> float:
    """Write a triangle times a power of two to `result` (3, 3), so that the smallest numbers are far from underflow.

    Returns the power of two: the plate and the integral scale with it.
    """
    size = max(half_x, half_y)
    for k in range(3):
        for axis in range(3):
            size = max(size, abs(triangle[k, axis]))
    exponent = math.frexp(size)[1]
    factor = math.ldexp(1.0, min(_SIZE_EXPONENT - exponent, _LARGEST_EXPONENT))
    for k in range(3):
        for axis in range(3):
            result[k, axis] = factor * triangle[k, axis]
    return factor


@kernel
def _exact(triangles: Floats, half_x: float, half_y: float, both: bool) -> Floats:
    result = np.empty(len(triangles))
    scratch, scaled = np.empty(SCRATCH), np.empty((3, 3))
    for k in range(len(triangles)):
        factor = _scale(triangles[k], half_x, half_y, scaled)
        area = area_or_zero(scaled) / factor
        result[k] = integral_over_triangle(scaled, area, factor * half_x, factor * half_y, both, scratch)
    return result


@kernel
def _midpoint(triangles: Floats, half_x: float, half_y: float, both: bool, splits: int) -> Floats:
    result = np.empty(len(triangles))
    scaled = np.empty((3, 3))
    for k in range(len(triangles)):
        factor = _scale(triangles[k], half_x, half_y, scaled)
        area = area_or_zero(scaled) / factor
        result[k] = midpoint_over_triangle(scaled, area, factor * half_x, factor * half_y, both, splits)
    return result
