"""The least distance between two surfaces of triangles, and where it is.

Two triangles are nearest at a corner of one and the face of the other, or at an edge of each; they meet if an edge of
one goes through the other.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64

from replay.geometry.closest import distance_to_surface
from replay.geometry.tree import MAX_DEPTH, TREE_TYPE, Tree
from replay.numerics.arrays import Flags, Floats
from replay.numerics.jit import entry, kernel, leaf_kernel
from replay.numerics.triples import Triple, along, cross, dot, minus


class Gap(NamedTuple):
    """Two points as near as two surfaces come; `distance` is inf where no two are nearer than was asked for."""

    distance: float  # [m], 0 where they meet
    first: Triple  # [m]
    second: Triple  # [m]


@leaf_kernel
def _corner(triangle: Floats, k: int) -> Triple:
    return (triangle[k, 0], triangle[k, 1], triangle[k, 2])


@leaf_kernel
def _on_triangle(p: Triple, a: Triple, b: Triple, c: Triple) -> tuple[bool, Triple]:
    """Return whether the foot of p on a triangle's plane is in it, and the foot."""
    n = cross(minus(b, a), minus(c, a))
    square = dot(n, n)
    if square <= 0.0:
        return False, p
    inside = dot(n, cross(minus(b, a), minus(p, a))) >= 0.0
    inside = inside and dot(n, cross(minus(c, b), minus(p, b))) >= 0.0
    inside = inside and dot(n, cross(minus(a, c), minus(p, c))) >= 0.0
    return inside, along(p, dot(n, minus(a, p)) / square, n)


@leaf_kernel
def _share(value: float) -> float:
    return min(max(value, 0.0), 1.0)


@leaf_kernel
def _between_segments(p: Triple, q: Triple, r: Triple, s: Triple) -> tuple[Triple, Triple]:
    """Return the nearest points of two segments (Ericson, Real-Time Collision Detection 2005, 5.1.9)."""
    u, v, w = minus(q, p), minus(s, r), minus(p, r)
    a, e, f = dot(u, u), dot(v, v), dot(v, w)
    if a <= 0.0 and e <= 0.0:
        return p, r
    if a <= 0.0:
        return p, along(r, _share(f / e), v)
    c = dot(u, w)
    if e <= 0.0:
        return along(p, _share(-c / a), u), r
    b = dot(u, v)
    denominator = a * e - b * b
    t = _share((b * f - c * e) / denominator) if denominator > 1e-14 * a * e else 0.0
    x = (b * t + f) / e
    if x < 0.0:
        x, t = 0.0, _share(-c / a)
    elif x > 1.0:
        x, t = 1.0, _share((b - c) / a)
    return along(p, t, u), along(r, x, v)


@leaf_kernel
def _pierces(p: Triple, q: Triple, a: Triple, b: Triple, c: Triple) -> bool:
    """Return whether the segment from p to q goes through a triangle's plane within the triangle."""
    n = cross(minus(b, a), minus(c, a))
    low, high = dot(n, minus(p, a)), dot(n, minus(q, a))
    if not (low <= 0.0 <= high or high <= 0.0 <= low) or low == high:
        return False
    at = along(p, low / (low - high), minus(q, p))
    inside, _ = _on_triangle(at, a, b, c)
    return inside


@leaf_kernel
def _between_triangles(x: Floats, y: Floats) -> tuple[float, Triple, Triple]:
    """Return the squared distance [m^2] of two triangles (3, 3) and where it is."""
    a, b, c = _corner(x, 0), _corner(x, 1), _corner(x, 2)
    d, e, f = _corner(y, 0), _corner(y, 1), _corner(y, 2)
    best, first, second = math.inf, a, d
    for i in range(3):
        p, q = _corner(x, i), _corner(x, (i + 1) % 3)
        r, s = _corner(y, i), _corner(y, (i + 1) % 3)
        if _pierces(p, q, d, e, f):
            return 0.0, p, p
        if _pierces(r, s, a, b, c):
            return 0.0, r, r
        inside, foot = _on_triangle(p, d, e, f)
        gap = minus(foot, p)
        if inside and dot(gap, gap) < best:
            best, first, second = dot(gap, gap), p, foot
        inside, foot = _on_triangle(r, a, b, c)
        gap = minus(foot, r)
        if inside and dot(gap, gap) < best:
            best, first, second = dot(gap, gap), foot, r
        for j in range(3):
            m, n = _between_segments(p, q, _corner(y, j), _corner(y, (j + 1) % 3))
            gap = minus(m, n)
            if dot(gap, gap) < best:
                best, first, second = dot(gap, gap), m, n
    return best, first, second


