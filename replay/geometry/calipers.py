"""The smallest box about a given axis, by rotating calipers.

About a fixed axis a box is as large as the rectangle around the points' projection, and the smallest rectangle has a
side along an edge of the projection's convex hull (Freeman and Shapira 1975).
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel

_MANY = 1000  # points from which those inside are left out first
_INSIDE = 1e-12  # of points of extent 1: those deeper inside are on no hull that rounding gives
_NOISE = 1e-14  # of points of extent 1: edges shorter than this have no direction


@entry(float64[:, ::1], float64[::1], float64[:, ::1])
@kernel
def turn_about(points: Floats, axis: Floats, axes: Floats) -> float:
    """Write the axes of the smallest box that has a side along a unit axis, and return its volume.

    The first row of axes is the axis; where the projection is a point, the others are any two.

    Args:
        points: (n, 3) of extent about 1.
        axis: (3,) unit vector.
        axes: (3, 3) written, right-handed rows.
    """
    n = len(points)
    least = 0
    for i in range(1, 3):
        if abs(axis[i]) < abs(axis[least]):
            least = i
    ax, ay, az = axis[0], axis[1], axis[2]
    ex, ey, ez = -axis[least] * ax, -axis[least] * ay, -axis[least] * az
    ex, ey, ez = ex + (least == 0), ey + (least == 1), ez + (least == 2)
    length = math.sqrt(ex * ex + ey * ey + ez * ez)
    ex, ey, ez = ex / length, ey / length, ez / length
    fx, fy, fz = ay * ez - az * ey, az * ex - ax * ez, ax * ey - ay * ex
    x, y = np.empty(n), np.empty(n)
    low, high = np.inf, -np.inf
    for k in range(n):
        px, py, pz = points[k, 0], points[k, 1], points[k, 2]
        x[k], y[k] = ex * px + ey * py + ez * pz, fx * px + fy * py + fz * pz
        height = ax * px + ay * py + az * pz
        low, high = min(low, height), max(high, height)
    hx, hy = _hull_of_projection(x, y)
    area, c, s = _smallest_rectangle(hx, hy)
    axes[0, 0], axes[0, 1], axes[0, 2] = ax, ay, az
    axes[1, 0], axes[1, 1], axes[1, 2] = c * ex + s * fx, c * ey + s * fy, c * ez + s * fz
    axes[2, 0], axes[2, 1], axes[2, 2] = c * fx - s * ex, c * fy - s * ey, c * fz - s * ez
    return area * (high - low)


@kernel
def _hull_of_projection(x: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Return the hull of points in the plane, counter-clockwise (Andrew's monotone chain)."""
    if len(x) > _MANY:
        outer = _not_inside(x, y)
        x, y = x[outer], y[outer]
    n = len(x)
    order = np.argsort(x, kind="mergesort")
    for k in range(1, n):  # equal x by y; few are equal, so this is short
        at = k
        while at > 0 and x[order[at]] == x[order[at - 1]] and y[order[at]] < y[order[at - 1]]:
            order[at], order[at - 1] = order[at - 1], order[at]
            at -= 1
    chain = np.empty(2 * n + 1, np.int64)
    size = 0
    for side in range(2):
        start = size
        for step in range(n):
            point = order[step] if side == 0 else order[n - 1 - step]
            while size >= start + 2:
                a, b = chain[size - 2], chain[size - 1]
                if (x[b] - x[a]) * (y[point] - y[a]) - (y[b] - y[a]) * (x[point] - x[a]) > 0.0:
                    break
                size -= 1
            chain[size] = point
            size += 1
        size -= 1  # the last of one side is the first of the other
    size = max(size, 1)
    return x[chain[:size]], y[chain[:size]]


