"""Moments of triangles over their area: the integrals of x^a y^b z^c, a + b + c <= 6, about a point that can be moved.

They are kept as a cube (7, 7, 7) of which only a + b + c <= 6 counts. About a point that is moved by -s,

    int (x + s)^a = sum_i binom(a, i) s^(a - i) int x^i,

one axis after the other; so the moments of two bodies add up to those of both, at a price that knows no triangles.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.numerics.gauss import TRIANGLE_16
from replay.numerics.jit import leaf_kernel

Floats = NDArray[np.float64]

DEGREE = 6


@leaf_kernel
def add_triangle_moments(triangle: Floats, area: float, centre: Floats, cube: Floats) -> None:
    """Add the moments of a triangle (3, 3) [m] of known area about `centre` (3,); the rule of degree 8 is exact."""
    for point in range(16):
        a, b, c = TRIANGLE_16[0, point], TRIANGLE_16[1, point], TRIANGLE_16[2, point]
        x = a * triangle[0, 0] + b * triangle[1, 0] + c * triangle[2, 0] - centre[0]
        y = a * triangle[0, 1] + b * triangle[1, 1] + c * triangle[2, 1] - centre[1]
        z = a * triangle[0, 2] + b * triangle[1, 2] + c * triangle[2, 2] - centre[2]
        along_x = area * TRIANGLE_16[3, point]
        for i in range(DEGREE + 1):
            along_y = along_x
            for j in range(DEGREE + 1 - i):
                along_z = along_y
                for k in range(DEGREE + 1 - i - j):
                    cube[i, j, k] += along_z
                    along_z *= z
                along_y *= y
            along_x *= x


@leaf_kernel
def move_moments(cube: Floats, x: float, y: float, z: float) -> None:
    """Turn the moments about a point into those about the point that is at (-x, -y, -z) from it."""
    for step in range(1, DEGREE + 1):
        for i in range(DEGREE, step - 1, -1):
            for j in range(DEGREE + 1 - i):
                for k in range(DEGREE + 1 - i - j):
                    cube[i, j, k] += x * cube[i - 1, j, k]
        for j in range(DEGREE, step - 1, -1):
            for i in range(DEGREE + 1 - j):
                for k in range(DEGREE + 1 - i - j):
                    cube[i, j, k] += y * cube[i, j - 1, k]
        for k in range(DEGREE, step - 1, -1):
            for i in range(DEGREE + 1 - k):
                for j in range(DEGREE + 1 - i - k):
                    cube[i, j, k] += z * cube[i, j, k - 1]


@leaf_kernel
def add_moments(cube: Floats, other: Floats) -> None:
    """Add the moments of another body about the same point."""
    for i in range(DEGREE + 1):
        for j in range(DEGREE + 1 - i):
            for k in range(DEGREE + 1 - i - j):
                cube[i, j, k] += other[i, j, k]
