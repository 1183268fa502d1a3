"""The plate integral of single triangles, method by method."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.errors import InvalidValue
from replay.numerics.double_double import triangle_area
from replay.numerics.jit import kernel
from replay.sensing.capacitive.exact import SCRATCH, integral_over_triangle
from replay.sensing.capacitive.midpoint import midpoint_over_triangle

Floats = NDArray[np.float64]

SIDES = ("front", "both")
LARGEST_COORDINATE = 1e70
"""[m] Squares of products of coordinates stay finite below it."""

MAX_SPLITS = 12


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
        splits: of "midpoint", 0..12.

    Returns:
        (n,) [m]; inf where the counted part has positive area and meets the plate in more than one point.

    Raises:
        InvalidValue: a shape, a number or an option is not as stated.

    Accuracy: "exact" 1e-14 relative to the integral (test_plate_integral). "midpoint" has an error of order 4^-splits
    away from the plate's plane; a triangle that crosses it on side "front" converges at order 2^-splits.

    Source: Huijgens 2015 for the model and "midpoint"; closed forms of all regions derived in `exact` and `numerics`.
    """
    corners = check_triangles(triangles)
    half_x, half_y = check_half_size(half_size)
    if side not in SIDES:
        raise InvalidValue("side", side, f"must be one of {', '.join(SIDES)}")
    if method == "exact":
        return _exact(corners, half_x, half_y, side == "both")
    if method == "midpoint":
        check_splits(splits)
        return _midpoint(corners, half_x, half_y, side == "both", splits)
    raise InvalidValue("method", method, "must be one of exact, midpoint")


def check_triangles(triangles: ArrayLike) -> Floats:
    """Return triangles (n, 3, 3) as contiguous float64; InvalidValue if they are not that, or not finite."""
    corners = np.ascontiguousarray(triangles, dtype=np.float64)
    if corners.ndim != 3 or corners.shape[1:] != (3, 3):
        raise InvalidValue("triangles", f"array of shape {corners.shape}", "must have the shape (n, 3, 3)")
    if not (np.abs(corners) <= LARGEST_COORDINATE).all():
        raise InvalidValue("triangles", "array", f"coordinates must be finite and at most {LARGEST_COORDINATE:g} m")
    return corners


def check_half_size(half_size: ArrayLike) -> tuple[float, float]:
    """Return hx and hy [m]; InvalidValue unless both are finite and > 0."""
    size = np.asarray(half_size, dtype=np.float64)
    if size.shape != (2,) or not ((size > 0.0) & (size <= LARGEST_COORDINATE)).all():
        raise InvalidValue("half_size", half_size, "must be two finite lengths > 0 m")
    return float(size[0]), float(size[1])


def check_splits(splits: int) -> None:
    """Raise InvalidValue unless splits is a whole number from 0 to 12."""
    if isinstance(splits, bool) or not isinstance(splits, int | np.integer) or not 0 <= splits <= MAX_SPLITS:
        raise InvalidValue("splits", splits, f"must be a whole number from 0 to {MAX_SPLITS}")


@kernel
def _exact(triangles: Floats, half_x: float, half_y: float, both: bool) -> Floats:
    result = np.empty(len(triangles))
    scratch = np.empty(SCRATCH)
    for k in range(len(triangles)):
        area = triangle_area(triangles[k])
        result[k] = integral_over_triangle(triangles[k], area, half_x, half_y, both, scratch)
    return result


@kernel
def _midpoint(triangles: Floats, half_x: float, half_y: float, both: bool, splits: int) -> Floats:
    result = np.empty(len(triangles))
    for k in range(len(triangles)):
        area = triangle_area(triangles[k])
        result[k] = midpoint_over_triangle(triangles[k], area, half_x, half_y, both, splits)
    return result
