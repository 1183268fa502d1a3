"""The exact reading of one cone on a set of triangles, as a function for direct use."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from replay.errors import InvalidValue
from replay.kinematics.linkage import POSE_ROUNDING
from replay.numerics.arguments import as_float, as_floats
from replay.numerics.arrays import Floats
from replay.sensing.distance.cone import Cone, half_angle
from replay.sensing.distance.query import closest_of_all


@dataclass(frozen=True, eq=False)
class ConeHit:
    """The closest point of a set of triangles in a cone.

    Attributes:
        detected: whether any point of the triangles is in the cone and in range.
        distance: from the apex [m]; NaN when nothing is detected.
        point: (3,) [m], in the frame of the triangles; NaN when nothing is detected.
        triangle: index of the triangle, the lowest among equally close ones; -1 when nothing is detected.
        case: the thesis's case: 1 foot on the triangle, 2 border of the conic section, 3 an edge meets the cone,
            4 foot on an edge, 5 corner; 0 when nothing is detected.
    """

    detected: bool
    distance: float
    point: Floats
    triangle: int
    case: int


def closest_in_cone(
    triangles: ArrayLike, apex: ArrayLike, axis: ArrayLike, aperture: float, *, range: float = math.inf
) -> ConeHit:
    """Return the closest point of triangles to the apex of a cone, inside the cone and within range.

    Args:
        triangles: (n, 3, 3) corners [m]; points, segments and slivers are allowed; n may be 0.
        apex: (3,) [m].
        axis: (3,), of any length but zero.
        aperture: full opening angle [rad], above 0 up to 2 pi; pi is the closed half space.
        range: largest distance that is sensed [m], 0 to inf.

    Returns:
        `ConeHit`; an apex on a triangle, to the rounding of the corners and of the apex, reads 0, whichever way the
        cone looks: 8 epsilon of the largest coordinate given is on it.

    Raises:
        InvalidValue: wrong shape, a value that is not finite, a zero axis, an aperture or range out of bounds.

    Accuracy: 1e-11 of the farthest corner against a search without closed forms, on all families of hard cases
        (tests/sensing/distance/test_cone_search.py); hit or miss differs only within 1e-12 of grazing.
    Source: derived in `replay.sensing.distance.triangle` and `edge`.
    """
    corners = _finite("triangles", triangles, (None, 3, 3))
    origin = _finite("apex", apex, (3,))
    direction = unit_axis(axis)
    aperture, range = as_float("aperture", aperture), as_float("range", range)
    check_aperture(aperture)
    check_range("range", range)

    # A power of two brings every size near 1 without rounding, so that no product under- or overflows.
    with np.errstate(over="ignore"):
        relative = corners - origin
    largest = float(np.max(np.abs(relative), initial=0.0))
    if not math.isfinite(largest):
        raise InvalidValue("triangles", "coordinates", "must be small enough that differences to the apex are finite")
    exponent = math.frexp(largest)[1]
    relative = np.ldexp(relative, -exponent)
    rounding = POSE_ROUNDING * max(float(np.max(np.abs(corners), initial=0.0)), float(np.max(np.abs(origin))))
    cone = Cone(*direction, *half_angle(aperture), math.ldexp(rounding, -exponent))
    distance, point, triangle, case = closest_of_all(relative, (0.0, 0.0, 0.0), cone, _scaled_range(range, exponent))
    if triangle < 0:
        return ConeHit(False, math.nan, np.full(3, math.nan), -1, 0)
    return ConeHit(True, math.ldexp(distance, exponent), origin + np.ldexp(np.array(point), exponent), triangle, case)


def unit_axis(axis: ArrayLike) -> tuple[float, float, float]:
    """Return the direction of a vector of any length but zero; InvalidValue otherwise."""
    vector = _finite("axis", axis, (3,))
    largest = float(np.max(np.abs(vector)))
    if largest == 0.0:
        raise InvalidValue("axis", vector.tolist(), "must not be the zero vector")
    x, y, z = (float(component) for component in np.ldexp(vector, -math.frexp(largest)[1]))
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def check_aperture(aperture: float) -> None:
    """Raise InvalidValue unless the aperture [rad] is above 0 and at most 2 pi."""
    if not 0.0 < aperture <= 2.0 * math.pi:
        raise InvalidValue("aperture", aperture, "must be above 0 and at most 2 pi rad")


def check_range(name: str, value: float) -> None:
    """Raise InvalidValue unless a range [m] is 0 or more; inf is allowed."""
    if not value >= 0.0:
        raise InvalidValue(name, value, "must be 0 m or more")


def _scaled_range(range: float, exponent: int) -> float:
    try:
        return math.ldexp(range, -exponent)
    except OverflowError:
        return math.inf


def _finite(name: str, value: ArrayLike, shape: tuple[int | None, ...]) -> Floats:
    array = as_floats(name, value, shape)
    if not np.all(np.isfinite(array)):
        raise InvalidValue(name, "an array with NaN or infinity", "must be finite")
    return array
