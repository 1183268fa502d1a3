"""Whether a closed surface bounds its own hull: no corner lies outside any face's plane, within rounding.

A closed surface in one part that is convex across every edge, and about every corner winds once, is the boundary of a
convex body (Hadamard 1897, van Heijenoort 1952): that takes a look at each edge and each corner. Where rounding could
turn a sign, or facets are of several triangles, all corners of the hull are held against all planes, many at a time:
of a cluster of neighbouring faces the unit normals m lie in a box, and so do the corners p of a node of a tree, so that
no height m . (p - a) is more than the largest product of the boxes less the least m . a, all seen from the middle of
the cluster.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import float64, int64

from replay.geometry.facets import ROUNDING
from replay.geometry.hull import extreme_points, to_unit_box
from replay.geometry.tree import MAX_DEPTH, TREE_TYPE, Tree, build_tree
from replay.geometry.winding import Sides, components, sides
from replay.numerics.arrays import Floats, Integers
from replay.numerics.constants import EPSILON
from replay.numerics.jit import entry, kernel

STRICTLY: Final = 1e-9
"""How far below each face's plane the corners of its neighbours lie on a strictly convex surface, in half extents: so
far that no rounding makes any of them a point that the others' hull holds."""

_CLUSTER = 8
"""Most corners in a leaf of the tree; faces that begin in one leaf are a cluster."""

_SURE = 1e-13
"""Covers the rounding of heights over coordinates up to 1: at most 30 roundings of 2^-52."""

_VOLUME = 16.0 * EPSILON
"""Bound of the rounding of a determinant of three differences over the product of their 1-norms."""

_NOT, _WITHIN_ROUNDING, _STRICTLY = 0, 1, 2


class ConvexPiece(NamedTuple):
    """The corners of a convex surface.

    Attributes:
        corners: (k, 3) [m], sorted; vertices of their hull.
        strictly: whether all are vertices of their hull by far more than rounding (`STRICTLY`), wherever they are
            moved: no hull has to be computed to find them.
    """

    corners: Floats
    strictly: bool


def convex_piece(points: Floats, faces: Integers, found: Sides | None = None) -> ConvexPiece | None:
    """Return the corners of a closed surface if it is convex, else None.

    Convex is a surface of which no corner is further outside the plane of a face than `ROUNDING` of the largest
    coordinate: 24 bits of a coordinate are kept in files.

    Args:
        points: (p, 3) [m], distinct and sorted.
        faces: (n, 3) indices of them, counter-clockwise from outside, each of some area.
        found: `sides(faces)`, of any sense, if they are at hand.
    """
    used = np.zeros(len(points), dtype=np.bool_)
    used[faces] = True
    corners, faces = points[used], (np.cumsum(used) - 1)[faces]
    local, centre, scale = to_unit_box(corners)
    slack = ROUNDING * float(np.max(np.abs(corners))) / scale
    if found is None or not used.all():
        found = sides(faces)
    among = _at_edges(local, faces, found.face, found.first, found.ends, slack)
    if among == _NOT:
        return None
    if among == _STRICTLY and _winds_once(local, faces):
        neighbours = found.face.reshape(-1, 2)  # a surface that is strictly convex has two faces at each edge
        if not components(len(faces), neighbours).any():
            return ConvexPiece(corners, strictly=True)
    faces, first = _clusters(faces, build_tree(local, local, leaf_size=_CLUSTER))
    extreme = extreme_points(corners)
    tested = np.ascontiguousarray((extreme - centre) / scale)
    convex = _all_below(local, faces, first, tested, build_tree(tested, tested, leaf_size=_CLUSTER), slack)
    return ConvexPiece(extreme, strictly=False) if convex else None


def _clusters(faces: Integers, tree: Tree) -> tuple[Integers, Integers]:
    """Return faces in the order of the leaves that their first corners are in, and where each leaf's faces begin."""
    place = np.empty(len(tree.order), dtype=np.int64)
    place[tree.order] = np.arange(len(place))
    begins = tree.begin[tree.second < 0]
    leaf = np.searchsorted(begins, place[faces[:, 0]], side="right") - 1
    order = np.argsort(leaf, kind="stable")
    first = np.searchsorted(leaf[order], np.arange(len(begins) + 1))
    return np.ascontiguousarray(faces[order]), first.astype(np.int64)


@kernel
def _normal(points: Floats, face: Integers) -> tuple[float, float, float]:
    """Return the normal of a face, as long as twice its area."""
    a, b, c = points[face[0]], points[face[1]], points[face[2]]
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def _distance(a: Floats, b: Floats) -> float:
    """Return how far two points are from each other, as the sum along the axes."""
    return abs(a[0] - b[0]) + abs(a[1] - b[1]) + abs(a[2] - b[2])  # type: ignore[no-any-return]


@entry(float64[:, ::1], int64[:, ::1], int64[::1], int64[::1], int64[:, ::1], float64)
@kernel
def _at_edges(points: Floats, faces: Integers, face: Integers, first: Integers, ends: Integers, slack: float) -> int:
    """Return how convex a surface is across its edges, see `winding.Sides`; at most within rounding if faces touch."""
    found = _STRICTLY
    for edge in range(len(ends)):
        if first[edge + 1] - first[edge] != 2:
            found = _WITHIN_ROUNDING
            continue
        for k in range(2):
            one, other = faces[face[first[edge] + k]], faces[face[first[edge] + 1 - k]]
            nx, ny, nz = _normal(points, one)
            a, p = points[one[0]], points[other[0] + other[1] + other[2] - ends[edge, 0] - ends[edge, 1]]
            height = nx * (p[0] - a[0]) + ny * (p[1] - a[1]) + nz * (p[2] - a[2])
            length = math.sqrt(nx * nx + ny * ny + nz * nz)
            if height > slack * length:
                return _NOT
            rounding = _VOLUME * _distance(points[one[1]], a) * _distance(points[one[2]], a) * _distance(p, a)
            if not height < -STRICTLY * length - rounding:
                found = _WITHIN_ROUNDING
    return found


