"""Point rules on many triangles side by side."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.sensing.capacitive.tree.clusters import CORNERS, SIZE
from replay.sensing.capacitive.tree.lanes import FROM, LANES, SUM, padded
from replay.sensing.capacitive.placed_plate import PlacedPlate, Triple, place_corner, sides_of

Floats = NDArray[np.float64]

TRIANGLE_3 = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0], [2.0, 2.0, 2.0]]) / 6.0
"""Barycentric coordinates and weights of three points, polynomials of degree 2 exactly."""


@inlined_kernel
def corner_in_lanes(T: Floats, rounding: float, lanes: Floats, corner: int, i: int) -> Triple:
    """Return a corner of the triangle in lane i, in the plate's frame."""
    at = CORNERS + 3 * corner
    return place_corner(T, rounding, lanes[at * LANES + i], lanes[(at + 1) * LANES + i], lanes[(at + 2) * LANES + i])


@leaf_kernel
def sum_by_points(
    points: Floats, count: int, plate: PlacedPlate, region_column: int, shift_column: int, lanes: Floats
) -> None:
    """Write the sums over triangles [m], of which rows of `Clusters.triangles` are in the lanes, to the column SUM.

    A triangle's points (4, k), barycentric coordinates and weights, are taken in the region that the lanes say, and its
    shift [m], in the lanes, is added.
    """
    T, half_x, half_y, rounding = plate.T_plate_body, plate.half_x, plate.half_y, plate.rounding
    for i in range(padded(count)):
        sx, sy = sides_of(lanes[region_column * LANES + i])
        keep_x, keep_y, shift_x, shift_y = abs(sx), abs(sy), sx * half_x, sy * half_y
        a = corner_in_lanes(T, rounding, lanes, 0, i)
        b = corner_in_lanes(T, rounding, lanes, 1, i)
        c = corner_in_lanes(T, rounding, lanes, 2, i)
        lanes[FROM * LANES + i] = keep_x * a[0] - shift_x
        lanes[(FROM + 1) * LANES + i] = keep_x * b[0] - shift_x
        lanes[(FROM + 2) * LANES + i] = keep_x * c[0] - shift_x
        lanes[(FROM + 3) * LANES + i] = keep_y * a[1] - shift_y
        lanes[(FROM + 4) * LANES + i] = keep_y * b[1] - shift_y
        lanes[(FROM + 5) * LANES + i] = keep_y * c[1] - shift_y
        lanes[(FROM + 6) * LANES + i] = a[2]
        lanes[(FROM + 7) * LANES + i] = b[2]
        lanes[(FROM + 8) * LANES + i] = c[2]
        lanes[SUM * LANES + i] = 0.0
    for k in range(points.shape[1]):
        p, q, s, weight = points[0, k], points[1, k], points[2, k], points[3, k]
        for i in range(padded(count)):
            x = p * lanes[FROM * LANES + i] + q * lanes[(FROM + 1) * LANES + i] + s * lanes[(FROM + 2) * LANES + i]
            y = p * lanes[(FROM + 3) * LANES + i] + q * lanes[(FROM + 4) * LANES + i]
            y += s * lanes[(FROM + 5) * LANES + i]
            z = p * lanes[(FROM + 6) * LANES + i] + q * lanes[(FROM + 7) * LANES + i]
            z += s * lanes[(FROM + 8) * LANES + i]
            lanes[SUM * LANES + i] += weight / math.sqrt(x * x + y * y + z * z)
    for i in range(padded(count)):
        lanes[SUM * LANES + i] = lanes[SIZE * LANES + i] * lanes[SUM * LANES + i] + lanes[shift_column * LANES + i]
