"""Whether a point is inside a surface of triangles.

A ray from the point crosses the surface: outwards counts +1, inwards -1, and the sum is how often a closed surface
winds about the point, which is inside iff that is not 0. Signed counting (rather than parity) keeps the overlap of two
bodies in one mesh inside, and a cavity outside. Of an open surface the ray counts its caps too, whose own winding
number is then taken off (see `closing`): the point is inside iff what remains is beyond 1/2.

With the point at the origin, the line along d crosses the triangle a, b, c iff the three volumes
    U = d . (b x c),   V = d . (c x a),   W = d . (a x b)
have one sign: + leaves through the front if the crossing is ahead, and it is ahead iff N = a . (b x c) has that sign
too. Each value is trusted only beyond its rounding bound. A crossing that cannot be trusted (the line passes an edge,
or the point is on the plane, within rounding) voids the ray, and the next of a fixed list of directions is tried. A
point that voids all of them is on the surface within rounding, which counts as inside, or beside a sliver; then the
solid angles of all triangles decide (van Oosterom and Strackee 1983).
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64

from replay.errors import InvalidValue
from replay.geometry.closest import distance_to_surface
from replay.geometry.closing import caps, openness
from replay.geometry.solid_angle import winding_number
from replay.geometry.tree import MAX_DEPTH, TREE_TYPE, Tree, triangle_tree
from replay.numerics.arrays import Flags, Floats
from replay.numerics.constants import EPSILON
from replay.numerics.jit import entry, kernel

_UNSURE = -(2**31)


def _directions(count: int) -> Floats:
    """Return directions spread over the sphere (a Fibonacci lattice), no component of which is zero."""
    z = [1.0 - (2.0 * k + 1.0) / count for k in range(count)]
    turn = [2.399963229728653 * k + 0.5 for k in range(count)]
    return np.array(
        [
            [math.sqrt(1.0 - h * h) * math.cos(t), math.sqrt(1.0 - h * h) * math.sin(t), h]
            for h, t in zip(z, turn, strict=True)
        ]
    )


_DIRECTIONS = _directions(8)


def contains(triangles: Floats, points: Floats, *, tree: Tree | None = None, closing: Floats | None = None) -> Flags:
    """Return which points are inside, or within rounding of, a surface; none are in a sheet.

    Args:
        triangles: (n, 3, 3) wound one way [m].
        points: (m, 3) [m].
        tree: `triangle_tree(triangles)` if it is at hand.
        closing: `caps(triangles)` if they are at hand, of a surface that has an inside; none of a closed one.

    Raises:
        InvalidValue: wrong shapes or values that are not finite.

    Accuracy: no wrong answer in tests for points further from the surface than 1e-13 of the coordinates' magnitude.
    """
    triangles = np.ascontiguousarray(triangles, dtype=np.float64)
    points = np.ascontiguousarray(points, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] != 3 or not np.isfinite(points).all():
        raise InvalidValue("points", points.shape, "must have shape (m, 3) and be finite")
    if tree is None:
        tree = triangle_tree(triangles)
    if closing is None:
        closing = caps(triangles)
        if not openness(triangles, closing).has_inside:
            return np.zeros(len(points), dtype=np.bool_)
    return each_inside(points, triangles, tree, np.ascontiguousarray(closing))


@entry(float64[:, ::1], float64[:, :, ::1], TREE_TYPE, float64[:, :, ::1])
@kernel
def each_inside(points: Floats, triangles: Floats, tree: Tree, closing: Floats) -> Flags:
    """Return which points (m, 3) are inside, see `inside`."""
    result = np.empty(len(points), np.bool_)
    for k in range(len(points)):
        result[k] = inside(points[k], triangles, tree, closing) == 1
    return result


@kernel
def inside(point: Floats, triangles: Floats, tree: Tree, closing: Floats) -> int:
    """Return 1 if the point (3,) is inside the surface triangles (n, 3, 3), or on it within rounding, else 0.

    `closing` (m, 3, 3) holds the caps that close it. What is outside the surface's box is outside.
    """
    for axis in range(3):
        if not (tree.lower[0, axis] <= point[axis] <= tree.upper[0, axis]):
            return 0
    for k in range(len(_DIRECTIONS)):
        crossings = _crossings(point, _DIRECTIONS[k], triangles, tree)
        for t in range(len(closing)):
            if crossings != _UNSURE:
                crossing = _crossing(point, _DIRECTIONS[k], closing[t])
                crossings = crossings + crossing if crossing != _UNSURE else _UNSURE
        if crossings == _UNSURE:
            continue
        if len(closing) == 0:
            return 1 if crossings != 0 else 0
        return 1 if abs(crossings - winding_number(point, closing)) > 0.5 else 0
    magnitude = 0.0
    for axis in range(3):
        magnitude = max(magnitude, abs(tree.lower[0, axis]), abs(tree.upper[0, axis]))
    if distance_to_surface(point, triangles, tree) <= 64.0 * EPSILON * magnitude:
        return 1
    return 1 if abs(winding_number(point, triangles)) > 0.5 else 0


@kernel
def _crossings(point: Floats, d: Floats, triangles: Floats, tree: Tree) -> int:
    """Return the signed number of crossings ahead of the point along d, or _UNSURE."""
    waiting = np.empty(MAX_DEPTH, np.int64)
    waiting[0] = 0
    size, total = 1, 0
    while size > 0:
        size -= 1
        node = waiting[size]
        near, far = 0.0, np.inf
        for axis in range(3):
            first = (tree.lower[node, axis] - point[axis]) / d[axis]
            last = (tree.upper[node, axis] - point[axis]) / d[axis]
            near, far = max(near, min(first, last)), min(far, max(first, last))
        if near > far * (1.0 + 8.0 * EPSILON):  # the factor covers the rounding of near and far, both >= 0
            continue
        if tree.second[node] >= 0:
            waiting[size], waiting[size + 1] = tree.second[node], node + 1
            size += 2
            continue
        for k in range(tree.begin[node], tree.end[node]):
            crossing = _crossing(point, d, triangles[tree.order[k]])
            if crossing == _UNSURE:
                return _UNSURE
            total += crossing
    return total


@kernel
def _crossing(point: Floats, d: Floats, triangle: Floats) -> int:
    """Return +1 (outwards), -1 (inwards) or 0 (none) for the ray and one triangle, or _UNSURE.

    A difference rounds by eps / 2 relative, so a triple product of three of them, each term of at most |d| |b| |c|, is
    off by less than 16 eps |d| |b| |c| (about 7 roundings of at most 6 terms, with the 1-norm as |.|).
    """
    ax, ay, az = triangle[0, 0] - point[0], triangle[0, 1] - point[1], triangle[0, 2] - point[2]
    bx, by, bz = triangle[1, 0] - point[0], triangle[1, 1] - point[1], triangle[1, 2] - point[2]
    cx, cy, cz = triangle[2, 0] - point[0], triangle[2, 1] - point[1], triangle[2, 2] - point[2]
    a, b, c = abs(ax) + abs(ay) + abs(az), abs(bx) + abs(by) + abs(bz), abs(cx) + abs(cy) + abs(cz)
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    u = d[0] * nx + d[1] * ny + d[2] * nz
    v = d[0] * (cy * az - cz * ay) + d[1] * (cz * ax - cx * az) + d[2] * (cx * ay - cy * ax)
    w = d[0] * (ay * bz - az * by) + d[1] * (az * bx - ax * bz) + d[2] * (ax * by - ay * bx)
    eu, ev, ew = 16.0 * EPSILON * b * c, 16.0 * EPSILON * c * a, 16.0 * EPSILON * a * b
    if (u > eu or v > ev or w > ew) and (u < -eu or v < -ev or w < -ew):
        return 0
    n = ax * nx + ay * ny + az * nz
    en = 16.0 * EPSILON * a * b * c
    if u > eu and v > ev and w > ew:
        return 1 if n > en else (0 if n < -en else _UNSURE)
    if u < -eu and v < -ev and w < -ew:
        return -1 if n < -en else (0 if n > en else _UNSURE)
    return _UNSURE
