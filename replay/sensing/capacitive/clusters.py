"""What a far cluster of triangles looks like to a plate: area, centroid and moments up to the fourth, per tree node.

Computed once per body, in its own frame. A rule of degree 5 makes the moments of each triangle exact.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import Tree
from replay.numerics.gauss import TRIANGLE_7
from replay.numerics.jit import kernel
from replay.sensing.capacitive.triangle_sum import triangle_areas

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

CENTROID, RADIUS, AREA, SPREAD4, LOWER, UPPER, NORMAL, OPENING = 0, 3, 4, 5, 6, 9, 12, 15
"""Columns of `Clusters.nodes`; CENTROID, LOWER, UPPER and NORMAL are the first of three."""

SECOND, THIRD, FOURTH = 0, 6, 24
"""First columns of `Clusters.moments`: 6 for mean d_i d_j; 3 x 6 for mean d_k d_i d_j; 21 for mean d_i d_j d_k d_l, the
upper triangle, row by row, of a 6 x 6 matrix. The six pairs ij are in the order of PAIRS."""

PAIRS = np.array([[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]])


class Clusters(NamedTuple):
    """m tree nodes over n triangles, in the body's frame; one row per node keeps what a visit reads together.

    A node's row holds its centroid [m]; its radius [m], the largest distance of a corner from the centroid; its area
    [m^2]; the mean of |d|^4 over its area [m^4], d from the centroid; its box, relative to the centroid [m]; the axis
    of a cone around its outward normals and the cosine of that cone's half angle (-1: anything may point anywhere).
    Triangles are listed in the order of the tree, so that a node's triangles are neighbours.
    """

    triangles: Floats  # (n, 3, 3) [m]
    areas: Floats  # (n,) [m^2]
    nodes: Floats  # (m, 16)
    moments: Floats  # (m, 45) [m^2, m^3, m^4], means over the area about the centroid


def make_clusters(triangles: Floats, tree: Tree) -> Clusters:
    """Return the clusters of triangles (n, 3, 3) [m] under their tree."""
    ordered = np.ascontiguousarray(triangles[tree.order], dtype=np.float64)
    areas = triangle_areas(ordered)
    nodes, moments = np.zeros((len(tree.begin), 16)), np.zeros((len(tree.begin), 45))
    _measure(ordered, areas, tree.begin, tree.end, nodes, moments)
    nodes[:, LOWER:UPPER] = tree.lower - nodes[:, CENTROID:RADIUS]
    nodes[:, UPPER:NORMAL] = tree.upper - nodes[:, CENTROID:RADIUS]
    return Clusters(ordered, areas, nodes, moments)


@kernel
def _measure(triangles: Floats, areas: Floats, begin: Ints, end: Ints, nodes: Floats, moments: Floats) -> None:
    unit = np.zeros((len(triangles), 3))
    for k in range(len(triangles)):
        _unit_normal(triangles[k], unit[k])
    for index in range(len(begin)):
        node = nodes[index]
        first, last = begin[index], end[index]
        for k in range(first, last):
            node[AREA] += areas[k]
            for axis in range(3):
                node[NORMAL + axis] += areas[k] * unit[k, axis]
        area = node[AREA]
        for k in range(first, last):
            # a body without area still has a place
            weight = areas[k] / area if area > 0.0 else 1.0 / (last - first)
            for axis in range(3):
                corners = triangles[k, 0, axis] + triangles[k, 1, axis] + triangles[k, 2, axis]
                node[CENTROID + axis] += weight * corners / 3.0
        length = math.sqrt(node[NORMAL] ** 2 + node[NORMAL + 1] ** 2 + node[NORMAL + 2] ** 2)
        node[OPENING] = 1.0 if length > 1e-9 * area else -1.0
        for axis in range(3):
            node[NORMAL + axis] = node[NORMAL + axis] / length if node[OPENING] > 0.0 else 0.0
        for k in range(first, last):
            if areas[k] > 0.0:
                _add_triangle(triangles[k], areas[k] / area, node, moments[index])
                cosine = 0.0
                for axis in range(3):
                    cosine += unit[k, axis] * node[NORMAL + axis]
                node[OPENING] = min(node[OPENING], cosine)
            for corner in range(3):
                square = 0.0
                for axis in range(3):
                    square += (triangles[k, corner, axis] - node[CENTROID + axis]) ** 2
                node[RADIUS] = max(node[RADIUS], math.sqrt(square))


@kernel
def _unit_normal(triangle: Floats, result: Floats) -> None:
    a, b, c = triangle[0], triangle[1], triangle[2]
    bx, by, bz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    cx, cy, cz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    length = math.sqrt(x * x + y * y + z * z)
    if length > 0.0:
        result[0], result[1], result[2] = x / length, y / length, z / length


@kernel
def _add_triangle(triangle: Floats, weight: float, node: Floats, moments: Floats) -> None:
    for point in range(7):
        a, b, c = TRIANGLE_7[0, point], TRIANGLE_7[1, point], TRIANGLE_7[2, point]
        x = a * triangle[0, 0] + b * triangle[1, 0] + c * triangle[2, 0] - node[CENTROID]
        y = a * triangle[0, 1] + b * triangle[1, 1] + c * triangle[2, 1] - node[CENTROID + 1]
        z = a * triangle[0, 2] + b * triangle[1, 2] + c * triangle[2, 2] - node[CENTROID + 2]
        w = weight * TRIANGLE_7[3, point]
        d = (x, y, z)
        pairs = (x * x, y * y, z * z, x * y, x * z, y * z)
        place = FOURTH
        for i in range(6):
            moments[SECOND + i] += w * pairs[i]
            for axis in range(3):
                moments[THIRD + 6 * axis + i] += w * d[axis] * pairs[i]
            for j in range(i, 6):
                moments[place] += w * pairs[i] * pairs[j]
                place += 1
        square = x * x + y * y + z * z
        node[SPREAD4] += w * square * square
