"""The thesis's integral: 4^n equal sub-triangles, region and distance taken at each one's centroid."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel
from replay.sensing.capacitive.contact import SATURATED, contact
from replay.sensing.capacitive.placed_plate import beyond_borders

Floats = NDArray[np.float64]


@kernel
def inverse_distance(x: float, y: float, z: float, half_x: float, half_y: float) -> float:
    """Return 1/dist [1/m] of a point to the plate; inf on the plate."""
    u, v = beyond_borders(x, y, half_x, half_y)
    return 1.0 / math.sqrt(u * u + v * v + z * z)


@kernel
def midpoint_over_triangle(
    triangle: Floats, area: float, half_x: float, half_y: float, both: bool, splits: int
) -> float:
    """Return the midpoint sum [m] for a triangle (3, 3) [m]; inf if saturated, as for every method.

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
