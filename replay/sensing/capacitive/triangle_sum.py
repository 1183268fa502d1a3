"""The sum over all triangles of a body, one by one: `exact` and `midpoint` for every pose and plate."""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, int64

from replay.numerics.arrays import Flags, Floats
from replay.numerics.double_double import two_sum
from replay.numerics.exact_sign import area_or_zero
from replay.numerics.jit import entry, kernel
from replay.sensing.capacitive.contact import CLEAR, contact
from replay.sensing.capacitive.exact import SCRATCH, integral_over_triangle
from replay.sensing.capacitive.integral import midpoint_over_triangle
from replay.sensing.capacitive.placed_plate import faces_centre, place_triangle, placed_plate, write_triangle

EXACT = -1
"""As `splits`: the closed forms instead of the midpoint rule."""


@entry(float64[:, :, ::1])
@kernel
def triangle_areas(triangles: Floats) -> Floats:
    """Return the areas (n,) [m^2] of triangles (n, 3, 3) [m]."""
    result = np.empty(len(triangles))
    for k in range(len(triangles)):
        result[k] = area_or_zero(triangles[k])
    return result


@entry(float64[:, :, ::1], float64[::1], float64[:, :, :, ::1], float64[::1], float64[:, ::1], boolean, boolean, int64)
@kernel
def sum_triangles(
    triangles: Floats,
    areas: Floats,
    T_plate_body: Floats,
    rounding: Floats,
    half_sizes: Floats,
    both: bool,
    facing: bool,
    splits: int,
) -> tuple[Floats, Flags]:
    """Return the integral over a body and whether the body touches the plate, for every pose and plate.

    Args:
        triangles: (k, 3, 3) [m], in the body's frame; areas: (k,) [m^2].
        T_plate_body: (n, p, 4, 4); rounding: (n,) a corner no farther than this from a plate's plane is on it [m].
        half_sizes: (p, 2) [m].
        both, facing: what counts, see `CapacitiveSensor`.
        splits: of the midpoint rule, or EXACT.

    Returns:
        (n, p) [m], inf when saturated, and (n, p) flags. The sum is compensated and in the order of the triangles.
    """
    n, plates = len(T_plate_body), len(half_sizes)
    integral, touching = np.zeros((n, plates)), np.zeros((n, plates), np.bool_)
    scratch, corners = np.empty(SCRATCH), np.empty((3, 3))
    rows = triangles.reshape(len(triangles), 9)
    for frame in range(n):
        for plate in range(plates):
            half_x, half_y = half_sizes[plate, 0], half_sizes[plate, 1]
            here = placed_plate(T_plate_body[frame, plate], half_x, half_y, both, facing, rounding[frame], 0.0)
            total, lost = 0.0, 0.0
            for k in range(len(triangles)):
                a, b, c = place_triangle(here, rows, k)
                write_triangle(a, b, c, corners)
                if contact(corners, half_x, half_y, both) != CLEAR:
                    touching[frame, plate] = True
                if facing and not faces_centre(a, b, c, rounding[frame]):
                    continue
                if splits == EXACT:
                    value = integral_over_triangle(corners, areas[k], half_x, half_y, both, scratch)
                else:
                    value = midpoint_over_triangle(corners, areas[k], half_x, half_y, both, splits)
                if value == np.inf:
                    total, lost = np.inf, 0.0
                elif total < np.inf:
                    total, error = two_sum(total, value)
                    lost += error
            integral[frame, plate] = total + lost
    return integral, touching
