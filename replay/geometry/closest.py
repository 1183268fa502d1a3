"""The distance from a point to a surface of triangles, found through their tree."""

from __future__ import annotations

import numpy as np

from replay.geometry.tree import MAX_DEPTH, Tree
from replay.numerics.arrays import Floats
from replay.numerics.jit import kernel


@kernel
def squared_distance_to_box(point: Floats, lower: Floats, upper: Floats) -> float:
    """Return the squared distance [m^2] from a point to a box; 0 inside."""
    total = 0.0
    for axis in range(3):
        gap = max(lower[axis] - point[axis], point[axis] - upper[axis], 0.0)
        total += gap * gap
    return total


@kernel
def _segment(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> float:
    """Return the squared distance from the origin to the segment a-b."""
    ux, uy, uz = bx - ax, by - ay, bz - az
    length = ux * ux + uy * uy + uz * uz
    t = -(ax * ux + ay * uy + az * uz)
    t = min(max(t / length, 0.0), 1.0) if length > 0.0 else 0.0
    x, y, z = ax + t * ux, ay + t * uy, az + t * uz
    return x * x + y * y + z * z


@kernel
def squared_distance_to_triangle(point: Floats, triangle: Floats) -> float:
    """Return the squared distance [m^2] from a point to a triangle (3, 3).

    With the point at the origin, its foot on the plane is inside iff it lies to the left of each edge, that is
    n . (a x b) >= 0 for every edge a-b, n the normal. Else the nearest of the three edges is the nearest part. A flat
    triangle is its edges.
    """
    ax, ay, az = triangle[0, 0] - point[0], triangle[0, 1] - point[1], triangle[0, 2] - point[2]
    bx, by, bz = triangle[1, 0] - point[0], triangle[1, 1] - point[1], triangle[1, 2] - point[2]
    cx, cy, cz = triangle[2, 0] - point[0], triangle[2, 1] - point[1], triangle[2, 2] - point[2]
    ux, uy, uz = bx - ax, by - ay, bz - az
    vx, vy, vz = cx - ax, cy - ay, cz - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    ab = nx * (ay * bz - az * by) + ny * (az * bx - ax * bz) + nz * (ax * by - ay * bx)
    bc = nx * (by * cz - bz * cy) + ny * (bz * cx - bx * cz) + nz * (bx * cy - by * cx)
    ca = nx * (cy * az - cz * ay) + ny * (cz * ax - cx * az) + nz * (cx * ay - cy * ax)
    if square > 0.0 and ab >= 0.0 and bc >= 0.0 and ca >= 0.0:
        height = nx * ax + ny * ay + nz * az
        return height * height / square  # type: ignore[no-any-return]
    nearest = _segment(ax, ay, az, bx, by, bz)
    nearest = min(nearest, _segment(bx, by, bz, cx, cy, cz))
    return min(nearest, _segment(cx, cy, cz, ax, ay, az))


@kernel
def distance_to_surface(point: Floats, triangles: Floats, tree: Tree) -> float:
    """Return the distance [m] from a point (3,) to triangles (n, 3, 3) under their tree."""
    return nearest_triangle(point, triangles, tree)[0]


@kernel
def nearest_triangle(point: Floats, triangles: Floats, tree: Tree) -> tuple[float, int]:
    """Return (distance [m], index) of the triangle of (n, 3, 3) nearest to a point (3,), found through their tree."""
    waiting = np.empty(MAX_DEPTH, np.int64)
    bounds = np.empty(MAX_DEPTH)
    best, nearest = np.inf, -1
    waiting[0], bounds[0] = 0, 0.0
    size = 1
    while size > 0:
        size -= 1
        node = waiting[size]
        if bounds[size] >= best:
            continue
        if tree.second[node] < 0:
            for k in range(tree.begin[node], tree.end[node]):
                square = squared_distance_to_triangle(point, triangles[tree.order[k]])
                if square < best:
                    best, nearest = square, tree.order[k]
            continue
        near, far = node + 1, tree.second[node]
        to_near = squared_distance_to_box(point, tree.lower[near], tree.upper[near])
        to_far = squared_distance_to_box(point, tree.lower[far], tree.upper[far])
        if to_far < to_near:
            near, far, to_near, to_far = far, near, to_far, to_near
        waiting[size], bounds[size] = far, to_far
        waiting[size + 1], bounds[size + 1] = near, to_near
        size += 2
    return np.sqrt(best), nearest
