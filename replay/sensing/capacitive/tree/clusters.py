"""What a far cluster of triangles looks like to a plate: area, centroid and moments up to the fourth, per tree node.

Computed once per body, in its own frame.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import float32, float64, int64

from replay.geometry.tree import Tree
from replay.numerics.arrays import Floats, Integers, Singles
from replay.numerics.jit import entry, kernel, leaf_kernel, record
from replay.numerics.kept import kept
from replay.sensing.capacitive.tree.moments import gather_moments
from replay.sensing.capacitive.tree.registers import (
    AREA,
    CENTROID,
    CORNER5,
    EDGE5,
    FARTHEST_PLANE,
    HALF,
    MEAN2,
    MEAN6,
    MIDDLE,
    MOMENT_COLUMNS,
    NEAREST_PLANE,
    NORMAL,
    NUMBER,
    OPENING,
    OUTLINE_COLUMNS,
    PLACE,
    RADIUS,
    REACH,
    SECOND,
    SIGMA,
    SIZE,
    SPREAD,
    THIRD,
    TRIANGLE_COLUMNS,
    WHOLE,
)
from replay.sensing.capacitive.triangle_sum import triangle_areas

_LINE = 64
"""[bytes] what a processor reads of its memory at a time; rows begin on such a line."""


class Clusters(NamedTuple):
    """m tree nodes over n triangles, in the body's frame; `registers` names the columns.

    One row per node keeps what a visit reads together. A node's outline is what its bounds need, in half the digits:
    the area is rounded down and all other sizes are rounded up; places are as near as can be, within `blur`. Triangles
    are listed in the order of the tree, so that a node's triangles are neighbours.
    """

    triangles: Floats  # (n, 16)
    nodes: Floats  # (m, 16)
    outlines: Singles  # (m, 16)
    blur: float  # [m]
    moments: Floats  # (m, 40) [m^2, m^3, m^4], means over the area about the centroid
    links: Integers  # (m, 4) of the tree


CLUSTERS_TYPE = record(
    Clusters, float64[:, ::1], float64[:, ::1], float32[:, ::1], float64, float64[:, ::1], int64[:, ::1]
)


@kept
def make_clusters(triangles: Floats, tree: Tree) -> Clusters:
    """Return the clusters of triangles (n, 3, 3) [m] under their tree; their size must be from 1e-30 to 1e30 m.

    It should be of the order of 1: far from it, half the digits do not hold the bounds, and no cluster is kept.
    """
    ordered = np.ascontiguousarray(triangles[tree.order], dtype=np.float64)
    areas = triangle_areas(ordered)
    centroids = ordered.mean(axis=1)
    squares = np.sum((ordered - centroids[:, None]) ** 2, axis=2)
    rows = _rows(len(ordered), TRIANGLE_COLUMNS, np.float64)
    rows[:, :REACH] = ordered.reshape(-1, 9)
    rows[:, REACH], rows[:, SPREAD] = np.sqrt(squares.max(axis=1)), squares.sum(axis=1) / 12.0
    rows[:, SIZE] = areas
    count = len(tree.begin)
    nodes, moments = np.zeros((count, 16)), _rows(count, MOMENT_COLUMNS, np.float64)
    gather_moments(ordered, areas, centroids, tree.second, tree.begin, tree.end, nodes, moments)
    _enclose(ordered, areas, tree.begin, tree.end, nodes)
    moments[:, WHOLE], moments[:, PLACE : PLACE + 3] = nodes[:, AREA], nodes[:, CENTROID:RADIUS]
    moments[:, NUMBER] = tree.end - tree.begin
    after = np.where(tree.second < 0, -1, tree.second[tree.second])
    links = np.ascontiguousarray(np.stack([tree.second, tree.begin, tree.end, after], axis=1))
    with np.errstate(over="ignore", under="ignore"):
        outlines = _outlines(tree, nodes, moments)
    # a place is off by half a bit in 24, a box relative to it as well and twice as large, in three directions
    blur = 2.0**-21 * float(np.max(np.abs(ordered), initial=0.0))
    return Clusters(rows, nodes, outlines, blur, moments, links)


def _rows(count: int, columns: int, kind: type) -> Any:
    """Return zeros (count, columns) whose rows begin on a line of memory."""
    size = np.dtype(kind).itemsize
    spare: Any = np.zeros(count * columns + _LINE // size, kind)
    first = -(spare.ctypes.data // size) % (_LINE // size)
    return spare[first : first + count * columns].reshape(count, columns)


def _outlines(tree: Tree, nodes: Floats, moments: Floats) -> Singles:
    area = nodes[:, AREA]
    sizes = np.zeros((len(nodes), OUTLINE_COLUMNS))
    sizes[:, RADIUS], sizes[:, MEAN2] = nodes[:, RADIUS], nodes[:, MEAN2]
    for column in (CORNER5, EDGE5, MEAN6):
        sizes[:, column] = area * nodes[:, column]
    sizes[:, HALF:SIGMA] = 0.5 * tree.upper - 0.5 * tree.lower
    sizes[:, SIGMA] = np.sqrt(_largest_variance(moments[:, SECOND:THIRD]))
    result: Singles = _rows(len(nodes), OUTLINE_COLUMNS, np.float32)
    result[:] = sizes
    result[:] = np.where(result < sizes, np.nextafter(result, np.float32(np.inf)), result)
    result[:, CENTROID:RADIUS] = nodes[:, CENTROID:RADIUS]
    result[:, MIDDLE:HALF] = 0.5 * tree.lower + 0.5 * tree.upper - nodes[:, CENTROID:RADIUS]
    result[:, AREA] = area
    result[:, AREA] = np.where(result[:, AREA] > area, np.nextafter(result[:, AREA], np.float32(0.0)), result[:, AREA])
    return result


def _largest_variance(second: Floats) -> Floats:
    """Return upper bounds of the largest eigenvalues of matrices given as xx, yy, zz, xy, xz, yz, 2 % above at most.

    The Frobenius norm of the 32nd power is at most 3^(1/2) times the 32nd power of the largest eigenvalue.
    """
    trace = second[:, 0] + second[:, 1] + second[:, 2]
    matrix = second[:, [0, 3, 4, 3, 1, 5, 4, 5, 2]].reshape(-1, 3, 3) / np.where(trace > 0.0, trace, 1.0)[:, None, None]
    for _ in range(5):
        matrix = np.einsum("nij,njk->nik", matrix, matrix)
    result: Floats = trace * np.sqrt(np.sum(matrix**2, axis=(1, 2))) ** (1.0 / 32.0) * (1.0 + 1e-12)
    return result


@entry(float64[:, :, ::1], float64[::1], int64[::1], int64[::1], float64[:, ::1])
@kernel
def _enclose(triangles: Floats, areas: Floats, begin: Integers, end: Integers, nodes: Floats) -> None:
    """Write radii, cones of normals and the planes' offsets of all nodes."""
    unit = np.zeros((len(triangles), 3))
    for k in range(len(triangles)):
        _unit_normal(triangles[k], unit[k])
    for index in range(len(begin)):
        node = nodes[index]
        for k in range(begin[index], end[index]):
            for axis in range(3):
                node[NORMAL + axis] += areas[k] * unit[k, axis]
        length = math.sqrt(node[NORMAL] ** 2 + node[NORMAL + 1] ** 2 + node[NORMAL + 2] ** 2)
        node[OPENING] = 1.0 if length > 1e-9 * node[AREA] else -1.0
        for axis in range(3):
            node[NORMAL + axis] = node[NORMAL + axis] / length if node[OPENING] > 0.0 else 0.0
        largest, nearest, farthest = 0.0, np.inf, -np.inf
        for k in range(begin[index], end[index]):
            cosine, offset = 0.0, 0.0
            for axis in range(3):
                cosine += unit[k, axis] * node[NORMAL + axis]
                offset += unit[k, axis] * (triangles[k, 0, axis] - node[axis])
            if areas[k] > 0.0:
                node[OPENING] = min(node[OPENING], cosine)
                nearest, farthest = min(nearest, offset), max(farthest, offset)
            for corner in range(3):
                x, y, z = (
                    triangles[k, corner, 0] - node[0],
                    triangles[k, corner, 1] - node[1],
                    triangles[k, corner, 2] - node[2],
                )
                largest = max(largest, x * x + y * y + z * z)
        node[RADIUS], node[NEAREST_PLANE], node[FARTHEST_PLANE] = math.sqrt(largest), nearest, farthest


@leaf_kernel
def _unit_normal(triangle: Floats, result: Floats) -> None:
    a, b, c = triangle[0], triangle[1], triangle[2]
    bx, by, bz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    cx, cy, cz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    length = math.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        result[0], result[1], result[2] = x / length, y / length, z / length
