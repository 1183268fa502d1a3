"""Point rules on many triangles side by side."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.sensing.capacitive.cluster_bounds import sides_of
from replay.sensing.capacitive.clusters import CORNERS, SIZE
from replay.sensing.capacitive.lanes import LANES, padded

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

TRIANGLE_3 = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0], [2.0, 2.0, 2.0]]) / 6.0
"""Barycentric coordinates and weights of three points, polynomials of degree 2 exactly."""

_FROM, SUM = 16, 49
"""Columns of the lanes: the corners as the distance is taken from them, nine; the sums."""


@inlined_kernel
def corner_in_lanes(T: Floats, lanes: Floats, corner: int, i: int) -> Triple:
    """Return a corner of the triangle in lane i, in the plate's frame; the operations are those of `into_plate`."""
    x, y, z = (
        lanes[(CORNERS + 3 * corner) * LANES + i],
        lanes[(CORNERS + 3 * corner + 1) * LANES + i],
        lanes[(CORNERS + 3 * corner + 2) * LANES + i],
    )
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@leaf_kernel
def sum_by_points(
    points: Floats,
    count: int,
    T: Floats,
    half_x: float,
    half_y: float,
    region_column: int,
    shift_column: int,
    lanes: Floats,
) -> None:
    """Write the sums over triangles [m], of which rows of `Clusters.parts` are in the lanes, to the column SUM.

    A triangle's points are taken in the region that the lanes say, and its shift [m], in the lanes, is added.
    """
    for i in range(padded(count)):
        sx, sy = sides_of(lanes[region_column * LANES + i])
        keep_x, keep_y, shift_x, shift_y = abs(sx), abs(sy), sx * half_x, sy * half_y
        a, b, c = corner_in_lanes(T, lanes, 0, i), corner_in_lanes(T, lanes, 1, i), corner_in_lanes(T, lanes, 2, i)
        lanes[_FROM * LANES + i] = keep_x * a[0] - shift_x
        lanes[(_FROM + 1) * LANES + i] = keep_x * b[0] - shift_x
        lanes[(_FROM + 2) * LANES + i] = keep_x * c[0] - shift_x
        lanes[(_FROM + 3) * LANES + i] = keep_y * a[1] - shift_y
        lanes[(_FROM + 4) * LANES + i] = keep_y * b[1] - shift_y
        lanes[(_FROM + 5) * LANES + i] = keep_y * c[1] - shift_y
        lanes[(_FROM + 6) * LANES + i] = a[2]
        lanes[(_FROM + 7) * LANES + i] = b[2]
        lanes[(_FROM + 8) * LANES + i] = c[2]
        lanes[SUM * LANES + i] = 0.0
    for k in range(points.shape[1]):
        p, q, s, weight = points[0, k], points[1, k], points[2, k], points[3, k]
        for i in range(padded(count)):
            x = p * lanes[_FROM * LANES + i] + q * lanes[(_FROM + 1) * LANES + i] + s * lanes[(_FROM + 2) * LANES + i]
            y = p * lanes[(_FROM + 3) * LANES + i] + q * lanes[(_FROM + 4) * LANES + i]
            y += s * lanes[(_FROM + 5) * LANES + i]
            z = p * lanes[(_FROM + 6) * LANES + i] + q * lanes[(_FROM + 7) * LANES + i]
            z += s * lanes[(_FROM + 8) * LANES + i]
            lanes[SUM * LANES + i] += weight / math.sqrt(x * x + y * y + z * z)
    for i in range(padded(count)):
        lanes[SUM * LANES + i] = lanes[SIZE * LANES + i] * lanes[SUM * LANES + i] + lanes[shift_column * LANES + i]
