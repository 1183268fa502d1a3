"""Moments of triangles over their area: the integrals of x^a y^b z^c, a + b + c <= 6, about a point that can be moved.

They are kept as a cube (7, 7, 7) of which only a + b + c <= 6 counts. About a point that is moved by -s,

    int (x + s)^a = sum_i binom(a, i) s^(a - i) int x^i,

one axis after the other; so the moments of two bodies add up to those of both, at a price that knows no triangles.
All nodes of a tree are gathered so, from the leaves to the root.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.geometry.tree import MAX_DEPTH
from replay.numerics.arrays import Floats, Integers
from replay.numerics.gauss import TRIANGLE_16
from replay.numerics.jit import entry, inlined_kernel, kernel, leaf_kernel
from replay.sensing.capacitive.tree.registers import AREA, CORNER5, EDGE5, KEPT, MEAN2, MEAN6

DEGREE = 6

_FIFTH_CORNER, _FIFTH_EDGE = 7.875, 4.203125
"""Squares of the Frobenius norms of the form |Pd|^5 P_5(cos), where P drops none or one of three components."""

_ROUNDING = 1e-14
"""Of a square of norms."""


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


@entry(
    float64[:, :, ::1],
    float64[::1],
    float64[:, ::1],
    int64[::1],
    int64[::1],
    int64[::1],
    float64[:, ::1],
    float64[:, ::1],
)
@kernel
def gather_moments(
    triangles: Floats,
    areas: Floats,
    centroids: Floats,
    second: Integers,
    begin: Integers,
    end: Integers,
    nodes: Floats,
    moments: Floats,
) -> None:
    """Write areas, centroids and moments of all nodes; backwards, so that a node's children come before it."""
    cubes = np.empty((MAX_DEPTH + 1, DEGREE + 1, DEGREE + 1, DEGREE + 1))
    waiting = 0
    for index in range(len(begin) - 1, -1, -1):
        node = nodes[index]
        if second[index] < 0:
            cube = cubes[waiting]
            cube[:] = 0.0
            for k in range(begin[index], end[index]):
                node[AREA] += areas[k]
            for k in range(begin[index], end[index]):
                # a body without area still has a place
                weight = areas[k] / node[AREA] if node[AREA] > 0.0 else 1.0 / (end[index] - begin[index])
                for axis in range(3):
                    node[axis] += weight * centroids[k, axis]
            for k in range(begin[index], end[index]):
                if areas[k] > 0.0:
                    add_triangle_moments(triangles[k], areas[k], node, cube)
            waiting += 1
        else:
            # the first child came last
            first, last = nodes[index + 1], nodes[second[index]]
            node[AREA] = first[AREA] + last[AREA]
            share = last[AREA] / node[AREA] if node[AREA] > 0.0 else 0.5
            for axis in range(3):
                node[axis] = first[axis] + share * (last[axis] - first[axis])
            cube, other = cubes[waiting - 2], cubes[waiting - 1]
            move_moments(cube, last[0] - node[0], last[1] - node[1], last[2] - node[2])
            move_moments(other, first[0] - node[0], first[1] - node[1], first[2] - node[2])
            add_moments(cube, other)
            waiting -= 1
        if node[AREA] > 0.0:
            _summarise(cube, node, moments[index])


@leaf_kernel
def _summarise(cube: Floats, node: Floats, moments: Floats) -> None:
    """Write what of a node's moments is kept, as means over its area."""
    area = node[AREA]
    for k in range(len(KEPT)):
        moments[k] = cube[KEPT[k, 0], KEPT[k, 1], KEPT[k, 2]] / area
    mean2 = (cube[2, 0, 0] + cube[0, 2, 0] + cube[0, 0, 2]) / area
    mean4, mean6 = 0.0, 0.0
    for i in range(4):
        for j in range(4 - i):
            k = 3 - i - j
            # |d|^6 = (x^2 + y^2 + z^2)^3
            mean6 += _multinomial(i, j, k) * cube[2 * i, 2 * j, 2 * k] / area
    for i in range(3):
        for j in range(3 - i):
            k = 2 - i - j
            mean4 += _multinomial(i, j, k) * cube[2 * i, 2 * j, 2 * k] / area
    mean5 = math.sqrt(mean4) * math.sqrt(mean6)  # |d|^5 = |d|^2 |d|^3, by Cauchy and Schwarz
    # squares of the norms of the mean of d d d d d and of its traces, of degree 3 and 1
    square5, square3, square1 = 0.0, 0.0, 0.0
    for i in range(6):
        for j in range(6 - i):
            square5 += _multinomial(i, j, 5 - i - j) * (cube[i, j, 5 - i - j] / area) ** 2
    for i in range(4):
        for j in range(4 - i):
            square3 += _multinomial(i, j, 3 - i - j) * (_trace(cube, i, j, 3 - i - j) / area) ** 2
    for axis in range(3):
        i, j, k = 1 if axis == 0 else 0, 1 if axis == 1 else 0, 1 if axis == 2 else 0
        square1 += ((_trace(cube, i + 2, j, k) + _trace(cube, i, j + 2, k) + _trace(cube, i, j, k + 2)) / area) ** 2
    traceless = max(square5 - 10.0 / 9.0 * square3 + 5.0 / 21.0 * square1, 0.0) + _ROUNDING * square5
    node[MEAN2], node[MEAN6] = mean2, mean6
    node[CORNER5] = min(math.sqrt(_FIFTH_CORNER * traceless), mean5)
    node[EDGE5] = min(math.sqrt(_FIFTH_EDGE * square5), mean5)


@inlined_kernel
def _trace(cube: Floats, i: int, j: int, k: int) -> float:
    """Return the integral of x^i y^j z^k |d|^2."""
    return cube[i + 2, j, k] + cube[i, j + 2, k] + cube[i, j, k + 2]  # type: ignore[no-any-return]


@leaf_kernel
def _multinomial(i: int, j: int, k: int) -> float:
    result = 1.0
    for n in range(1, j + 1):
        result *= (i + n) / n
    for n in range(1, k + 1):
        result *= (i + j + n) / n
    return result
