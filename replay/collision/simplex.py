"""The point nearest to the origin on a simplex of 1..4 points, in doubles.

This is the fast half of GJK's inner step. It may err on nearly degenerate simplices; it never says so itself, because
`gjk_kernel` accepts nothing without a verified bound and hands every doubtful query to `exact_simplex`.

Triangle with corners a, b, c and normal n = (b - a) x (c - a): the foot of the perpendicular from the origin has the
barycentric coordinates n.(b x c), n.(c x a), n.(a x b), over n.n. The Voronoi regions of its corners and edges follow
C. Ericson, Real-Time Collision Detection, 5.1.5. In the face region the nearest point is n (n.a)/(n.n): its direction
is as good as the normal's, however near the origin is, where a weighted sum of corners would cancel.

Tetrahedron p0..p3: with D_ijk = p_i.(p_j x p_k), the barycentric coordinates of the origin are D_123, -D_023, D_013,
-D_012 over their sum, the (six-fold) volume. The origin is inside iff all four have the sign of the sum.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

OUTSIDE = 0
INSIDE = 1
UNSURE = 2

DETERMINANT_ERROR = 64.0 * 2.0**-53
"""Bound of the rounding error of D_ijk over size max|p|^2; each product, each sum and each p_i contributes."""


@kernel
def nearest_on_segment(p: Floats, i: int, j: int, weights: Floats) -> Triple:
    """Return the point of the segment p[i] p[j] nearest to the origin; its weights are written at i and j."""
    ex, ey, ez = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
    along = -(p[i, 0] * ex + p[i, 1] * ey + p[i, 2] * ez)
    square = ex * ex + ey * ey + ez * ez
    if along <= 0.0 or square == 0.0:
        weights[i], weights[j] = 1.0, 0.0
        return p[i, 0], p[i, 1], p[i, 2]
    if along >= square:
        weights[i], weights[j] = 0.0, 1.0
        return p[j, 0], p[j, 1], p[j, 2]
    t = along / square
    weights[i], weights[j] = 1.0 - t, t
    if t <= 0.5:
        return p[i, 0] + t * ex, p[i, 1] + t * ey, p[i, 2] + t * ez
    t = 1.0 - t
    return p[j, 0] - t * ex, p[j, 1] - t * ey, p[j, 2] - t * ez


@kernel
def nearest_on_triangle(p: Floats, i: int, j: int, k: int, weights: Floats) -> Triple:
    """Return the point of the triangle p[i] p[j] p[k] nearest to the origin; weights are written at i, j and k."""
    ux, uy, uz = p[j, 0] - p[i, 0], p[j, 1] - p[i, 1], p[j, 2] - p[i, 2]
    vx, vy, vz = p[k, 0] - p[i, 0], p[k, 1] - p[i, 1], p[k, 2] - p[i, 2]
    weights[i], weights[j], weights[k] = 0.0, 0.0, 0.0
    # corner i
    d1 = -(ux * p[i, 0] + uy * p[i, 1] + uz * p[i, 2])
    d2 = -(vx * p[i, 0] + vy * p[i, 1] + vz * p[i, 2])
    if d1 <= 0.0 and d2 <= 0.0:
        weights[i] = 1.0
        return p[i, 0], p[i, 1], p[i, 2]
    # corner j
    d3 = -(ux * p[j, 0] + uy * p[j, 1] + uz * p[j, 2])
    d4 = -(vx * p[j, 0] + vy * p[j, 1] + vz * p[j, 2])
    if d3 >= 0.0 and d4 <= d3:
        weights[j] = 1.0
        return p[j, 0], p[j, 1], p[j, 2]
    # corner k
    d5 = -(ux * p[k, 0] + uy * p[k, 1] + uz * p[k, 2])
    d6 = -(vx * p[k, 0] + vy * p[k, 1] + vz * p[k, 2])
    if d6 >= 0.0 and d5 <= d6:
        weights[k] = 1.0
        return p[k, 0], p[k, 1], p[k, 2]
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    if square == 0.0:
        return _nearest_on_border(p, i, j, k, weights)
    # edges: the area opposite to a corner has no positive share
    share_k = nx * (p[i, 1] * p[j, 2] - p[i, 2] * p[j, 1])
    share_k += ny * (p[i, 2] * p[j, 0] - p[i, 0] * p[j, 2])
    share_k += nz * (p[i, 0] * p[j, 1] - p[i, 1] * p[j, 0])
    if share_k <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        return nearest_on_segment(p, i, j, weights)
    share_j = nx * (p[k, 1] * p[i, 2] - p[k, 2] * p[i, 1])
    share_j += ny * (p[k, 2] * p[i, 0] - p[k, 0] * p[i, 2])
    share_j += nz * (p[k, 0] * p[i, 1] - p[k, 1] * p[i, 0])
    if share_j <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        return nearest_on_segment(p, i, k, weights)
    share_i = square - share_j - share_k
    if share_i <= 0.0 and d4 - d3 >= 0.0 and d5 - d6 >= 0.0:
        return nearest_on_segment(p, j, k, weights)
    if share_i <= 0.0 or share_j <= 0.0 or share_k <= 0.0:
        return _nearest_on_border(p, i, j, k, weights)
    # face
    weights[i], weights[j], weights[k] = share_i / square, share_j / square, share_k / square
    distance = (nx * p[i, 0] + ny * p[i, 1] + nz * p[i, 2]) / square
    return nx * distance, ny * distance, nz * distance


@kernel
def _nearest_on_border(p: Floats, i: int, j: int, k: int, weights: Floats) -> Triple:
    """Let the three edges of a triangle compete: for one that is degenerate or contradicts itself."""
    best = np.inf
    x, y, z = 0.0, 0.0, 0.0
    wi, wj, wk = 0.0, 0.0, 0.0
    for skipped in range(3):
        first, second = (j, k) if skipped == 0 else ((i, k) if skipped == 1 else (i, j))
        weights[i], weights[j], weights[k] = 0.0, 0.0, 0.0
        qx, qy, qz = nearest_on_segment(p, first, second, weights)
        square = qx * qx + qy * qy + qz * qz
        if square < best:
            best = square
            x, y, z = qx, qy, qz
            wi, wj, wk = weights[i], weights[j], weights[k]
    weights[i], weights[j], weights[k] = wi, wj, wk
    return x, y, z


@kernel
def nearest_on_tetrahedron(p: Floats, size: float, weights: Floats) -> tuple[int, float, float, float]:
    """Return (OUTSIDE | INSIDE | UNSURE, x, y, z): whether the origin is in the tetrahedron, else its nearest point.

    Args:
        p: (4, 3) corners.
        size: bound on the coordinates that p was formed from.
        weights: (4,) barycentric coordinates, out; of the origin when inside.
    """
    ax, ay, az = _cross(p, 0, 1)
    bx, by, bz = _cross(p, 2, 3)
    s0 = p[1, 0] * bx + p[1, 1] * by + p[1, 2] * bz
    s1 = -(p[0, 0] * bx + p[0, 1] * by + p[0, 2] * bz)
    s2 = p[3, 0] * ax + p[3, 1] * ay + p[3, 2] * az
    s3 = -(p[2, 0] * ax + p[2, 1] * ay + p[2, 2] * az)
    largest = 0.0
    for i in range(4):
        largest = max(largest, p[i, 0] * p[i, 0] + p[i, 1] * p[i, 1] + p[i, 2] * p[i, 2])
    limit = DETERMINANT_ERROR * size * largest
    volume = s0 + s1 + s2 + s3
    flat = abs(volume) <= 4.0 * limit
    if volume < 0.0:
        s0, s1, s2, s3 = -s0, -s1, -s2, -s3
        volume = -volume
    if not flat and s0 > limit and s1 > limit and s2 > limit and s3 > limit:
        weights[0], weights[1], weights[2], weights[3] = s0 / volume, s1 / volume, s2 / volume, s3 / volume
        return INSIDE, 0.0, 0.0, 0.0
    if not flat and s0 >= -limit and s1 >= -limit and s2 >= -limit and s3 >= -limit:
        return UNSURE, 0.0, 0.0, 0.0
    # outside: the faces that the origin is beyond, or may be, compete
    best = np.inf
    x, y, z = 0.0, 0.0, 0.0
    w0, w1, w2, w3 = 0.0, 0.0, 0.0, 0.0
    for skipped in range(4):
        share = s0 if skipped == 0 else (s1 if skipped == 1 else (s2 if skipped == 2 else s3))
        if not flat and share > limit:
            continue
        i = 0 if skipped > 0 else 1
        j = 1 if skipped > 1 else 2
        k = 2 if skipped > 2 else 3
        weights[skipped] = 0.0
        qx, qy, qz = nearest_on_triangle(p, i, j, k, weights)
        square = qx * qx + qy * qy + qz * qz
        if square < best:
            best = square
            x, y, z = qx, qy, qz
            w0, w1, w2, w3 = weights[0], weights[1], weights[2], weights[3]
    weights[0], weights[1], weights[2], weights[3] = w0, w1, w2, w3
    return OUTSIDE, x, y, z


@kernel
def _cross(p: Floats, i: int, j: int) -> Triple:
    return (
        p[i, 1] * p[j, 2] - p[i, 2] * p[j, 1],
        p[i, 2] * p[j, 0] - p[i, 0] * p[j, 2],
        p[i, 0] * p[j, 1] - p[i, 1] * p[j, 0],
    )
