"""What a far cluster of triangles looks like to a plate: area, centroid and moments up to the fourth, per tree node.

Computed once per body, in its own frame, from the leaves to the root.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numba import float32, float64, int64
from numpy.typing import NDArray

from replay.geometry.tree import MAX_DEPTH, Tree
from replay.numerics.jit import entry, kernel, leaf_kernel, record
from replay.sensing.capacitive.tree.moments import DEGREE, add_moments, add_triangle_moments, move_moments
from replay.sensing.capacitive.triangle_sum import triangle_areas

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Singles = NDArray[np.float32]

CENTROID, RADIUS, AREA, ODD5, MEAN5, MEAN6, MEAN2 = 0, 3, 4, 5, 6, 7, 8
NORMAL, OPENING, NEAREST_PLANE, FARTHEST_PLANE = 9, 12, 13, 14
"""Columns of `Clusters.nodes`; CENTROID and NORMAL are the first of three. Those up to MEAN2 are in `outlines`, too."""

MIDDLE, HALF, SIGMA = 9, 12, 15
"""More columns of `Clusters.outlines`; MIDDLE and HALF are the first of three."""

SECOND_CHILD, BEGIN, END = range(3)
"""Columns of `Clusters.links`."""

CORNERS, REACH, SPREAD, SIZE = 0, 9, 10, 11
"""Columns of `Clusters.triangles`; CORNERS is the first of nine."""

SECOND, THIRD, FOURTH, WHOLE, PLACE, NUMBER = 0, 6, 16, 31, 32, 35
"""First columns of `Clusters.moments`, in the order of _KEPT: 6 of degree 2, 10 of degree 3, 15 of degree 4; the area,
the centroid and the number of triangles."""

OUTLINE_COLUMNS, TRIANGLE_COLUMNS, MOMENT_COLUMNS = 16, 16, 40

_LINE = 64
"""[bytes] what a processor reads of its memory at a time; rows begin on such a line."""

_TERMS = (
    "xx yy zz xy xz yz "
    "xxx yyy zzz xxy xxz yyx yyz zzx zzy xyz "
    "xxxx yyyy zzzz xxyy xxzz yyzz xxxy xxxz yyyx yyyz zzzx zzzy xxyz yyxz zzxy"
)
_KEPT = np.array([[term.count(axis) for axis in "xyz"] for term in _TERMS.split(" ")])
"""(31, 3) powers of x, y and z of the columns of `Clusters.moments`."""


class Clusters(NamedTuple):
    """m tree nodes over n triangles, in the body's frame; one row per node keeps what a visit reads together.

    A node's row holds its centroid [m]; its radius [m], the largest distance of a corner from the centroid; its area
    [m^2]; with d from the centroid, the Frobenius norm of the mean of d d d d d and the means over the area of |d|^5
    (an upper bound), |d|^6 and |d|^2; the axis of a cone around its outward normals and the cosine of that cone's half
    angle (-1: anything may point anywhere); the least and the largest offset of its triangles' planes from the
    centroid, along their own normals [m].
    Its outline is what its bounds need, in half the digits: as above, but with ODD5, MEAN5 and MEAN6 times the area;
    the middle of its box, relative to the centroid, half the box's edges, and the largest standard deviation of its
    points in any direction [m]. The area is rounded down and all other sizes are rounded up; places are as near as can
    be, within `blur`.
    A triangle's row holds its corners [m], the largest distance of a corner from the centroid [m], the mean of |d|^2
    [m^2] and the area [m^2]. Triangles are listed in the order of the tree, so that a node's triangles are neighbours.
    """

    triangles: Floats  # (n, 16)
    nodes: Floats  # (m, 16)
    outlines: Singles  # (m, 16)
    blur: float  # [m]
    moments: Floats  # (m, 40) [m^2, m^3, m^4], means over the area about the centroid
    links: Ints  # (m, 4) of the tree: second child, or -1, first triangle and one beyond the last


CLUSTERS_TYPE = record(
    Clusters, float64[:, ::1], float64[:, ::1], float32[:, ::1], float64, float64[:, ::1], int64[:, ::1]
)


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
    _gather(ordered, areas, centroids, tree.second, tree.begin, tree.end, nodes, moments)
    _enclose(ordered, areas, tree.begin, tree.end, nodes)
    moments[:, WHOLE], moments[:, PLACE : PLACE + 3] = nodes[:, AREA], nodes[:, CENTROID:RADIUS]
    moments[:, NUMBER] = tree.end - tree.begin
    links = np.ascontiguousarray(np.stack([tree.second, tree.begin, tree.end, tree.end], axis=1))
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
    for column in (ODD5, MEAN5, MEAN6):
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
def _gather(
    triangles: Floats,
    areas: Floats,
    centroids: Floats,
    second: Ints,
    begin: Ints,
    end: Ints,
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
    for k in range(len(_KEPT)):
        moments[k] = cube[_KEPT[k, 0], _KEPT[k, 1], _KEPT[k, 2]] / area
    mean2, mean4, mean6, square5 = 0.0, 0.0, 0.0, 0.0
    for i in range(4):
        for j in range(4 - i):
            k = 3 - i - j
            # |d|^6 = (x^2 + y^2 + z^2)^3
            mean6 += _multinomial(i, j, k) * cube[2 * i, 2 * j, 2 * k] / area
    for i in range(3):
        for j in range(3 - i):
            k = 2 - i - j
            mean4 += _multinomial(i, j, k) * cube[2 * i, 2 * j, 2 * k] / area
    for i in range(6):
        for j in range(6 - i):
            k = 5 - i - j
            square5 += _multinomial(i, j, k) * (cube[i, j, k] / area) ** 2
    mean2 = (cube[2, 0, 0] + cube[0, 2, 0] + cube[0, 0, 2]) / area
    node[MEAN2], node[MEAN6] = mean2, mean6
    node[MEAN5] = math.sqrt(mean4) * math.sqrt(mean6)  # |d|^5 = |d|^2 |d|^3, by Cauchy and Schwarz
    node[ODD5] = math.sqrt(square5)


@leaf_kernel
def _multinomial(i: int, j: int, k: int) -> float:
    result = 1.0
    for n in range(1, j + 1):
        result *= (i + n) / n
    for n in range(1, k + 1):
        result *= (i + j + n) / n
    return result


@entry(float64[:, :, ::1], float64[::1], int64[::1], int64[::1], float64[:, ::1])
@kernel
def _enclose(triangles: Floats, areas: Floats, begin: Ints, end: Ints, nodes: Floats) -> None:
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
