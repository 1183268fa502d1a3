"""The winding number of triangles about a point, from their solid angles (van Oosterom and Strackee 1983)."""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats
from replay.numerics.jit import kernel


@kernel
def winding_number(point: Floats, triangles: Floats) -> float:
    """Return how often the surface triangles (n, 3, 3) winds about the point: the sum of solid angles / 4 pi."""
    total = 0.0
    x, y, z = point[0], point[1], point[2]
    for t in range(len(triangles)):
        ax, ay, az = triangles[t, 0, 0] - x, triangles[t, 0, 1] - y, triangles[t, 0, 2] - z
        bx, by, bz = triangles[t, 1, 0] - x, triangles[t, 1, 1] - y, triangles[t, 1, 2] - z
        cx, cy, cz = triangles[t, 2, 0] - x, triangles[t, 2, 1] - y, triangles[t, 2, 2] - z
        a = math.sqrt(ax * ax + ay * ay + az * az)
        b = math.sqrt(bx * bx + by * by + bz * bz)
        c = math.sqrt(cx * cx + cy * cy + cz * cz)
        volume = ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
        ab, bc, ca = ax * bx + ay * by + az * bz, bx * cx + by * cy + bz * cz, cx * ax + cy * ay + cz * az
        total += 2.0 * math.atan2(volume, a * b * c + ab * c + bc * a + ca * b)
    return total / (4.0 * math.pi)
