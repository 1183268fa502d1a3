"""The point nearest to the origin on a simplex of 1..4 points, in double-doubles, degenerate or not.

Every feature (corner, edge, face, interior) whose affine hull has the foot of the origin's perpendicular strictly
inside it proposes that foot; each proposal is a point of the simplex, and the nearest point is one of them, so the
smallest wins. A feature that is degenerate beyond the arithmetic proposes nothing: its lower features stand in for it.
When a support point w was just added because it is lower along v than v itself, the nearest point's feature has w as a
corner; asking for that settles ties that even double-doubles cannot see (a direction that is off by x makes the
distance wrong by x^2 only).

With edge e = q - p: weights (q.e, -p.e) over e.e, and the foot is e x (p x e)/(e.e), with p the nearer end: orthogonal
to e to its own last digit, which p + t e is only to the last digit of p. Faces and interior as in `simplex`.
"""

from __future__ import annotations

import math

import numpy as np

from replay.numerics import double_double as dd
from replay.numerics.arrays import Floats
from replay.numerics.jit import leaf_kernel

DEGENERATE = 2.0**-66
"""A face whose normal is shorter than this times the product of its edges proposes nothing (cosines keep 2^-38)."""


SHARED = 2.0**-192
"""Squared rounding error of a corner's share over its factors. With a newest corner, a share that is 0 to rounding
counts: the foot moves by nothing, but its direction is then orthogonal to the whole feature, which tells the next
support point from this one where a sheet of 1e-16 of the size is all there is to go through."""

LEAST = 1e-60
"""Weight of a corner whose share is rounding only, so that it is kept."""

WITNESS = 2.0**-44
"""Largest accepted distance, over size, of the two points that the weights of a contact stand for."""


@leaf_kernel
def corner(points: Floats, i: int) -> dd.Vector:
    """Return point i of points (4, 3, 2) as a vector of double-doubles."""
    return (
        (points[i, 0, 0], points[i, 0, 1]),
        (points[i, 1, 0], points[i, 1, 1]),
        (points[i, 2, 0], points[i, 2, 1]),
    )


@leaf_kernel
def nearest(points: Floats, n: int, newest: int, size: float, weights: Floats) -> tuple[bool, dd.Vector, dd.Pair]:
    """Return (inside, nearest point, its squared distance to the origin) for the simplex points[:n].

    Args:
        points: (4, 3, 2) corners, high and low parts.
        n: number of corners.
        newest: the corner that the nearest point's feature must have; -1 for any.
        size: bound on the corners' distance from the origin.
        weights: (4,) shares of the corners in the nearest point, out. Inside a tetrahedron so flat that its shares are
            mostly rounding, they are those of its nearest corner, edge or face.
    """
    zero = (0.0, 0.0)
    best_point = (zero, zero, zero)
    # interior
    inside = n == 4 and _contains_origin(points, size, weights)
    if inside and residual(points, n, weights) <= WITNESS * size:
        return True, best_point, zero
    best = (np.inf, 0.0)
    weights[:] = 0.0
    # corners
    for i in range(n):
        p = corner(points, i)
        square = dd.dot(p, p)
        if newest in (-1, i) and dd.is_less(square, best):
            best = square
            best_point = p
            weights[:] = 0.0
            weights[i] = 1.0
    # edges
    for i in range(n):
        for j in range(i + 1, n):
            if newest not in (-1, i, j):
                continue
            p, q = corner(points, i), corner(points, j)
            e = dd.difference(q, p)
            total = dd.dot(e, e)
            of_p, of_q = dd.dot(q, e), dd.negative(dd.dot(p, e))
            if not dd.is_positive(total):
                continue
            lengths = (total[0] * dd.dot(q, q)[0], total[0] * dd.dot(p, p)[0])
            if not (_shares(of_p, lengths[0], newest) and _shares(of_q, lengths[1], newest)):
                continue
            turned = dd.cross(e, dd.cross(p if of_p[0] >= of_q[0] else q, e))
            foot = (dd.divide(turned[0], total), dd.divide(turned[1], total), dd.divide(turned[2], total))
            square = dd.dot(foot, foot)
            if dd.is_less(square, best):
                best = square
                best_point = foot
                weights[:] = 0.0
                weights[i], weights[j] = max(of_p[0] / total[0], LEAST), max(of_q[0] / total[0], LEAST)
    # faces
    for skipped in range(4):
        i = 0 if skipped > 0 else 1
        j = 1 if skipped > 1 else 2
        k = 2 if skipped > 2 else 3
        if k >= n or newest not in (-1, i, j, k):
            continue
        p, q, r = corner(points, i), corner(points, j), corner(points, k)
        u, v = dd.difference(q, p), dd.difference(r, p)
        normal = dd.cross(u, v)
        total = dd.dot(normal, normal)
        if not total[0] > DEGENERATE**2 * dd.dot(u, u)[0] * dd.dot(v, v)[0]:
            continue
        of_p, of_q, of_r = (
            dd.dot(normal, dd.cross(q, r)),
            dd.dot(normal, dd.cross(r, p)),
            dd.dot(normal, dd.cross(p, q)),
        )
        pp, qq, rr = total[0] * dd.dot(p, p)[0], dd.dot(q, q)[0], dd.dot(r, r)[0]
        if not (_shares(of_p, total[0] * qq * rr, newest) and _shares(of_q, pp * rr, newest)):
            continue
        if not _shares(of_r, pp * qq, newest):
            continue
        foot = dd.scale(dd.divide(dd.dot(normal, p), total), normal)
        square = dd.dot(foot, foot)
        if dd.is_less(square, best):
            best = square
            best_point = foot
            weights[:] = 0.0
            weights[i], weights[j] = max(of_p[0] / total[0], LEAST), max(of_q[0] / total[0], LEAST)
            weights[k] = max(of_r[0] / total[0], LEAST)
    return inside, best_point, best


@leaf_kernel
def _shares(share: dd.Pair, square: float, newest: int) -> bool:
    """Return whether a corner has a part in a feature's foot, `square` being that of the factors of its share."""
    return dd.is_positive(share) or (newest >= 0 and share[0] * share[0] <= SHARED * square)


@leaf_kernel
def residual(points: Floats, n: int, weights: Floats) -> float:
    """Return how far the weighted mean of the points is from the origin."""
    x, y, z, total = 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        x += weights[k] * points[k, 0, 0]
        y += weights[k] * points[k, 1, 0]
        z += weights[k] * points[k, 2, 0]
        total += weights[k]
    return math.sqrt(x * x + y * y + z * z) / total


@leaf_kernel
def _contains_origin(points: Floats, size: float, weights: Floats) -> bool:
    """Return whether the origin is inside the tetrahedron beyond the rounding error of 2^-100; if so, its weights."""
    p, q, r, s = corner(points, 0), corner(points, 1), corner(points, 2), corner(points, 3)
    pq, rs = dd.cross(p, q), dd.cross(r, s)
    a, b = dd.dot(q, rs), dd.negative(dd.dot(p, rs))
    c, d = dd.dot(s, pq), dd.negative(dd.dot(r, pq))
    volume = a[0] + b[0] + c[0] + d[0]
    sign = -1.0 if volume < 0.0 else 1.0
    limit = 2.0**-96 * size * size * size
    weights[0], weights[1], weights[2], weights[3] = sign * a[0], sign * b[0], sign * c[0], sign * d[0]
    return min(sign * a[0], sign * b[0], sign * c[0], sign * d[0]) > limit
