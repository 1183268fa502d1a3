"""The smallest ball around points: grown from a support set of at most four points.

The smallest ball is the smallest ball of some at most four of the points, its support. From a support, the point
furthest from its centre is added, and the smallest ball of these at most five points is found among the circumcentres
of their subsets: it is the one from which the furthest of the five is nearest. The radius grows each time, so no
support comes back (Gärtner 1999 pivots alike). A candidate is judged by the distances it leaves, never by tolerance, so
that a badly conditioned subset cannot win.
"""

from __future__ import annotations

import numpy as np
from numba import float64

from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel

_MOST_PIVOTS = 1000  # about 10 are needed; rounding cannot make it run longer than this


@entry(float64[:, ::1])
@kernel
def smallest_ball_centre(points: Floats) -> Floats:
    """Return the centre (3,) of the smallest ball around points (n, 3), n >= 1, of extent about 1 about the origin."""
    support = np.empty((5, 3))
    chosen = np.empty((4, 3))
    trial = np.empty((4, 3))
    candidate, best_candidate = np.empty(3), np.empty(3)
    centre: Floats = points[0].copy()
    support[0] = points[0]
    count = 1
    result: Floats = points[0].copy()
    reached, grown = np.inf, -1.0
    for _ in range(_MOST_PIVOTS):
        furthest, square = 0, -1.0
        for k in range(len(points)):
            distance = _squared(points[k], centre)
            if distance > square:
                furthest, square = k, distance
        if square < reached:
            reached = square
            result[:] = centre
        support[count] = points[furthest]
        count += 1
        least, chosen_count = np.inf, 0
        for subset in range(1 << (count - 1)):  # of the old support; the new point is always in
            size = 0
            for k in range(count - 1):
                if subset >> k & 1 and size < 4:
                    trial[size] = support[k]
                    size += 1
            if size > 3:
                continue
            trial[size] = support[count - 1]
            size += 1
            if not _circumcentre(trial, size, candidate):
                continue
            worst = 0.0
            for k in range(count):
                worst = max(worst, _squared(support[k], candidate))
            if worst < least:
                least, chosen_count = worst, size
                chosen[:size] = trial[:size]
                best_candidate[:] = candidate
        if not least > grown:
            break
        grown = least
        centre[:] = best_candidate
        count = chosen_count
        support[:count] = chosen[:count]
    return result


@kernel
def _squared(a: Floats, b: Floats) -> float:
    x, y, z = a[0] - b[0], a[1] - b[1], a[2] - b[2]
    return x * x + y * y + z * z  # type: ignore[no-any-return]


@kernel
def _circumcentre(points: Floats, count: int, centre: Floats) -> bool:
    """Write the centre of the smallest sphere through 1 to 4 points; False when they do not determine one.

    With a, b, c the other points seen from the first: a / 2; (|a|^2 b x n + |b|^2 n x a) / (2 n.n), n = a x b;
    (|a|^2 b x c + |b|^2 c x a + |c|^2 a x b) / (2 a . b x c).
    """
    if count == 1:
        centre[:] = points[0]
        return True
    ax, ay, az = points[1] - points[0]
    if count == 2:
        centre[0], centre[1], centre[2] = points[0, 0] + 0.5 * ax, points[0, 1] + 0.5 * ay, points[0, 2] + 0.5 * az
        return True
    bx, by, bz = points[2] - points[0]
    nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
    aa, bb = ax * ax + ay * ay + az * az, bx * bx + by * by + bz * bz
    if count == 3:
        x = aa * (by * nz - bz * ny) + bb * (ny * az - nz * ay)
        y = aa * (bz * nx - bx * nz) + bb * (nz * ax - nx * az)
        z = aa * (bx * ny - by * nx) + bb * (nx * ay - ny * ax)
        divisor = 2.0 * (nx * nx + ny * ny + nz * nz)
    else:
        cx, cy, cz = points[3] - points[0]
        cc = cx * cx + cy * cy + cz * cz
        x = aa * (by * cz - bz * cy) + bb * (cy * az - cz * ay) + cc * nx
        y = aa * (bz * cx - bx * cz) + bb * (cz * ax - cx * az) + cc * ny
        z = aa * (bx * cy - by * cx) + bb * (cx * ay - cy * ax) + cc * nz
        divisor = 2.0 * (cx * nx + cy * ny + cz * nz)
    if divisor == 0.0:
        return False
    centre[0], centre[1], centre[2] = points[0, 0] + x / divisor, points[0, 1] + y / divisor, points[0, 2] + z / divisor
    return True