@kernel
def _not_inside(x: Floats, y: Floats) -> Integers:
    """Return which points may be on the hull: those that are not between a roof and a floor of others."""
    n, buckets = len(x), int(math.sqrt(len(x)))
    low, width = x.min(), (x.max() - x.min()) / buckets
    scale = 1.0 / max(width, _INSIDE)
    every = np.arange(n)
    if not width > _INSIDE:
        return every
    bucket = np.empty(n, np.int64)
    highest, lowest = np.full(buckets, -1, np.int64), np.full(buckets, -1, np.int64)
    for k in range(n):
        b = min(int((x[k] - low) * scale), buckets - 1)
        bucket[k] = b
        if highest[b] < 0 or y[k] > y[highest[b]]:
            highest[b] = k
        if lowest[b] < 0 or y[k] < y[lowest[b]]:
            lowest[b] = k
    roof, floor = _roof(x, y, highest, low, width, 1.0), _roof(x, y, lowest, low, width, -1.0)
    count = 0
    for k in range(n):
        b = bucket[k]
        if not (y[k] < roof[b] - _INSIDE and -y[k] < floor[b] - _INSIDE):
            every[count] = k
            count += 1
    return every[:count]


@kernel
def _roof(x: Floats, y: Floats, highest: Integers, low: float, width: float, sign: float) -> Floats:
    """Return how high the hull reaches at least in each bucket, with y times sign; -inf where that is not known.

    Buckets are taken a little wider than they are, for points that rounding has put into their neighbour.
    """
    chain = np.empty(len(highest), np.int64)
    size = 0
    for point in highest:
        if point < 0:
            continue
        while size >= 2:
            a, b = chain[size - 2], chain[size - 1]
            if sign * ((x[b] - x[a]) * (y[point] - y[a]) - (y[b] - y[a]) * (x[point] - x[a])) < 0.0:
                break
            size -= 1
        chain[size] = point
        size += 1
    result = np.full(len(highest), -np.inf)
    at = 0
    for b in range(len(highest)):
        left, right = low + (b - 0.01) * width, low + (b + 1.01) * width
        if left < x[chain[0]] or right > x[chain[size - 1]]:
            continue
        while x[chain[at + 1]] < left:
            at += 1
        after = at
        while x[chain[after + 1]] < right:
            after += 1
        first, last = (
            _height(x, y, chain[at], chain[at + 1], left),
            _height(x, y, chain[after], chain[after + 1], right),
        )
        result[b] = min(sign * first, sign * last)
    return result


@kernel
def _height(x: Floats, y: Floats, a: int, b: int, at: float) -> float:
    """Return how high the line from point a to b is."""
    part = min(max((at - x[a]) / (x[b] - x[a]), 0.0), 1.0)
    return (1.0 - part) * y[a] + part * y[b]  # type: ignore[no-any-return]


@kernel
def _smallest_rectangle(x: Floats, y: Floats) -> tuple[float, float, float]:
    """Return (area, c, s): the rectangle along (c, s) and (-s, c) around a convex polygon, counter-clockwise.

    While the direction turns with the edges, the furthest points ahead, left and behind only move on.
    """
    n = len(x)
    best, best_c, best_s = np.inf, 1.0, 0.0
    ahead, left, behind = 0, 0, 0
    started = False
    for k in range(n):
        after = (k + 1) % n
        c, s = x[after] - x[k], y[after] - y[k]
        length = math.sqrt(c * c + s * s)
        if not length > _NOISE:
            continue
        c, s = c / length, s / length
        if not started:
            started = True
            for j in range(n):
                if c * x[j] + s * y[j] > c * x[ahead] + s * y[ahead]:
                    ahead = j
                if c * y[j] - s * x[j] > c * y[left] - s * x[left]:
                    left = j
                if c * x[j] + s * y[j] < c * x[behind] + s * y[behind]:
                    behind = j
        else:
            ahead = _move_on(x, y, c, s, ahead)
            left = _move_on(x, y, -s, c, left)
            behind = _move_on(x, y, -c, -s, behind)
        width = c * (x[ahead] - x[behind]) + s * (y[ahead] - y[behind])
        area = width * (c * (y[left] - y[k]) - s * (x[left] - x[k]))
        if area < best:
            best, best_c, best_s = area, c, s
    return (best if started else 0.0), best_c, best_s


@kernel
def _move_on(x: Floats, y: Floats, c: float, s: float, at: int) -> int:
    """Return the furthest point along (c, s), from `at` onwards; a step back by noise does not stop it."""
    n = len(x)
    best = at
    value = c * x[at] + s * y[at]
    for step in range(1, n):
        k = (at + step) % n
        here = c * x[k] + s * y[k]
        if here < value - _NOISE:
            break
        if here > value:
            best, value = k, here
    return best