@entry(float64[:, ::1], int64[:, ::1])
@kernel
def _winds_once(points: Floats, faces: Integers) -> bool:
    """Return whether the faces about each corner surely go once around the way from it to its neighbours' middle.

    About that way d each face (a, b, c) turns the same way, d . (b - a) x (c - a) < 0, by less than half a turn; so one
    face in each turn leads from below a plane that holds d to above it, and one corner has one such face.
    """
    way, turns = np.zeros((len(points), 3)), np.zeros(len(points), np.int64)
    for face in faces:
        for k in range(3):
            a, b = points[face[k]], points[face[(k + 1) % 3]]
            x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            length = math.sqrt(x * x + y * y + z * z)
            way[face[k], 0] += x / length
            way[face[k], 1] += y / length
            way[face[k], 2] += z / length
    for face in faces:
        for k in range(3):
            a, b, c, d = points[face[k]], points[face[(k + 1) % 3]], points[face[(k + 2) % 3]], way[face[k]]
            ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
            vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
            volume = d[0] * (uy * vz - uz * vy) + d[1] * (uz * vx - ux * vz) + d[2] * (ux * vy - uy * vx)
            size = (abs(d[0]) + abs(d[1]) + abs(d[2])) * _distance(b, a) * _distance(c, a)
            if not volume < -_VOLUME * size:
                return False
            least = 0
            for axis in range(1, 3):
                if abs(d[axis]) < abs(d[least]):
                    least = axis
            i, j = (least + 1) % 3, (least + 2) % 3  # the plane through d and the axis that is farthest from it
            low, high = d[i] * (b[j] - a[j]) - d[j] * (b[i] - a[i]), d[i] * (c[j] - a[j]) - d[j] * (c[i] - a[i])
            if low < 0.0 <= high:
                turns[face[k]] += 1
    return bool(np.all(turns == 1))


@entry(float64[:, ::1], int64[:, ::1], int64[::1], float64[:, ::1], TREE_TYPE, float64)
@kernel
def _all_below(points: Floats, faces: Integers, first: Integers, tested: Floats, tree: Tree, slack: float) -> bool:
    """Return whether no tested point is further than slack outside the plane of any face.

    Args:
        points: (p, 3) of extent 1 about the origin.
        faces: (n, 3) indices of them, cluster after cluster, which begin at `first`.
        tested: (t, 3) points, with the tree over them.
        slack: at least `_SURE`.
    """
    planes = np.empty((np.max(np.diff(first)), 7))  # a corner, the normal and its length
    waiting = np.empty(MAX_DEPTH, np.int64)
    centre, low, high = np.empty(3), np.empty(3), np.empty(3)
    for cluster in range(len(first) - 1):
        begin, count = first[cluster], first[cluster + 1] - first[cluster]
        if count == 0:
            continue
        for axis in range(3):
            centre[axis], low[axis], high[axis] = 0.0, np.inf, -np.inf
        for t in range(count):
            a, plane = points[faces[begin + t, 0]], planes[t]
            nx, ny, nz = _normal(points, faces[begin + t])
            plane[0], plane[1], plane[2], plane[3], plane[4], plane[5] = a[0], a[1], a[2], nx, ny, nz
            plane[6] = math.sqrt(nx * nx + ny * ny + nz * nz)
            for axis in range(3):
                centre[axis] += a[axis] / count
        depth = np.inf  # least height of a plane over the centre
        for t in range(count):
            plane = planes[t]
            if plane[6] > 0.0:  # of a face that rounding has made flat all heights are 0
                height = 0.0
                for axis in range(3):
                    unit = plane[3 + axis] / plane[6]
                    low[axis], high[axis] = min(low[axis], unit), max(high[axis], unit)
                    height += unit * (plane[axis] - centre[axis])
                depth = min(depth, height)
        waiting[0] = 0
        size = 1 if depth < np.inf else 0
        while size > 0:
            size -= 1
            node = waiting[size]
            top = -depth
            for axis in range(3):
                x, y = tree.lower[node, axis] - centre[axis], tree.upper[node, axis] - centre[axis]
                top += max(low[axis] * x, low[axis] * y, high[axis] * x, high[axis] * y)
            if top <= slack - _SURE:
                continue
            if tree.second[node] >= 0:
                waiting[size], waiting[size + 1] = tree.second[node], node + 1
                size += 2
                continue
            for t in range(count):
                ax, ay, az, nx, ny, nz, length = planes[t]
                x = tree.upper[node, 0] if nx > 0.0 else tree.lower[node, 0]
                y = tree.upper[node, 1] if ny > 0.0 else tree.lower[node, 1]
                z = tree.upper[node, 2] if nz > 0.0 else tree.lower[node, 2]
                if nx * (x - ax) + ny * (y - ay) + nz * (z - az) <= slack * length:
                    continue
                for k in range(tree.begin[node], tree.end[node]):
                    p = tested[tree.order[k]]
                    if nx * (p[0] - ax) + ny * (p[1] - ay) + nz * (p[2] - az) > slack * length:
                        return False
    return True
