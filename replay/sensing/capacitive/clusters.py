"""What a far cluster of triangles looks like to a plate: area, centroid and moments up to the fourth, per tree node.

Computed once per body, in its own frame. A 7-point rule of degree 5 makes the moments of a triangle exact (Radon 1948).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import Tree
from replay.numerics.jit import kernel
from replay.sensing.capacitive.triangle_sum import triangle_areas

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_ROOT = math.sqrt(15.0)
RULE_7 = np.array(
    [
        [1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0, 9.0 / 40.0],
        *[
            [*(1.0 - 2.0 * t if k == corner else t for k in range(3)), weight]
            for t, weight in (
                ((6.0 + _ROOT) / 21.0, (155.0 + _ROOT) / 1200.0),
                ((6.0 - _ROOT) / 21.0, (155.0 - _ROOT) / 1200.0),
            )
            for corner in range(3)
        ],
    ]
)
"""(7, 4): barycentric coordinates and weight of each point; polynomials of degree 5 are integrated exactly."""

PAIRS = np.array([[0, 0], [1, 1], [2, 2], [0, 1], [0, 2], [1, 2]])
"""Order of the six entries of a symmetric matrix: xx, yy, zz, xy, xz, yz."""


class Clusters(NamedTuple):
    """m tree nodes over n triangles; moments are means over a node's area, about its centroid, in the body's frame.

    Triangles are listed in the order of the tree, so that a node's triangles are neighbours.
    """

    triangles: Floats  # (n, 3, 3) [m]
    areas: Floats  # (n,) [m^2]
    area: Floats  # (m,) [m^2]
    centroid: Floats  # (m, 3) [m]
    radius: Floats  # (m,) [m], largest distance of a corner from the centroid
    second: Floats  # (m, 6) [m^2], mean of d_i d_j in the order of PAIRS
    third: Floats  # (m, 3, 6) [m^3], mean of d_k d_i d_j
    fourth: Floats  # (m, 6, 6) [m^4], mean of d_i d_j d_k d_l
    spread2: Floats  # (m,) [m^2], mean of |d|^2
    spread4: Floats  # (m,) [m^4], mean of |d|^4
    normal: Floats  # (m, 3), axis of a cone around the outward normals
    opening: Floats  # (m,) [-], cosine of that cone's half angle; -1 when the normals point everywhere


def make_clusters(triangles: Floats, tree: Tree) -> Clusters:
    """Return the clusters of triangles (n, 3, 3) [m] under their tree."""
    ordered = np.ascontiguousarray(triangles[tree.order], dtype=np.float64)
    areas = triangle_areas(ordered)
    return Clusters(ordered, areas, *_moments(ordered, areas, tree.begin, tree.end))


@kernel
def _moments(
    triangles: Floats, areas: Floats, begin: Ints, end: Ints
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats, Floats]:
    m = len(begin)
    area, centroid, radius = np.zeros(m), np.zeros((m, 3)), np.zeros(m)
    second, third, fourth = np.zeros((m, 6)), np.zeros((m, 3, 6)), np.zeros((m, 6, 6))
    spread2, spread4 = np.zeros(m), np.zeros(m)
    normal, opening = np.zeros((m, 3)), np.zeros(m)
    unit = np.zeros((len(triangles), 3))
    for k in range(len(triangles)):
        _unit_normal(triangles[k], unit[k])
    d, pairs = np.empty(3), np.empty(6)
    for node in range(m):
        mean = centroid[node]
        for k in range(begin[node], end[node]):
            area[node] += areas[k]
            for axis in range(3):
                normal[node, axis] += areas[k] * unit[k, axis]
        for k in range(begin[node], end[node]):
            # a body without area still has a place
            weight = areas[k] / area[node] if area[node] > 0.0 else 1.0 / (end[node] - begin[node])
            for axis in range(3):
                mean[axis] += weight * (triangles[k, 0, axis] + triangles[k, 1, axis] + triangles[k, 2, axis]) / 3.0
        length = math.sqrt(normal[node, 0] ** 2 + normal[node, 1] ** 2 + normal[node, 2] ** 2)
        opening[node] = 1.0 if length > 1e-9 * area[node] else -1.0
        for axis in range(3):
            normal[node, axis] = normal[node, axis] / length if opening[node] > 0.0 else 0.0
        for k in range(begin[node], end[node]):
            weight = areas[k] / area[node] if area[node] > 0.0 else 0.0
            _add_triangle(triangles[k], weight, mean, d, pairs, second[node], third[node], fourth[node])
            if areas[k] > 0.0 and opening[node] > -1.0:
                cosine = 0.0
                for axis in range(3):
                    cosine += unit[k, axis] * normal[node, axis]
                opening[node] = min(opening[node], cosine)
            for corner in range(3):
                square = 0.0
                for axis in range(3):
                    square += (triangles[k, corner, axis] - mean[axis]) ** 2
                radius[node] = max(radius[node], math.sqrt(square))
        for i in range(3):
            spread2[node] += second[node, i]
            for j in range(3):
                spread4[node] += fourth[node, i, j]
    return area, centroid, radius, second, third, fourth, spread2, spread4, normal, opening


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
def _add_triangle(
    triangle: Floats,
    weight: float,
    mean: Floats,
    d: Floats,
    pairs: Floats,
    second: Floats,
    third: Floats,
    fourth: Floats,
) -> None:
    for point in range(7):
        for axis in range(3):
            d[axis] = 0.0
            for corner in range(3):
                d[axis] += RULE_7[point, corner] * (triangle[corner, axis] - mean[axis])
        w = weight * RULE_7[point, 3]
        for i in range(6):
            pairs[i] = d[PAIRS[i, 0]] * d[PAIRS[i, 1]]
            second[i] += w * pairs[i]
            for axis in range(3):
                third[axis, i] += w * d[axis] * pairs[i]
        for i in range(6):
            for j in range(6):
                fourth[i, j] += w * pairs[i] * pairs[j]
