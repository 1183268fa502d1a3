"""Oriented boxes around pieces of a surface, along its principal axes, in single precision.

A patch of a smooth surface is flat to the second order of its size, an upright box only to the first: with a patch d
away and s across, about d / s upright boxes are nearer than the closest point, and a few oriented ones. Where the
upright box is not larger, it is taken.

Centres are seen from the middle of the body, so what is lost to single precision is 6e-8 of the body's size. Half
widths are measured from the centre, and against the axes, as they are after rounding. Those axes are orthonormal to
2e-7 only, so that the length of a vector and that of its projections differ by up to this part (`SHORT`); half widths
are padded by `_PAD` of their sum to cover it: |y| <= |half widths| and g · y <= sum h_i |g · e_i|, |g| = 1, hold for
what the box holds.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.geometry.principal_axes import diagonalised
from replay.geometry.tree import TREE_TYPE, Tree
from replay.numerics.arrays import Floats, Integers, Singles
from replay.numerics.jit import entry, kernel

CENTRE, AXES, HALVES, BOX = 0, 3, 12, 15
"""Where the numbers of a box begin, and how many they are: centre, three axes, three half widths."""

SHORT = 1e-6
"""Part by which the squared length of a vector and of its projections on a box's axes may differ, at most."""

_PAD = 1e-6
_TINY = float(np.finfo(np.float32).tiny)  # below it, single precision rounds by more than `_PAD`


@kernel
def _add_moments(to: Floats, more: Floats) -> None:
    """Add a piece of surface to another; (10,) area, mean and central second moments xx xy xz yy yz zz."""
    total = to[0] + more[0]
    if not total > 0.0:
        return
    part = more[0] / total
    x, y, z = more[1] - to[1], more[2] - to[2], more[3] - to[3]
    weight = to[0] * part
    to[0] = total
    to[1] += part * x
    to[2] += part * y
    to[3] += part * z
    to[4] += more[4] + weight * x * x
    to[5] += more[5] + weight * x * y
    to[6] += more[6] + weight * x * z
    to[7] += more[7] + weight * y * y
    to[8] += more[8] + weight * y * z
    to[9] += more[9] + weight * z * z


@kernel
def _moments(tree: Tree, triangles: Floats) -> Floats:
    """Return the moments (m, 10) of the surface under each node of the binary tree, see `_add_moments`.

    A triangle with centroid m has the second moments area / 12 * sum of (p - m)(p - m)^T over its corners p.
    """
    moments, one = np.zeros((len(tree.second), 10)), np.empty(10)
    for node in range(len(tree.second) - 1, -1, -1):
        second = tree.second[node]
        if second >= 0:
            moments[node] = moments[node + 1]
            _add_moments(moments[node], moments[second])
            continue
        for k in range(tree.begin[node], tree.end[node]):
            t = triangles[k]
            ux, uy, uz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
            wx, wy, wz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
            nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
            one[0] = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
            for i in range(3):
                one[1 + i] = (t[0, i] + t[1, i] + t[2, i]) / 3.0
            for i in range(4, 10):
                one[i] = 0.0
            for corner in range(3):
                x, y, z = t[corner, 0] - one[1], t[corner, 1] - one[2], t[corner, 2] - one[3]
                weight = one[0] / 12.0
                one[4] += weight * x * x
                one[5] += weight * x * y
                one[6] += weight * x * z
                one[7] += weight * y * y
                one[8] += weight * y * z
                one[9] += weight * z * z
            _add_moments(moments[node], one)
    return moments


@kernel
def _axes(moments: Floats, matrix: Floats, axes: Floats) -> None:
    """Write the principal axes, rounded to single precision."""
    matrix[0, 0], matrix[0, 1], matrix[0, 2] = moments[4], moments[5], moments[6]
    matrix[1, 0], matrix[1, 1], matrix[1, 2] = moments[5], moments[7], moments[8]
    matrix[2, 0], matrix[2, 1], matrix[2, 2] = moments[6], moments[8], moments[9]
    vectors = diagonalised(matrix)[1]
    for i in range(3):
        for j in range(3):
            axes[i, j] = np.float32(vectors[i, j])


@kernel
def _half_area(x: float, y: float, z: float) -> float:
    return x * y + y * z + z * x


@kernel
def _measure(triangles: Floats, origin: Floats, axes: Floats, low: Floats, high: Floats) -> None:
    """Write the least and largest projections of the corners, seen from the origin, on each axis."""
    for i in range(3):
        ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
        least, most = np.inf, -np.inf
        for k in range(len(triangles)):
            t = triangles[k]
            for corner in range(3):
                along = (
                    ax * (t[corner, 0] - origin[0]) + ay * (t[corner, 1] - origin[1]) + az * (t[corner, 2] - origin[2])
                )
                least, most = min(least, along), max(most, along)
        low[i], high[i] = least, most


@entry(TREE_TYPE, float64[:, :, ::1], int64[::1], float64[::1])
@kernel
def fit_boxes(tree: Tree, triangles: Floats, nodes: Integers, middle: Floats) -> Singles:
    """Return the boxes (k, BOX) [m] of k nodes of a binary tree, their centres seen from `middle`.

    Args:
        tree: over the triangles.
        triangles: (n, 3, 3) in the order of the tree [m].
        nodes: (k,).
        middle: (3,) [m].
    """
    boxes = np.empty((len(nodes), BOX), np.float32)
    moments = _moments(tree, triangles)
    centre, matrix, axes = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    low, high, half, moved = np.empty(3), np.empty(3), np.empty(3), np.empty(3)
    for place in range(len(nodes)):
        k, box = nodes[place], boxes[place]
        for i in range(3):
            centre[i] = 0.5 * tree.lower[k, i] + 0.5 * tree.upper[k, i]
            half[i] = 0.5 * tree.upper[k, i] - 0.5 * tree.lower[k, i]
        _axes(moments[k], matrix, axes)
        _measure(triangles[tree.begin[k] : tree.end[k]], centre, axes, low, high)
        oriented = 0.25 * _half_area(high[0] - low[0], high[1] - low[1], high[2] - low[2])
        if not oriented < _half_area(half[0], half[1], half[2]):
            for i in range(3):
                low[i], high[i] = -half[i], half[i]
                for j in range(3):
                    axes[i, j] = 1.0 if i == j else 0.0
        for i in range(3):
            upright = centre[i] - middle[i]
            box[CENTRE + i] = upright + 0.5 * (
                (low[0] + high[0]) * axes[0, i] + (low[1] + high[1]) * axes[1, i] + (low[2] + high[2]) * axes[2, i]
            )
            moved[i] = np.float64(box[CENTRE + i]) - upright
        padding = _TINY
        for i in range(3):
            along = axes[i, 0] * moved[0] + axes[i, 1] * moved[1] + axes[i, 2] * moved[2]
            half[i] = max(high[i] - along, along - low[i])
            padding += _PAD * half[i]
            for j in range(3):
                box[AXES + 3 * i + j] = axes[i, j]
        for i in range(3):
            box[HALVES + i] = half[i] + padding
    return boxes