@leaf_kernel
def _box_gap(lower: Floats, upper: Floats, tree: Tree, node: int) -> float:
    """Return the squared distance of a box and a node's box."""
    total = 0.0
    for axis in range(3):
        gap = max(lower[axis] - tree.upper[node, axis], tree.lower[node, axis] - upper[axis], 0.0)
        total += gap * gap
    return total


@entry(float64[:, :, ::1], float64[:, :, ::1], TREE_TYPE, float64)
@kernel
def least_gap(surface: Floats, triangles: Floats, tree: Tree, within: float) -> Gap:
    """Return how near triangles (n, 3, 3) come to triangles (m, 3, 3) under their tree, all in one frame [m].

    Distances from `within` [m] on are not looked for.
    """
    best, first, second = within * within, (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
    found = False
    waiting = np.empty(MAX_DEPTH + 1, np.int64)
    lower, upper = np.empty(3), np.empty(3)
    for k in range(len(surface)):
        for axis in range(3):
            a, b, c = surface[k, 0, axis], surface[k, 1, axis], surface[k, 2, axis]
            lower[axis], upper[axis] = min(a, b, c), max(a, b, c)
        waiting[0] = 0
        size = 1
        while size > 0 and best > 0.0:
            size -= 1
            node = waiting[size]
            if _box_gap(lower, upper, tree, node) >= best:
                continue
            if tree.second[node] >= 0:
                waiting[size], waiting[size + 1] = tree.second[node], node + 1
                size += 2
                continue
            for i in range(tree.begin[node], tree.end[node]):
                square, p, q = _between_triangles(surface[k], triangles[tree.order[i]])
                if square < best:
                    best, first, second, found = square, p, q, True
    return Gap(math.sqrt(best) if found else math.inf, first, second)


@entry(float64[:, :, ::1], float64[:, :, ::1], float64[:, :, ::1], TREE_TYPE, float64)
@kernel
def gaps(surface: Floats, T_body_surface: Floats, triangles: Floats, tree: Tree, within: float) -> Floats:
    """Return, for n poses (n, 4, 4) of a surface, the gaps (n, 7) [m]: distance, both points in the body's frame."""
    result = np.zeros((len(T_body_surface), 7))
    placed = np.empty_like(surface)
    for frame in range(len(T_body_surface)):
        T = T_body_surface[frame]
        for k in range(len(surface)):
            for corner in range(3):
                x, y, z = surface[k, corner, 0], surface[k, corner, 1], surface[k, corner, 2]
                for axis in range(3):
                    placed[k, corner, axis] = T[axis, 0] * x + T[axis, 1] * y + T[axis, 2] * z + T[axis, 3]
        found = least_gap(placed, triangles, tree, within)
        result[frame, 0] = found.distance
        for axis in range(3):
            result[frame, 1 + axis], result[frame, 4 + axis] = found.first[axis], found.second[axis]
    return result


@entry(float64[:, ::1], float64[:, :, ::1], TREE_TYPE, float64)
@kernel
def on_surface(points: Floats, triangles: Floats, tree: Tree, within: float) -> Flags:
    """Return which points (n, 3) are no farther than `within` [m] from triangles (m, 3, 3) under their tree."""
    result = np.empty(len(points), np.bool_)
    for k in range(len(points)):
        result[k] = distance_to_surface(points[k], triangles, tree) <= within
    return result
