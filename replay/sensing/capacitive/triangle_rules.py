"""One triangle by point rules, at the least cost that an error allows; the bounds are derived in `tree_sum`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.gauss import TRIANGLE_7, TRIANGLE_16
from replay.numerics.jit import inlined_kernel
from replay.sensing.capacitive.cluster_bounds import CLOSEST

Floats = NDArray[np.float64]

POINTS_1, POINTS_3, POINTS_7, POINTS_16, NO_RULE, PART_ABOVE = range(6)
"""What a triangle is summed by: points; or by one point, the part of it that is above z = 0."""

_RULE_3, _RULE_7, _RULE_16 = 0.12, 0.065, 0.005
"""Error constants of the point rules: about twice the largest that a search over all shapes (slivers too), directions,
regions and h/r up to 2/3 climbs to, 0.062, 0.033 and 0.0022 (test_point_rules)."""

RULE_POINTS = 16
"""Most points of a rule."""


@inlined_kernel
def rule_error(rule: int, area: float, spread: float, h: float, r: float, doubt: float) -> float:
    """Return the error bound [m] of a rule on a triangle of area [m^2], spread [m^2], radius h [m], r [m] away.

    `doubt` is what the borders add, see `borders`; one point does not care where it lies.
    """
    nearest, inverse = 1.0 / (r - h), 1.0 / r
    if rule == POINTS_1:
        return area * spread * nearest * nearest * nearest
    smooth, x = area * spread * nearest * inverse * inverse, h * inverse
    if rule == POINTS_3:
        return _RULE_3 * smooth * x + doubt
    cube = x * x * x
    if rule == POINTS_7:
        return _RULE_7 * smooth * cube * x + doubt
    return _RULE_16 * smooth * cube * cube * x + doubt


@inlined_kernel
def cheapest_rule(
    first: int, area: float, spread: float, h: float, r: float, doubt: float, allowed: float
) -> tuple[int, float]:
    """Return the cheapest rule, from `first` on, whose error is allowed, and that error; or NO_RULE and inf."""
    for rule in range(first, NO_RULE):
        error = rule_error(rule, area, spread, h, r, doubt)
        if error <= allowed:
            return rule, error
    return NO_RULE, math.inf


@inlined_kernel
def _over_borders(
    pieces: Floats, index: int, axis: int, centroid: float, half: float, most: float, least: float
) -> tuple[float, float]:
    """Return how much larger the mean of 1/dist is than that of the centroid's region [1/m], and how wrong that may be.

    The depth w over a border changes 1/dist by w^2/2 times `least` to `most` [1/m^3]: it becomes less outside, more
    between the borders. A piece that also reaches over the opposite border gains less than w says.
    """
    if abs(centroid) <= half:
        square = _mean_square(pieces, index, axis, 1.0, half) + _mean_square(pieces, index, axis, -1.0, half)
        return -0.25 * square * (most + least), 0.25 * square * (most - least)
    sign = -math.copysign(1.0, centroid)
    square = _mean_square(pieces, index, axis, sign, -half)
    if square > 0.0 and _mean_square(pieces, index, axis, sign, half) > 0.0:
        least = 0.0
    return 0.25 * square * (most + least), 0.25 * square * (most - least)


@inlined_kernel
def _mean_square(pieces: Floats, index: int, axis: int, sign: float, border: float) -> float:
    """Return the mean of max(sign x coordinate - border, 0)^2 over a piece."""
    p, q, s = (
        sign * pieces[index, 0, axis] - border,
        sign * pieces[index, 1, axis] - border,
        sign * pieces[index, 2, axis] - border,
    )
    low, high = min(p, q, s), max(p, q, s)
    if high <= 0.0:
        return 0.0
    middle = max(min(p, q), min(max(p, q), s))
    if middle <= 0.0:
        return high * high / 6.0 * (high / (high - middle)) * (high / (high - low))  # type: ignore[no-any-return]
    square = (p * p + q * q + s * s + (p + q + s) ** 2) / 12.0
    if low < 0.0:
        square -= low * low / 6.0 * (low / (low - middle)) * (low / (low - high))
    return max(square, 0.0)  # type: ignore[no-any-return]


@inlined_kernel
def mean_by_rule(
    rule: int,
    pieces: Floats,
    index: int,
    x: float,
    y: float,
    half_x: float,
    half_y: float,
    terms: Floats,
) -> float:
    """Return the mean of 1/dist over a piece by a rule of 3 to 16 points, in the region of its centroid (x, y)."""
    keep_x, keep_y = 1.0 if abs(x) > half_x else 0.0, 1.0 if abs(y) > half_y else 0.0
    shift_x, shift_y = -keep_x * math.copysign(half_x, x), -keep_y * math.copysign(half_y, y)
    ax, ay, az = keep_x * pieces[index, 0, 0] + shift_x, keep_y * pieces[index, 0, 1] + shift_y, pieces[index, 0, 2]
    bx, by, bz = keep_x * pieces[index, 1, 0] + shift_x, keep_y * pieces[index, 1, 1] + shift_y, pieces[index, 1, 2]
    cx, cy, cz = keep_x * pieces[index, 2, 0] + shift_x, keep_y * pieces[index, 2, 1] + shift_y, pieces[index, 2, 2]
    if rule == POINTS_3:
        mx, my, mz = (ax + bx + cx) / 6.0, (ay + by + cy) / 6.0, (az + bz + cz) / 6.0
        ax, ay, az = mx + 0.5 * ax, my + 0.5 * ay, mz + 0.5 * az
        bx, by, bz = mx + 0.5 * bx, my + 0.5 * by, mz + 0.5 * bz
        cx, cy, cz = mx + 0.5 * cx, my + 0.5 * cy, mz + 0.5 * cz
        total = 1.0 / math.sqrt(ax * ax + ay * ay + az * az)
        total += 1.0 / math.sqrt(bx * bx + by * by + bz * bz)
        return (total + 1.0 / math.sqrt(cx * cx + cy * cy + cz * cz)) / 3.0
    points = TRIANGLE_7 if rule == POINTS_7 else TRIANGLE_16
    # no sum in the first loop, so that it is vectorised
    for k in range(points.shape[1]):
        a, b, c = points[0, k], points[1, k], points[2, k]
        px, py, pz = a * ax + b * bx + c * cx, a * ay + b * by + c * cy, a * az + b * bz + c * cz
        terms[k] = points[3, k] / math.sqrt(px * px + py * py + pz * pz)
    total = 0.0
    for k in range(points.shape[1]):
        total += terms[k]
    return total


@inlined_kernel
def borders(
    pieces: Floats, index: int, area: float, x: float, y: float, h: float, r: float, half_x: float, half_y: float
) -> tuple[float, float, float]:
    """Return what the borders do to a piece [m]: the correction, its error, and the part of it that x makes."""
    near_x = abs(abs(x) - half_x) < h or abs(x) + half_x < h
    near_y = abs(abs(y) - half_y) < h or abs(y) + half_y < h
    if not (near_x or near_y):
        return 0.0, 0.0, 0.0
    nearest, farthest = 1.0 / (r - h), 1.0 / (r + h)
    most, least = nearest * nearest * nearest, farthest * farthest * farthest
    shift_x, doubt_x = _over_borders(pieces, index, 0, x, half_x, most, least) if near_x else (0.0, 0.0)
    shift_y, doubt_y = _over_borders(pieces, index, 1, y, half_y, most, least) if near_y else (0.0, 0.0)
    return area * (shift_x + shift_y), area * (doubt_x + doubt_y), area * doubt_x


@inlined_kernel
def part_above(
    pieces: Floats, area: float, spread: float, h: float, half_x: float, half_y: float
) -> tuple[float, float]:
    """Return the integral over the part above z = 0 of a triangle that crosses it, by one point, and its bound [m].

    About its own centroid the part's integral of |d|^2 is less than that of the triangle about the triangle's.
    """
    above_0, above_1, above_2 = pieces[0, 0, 2] > 0.0, pieces[0, 1, 2] > 0.0, pieces[0, 2, 2] > 0.0
    alone = 0 if above_1 == above_2 else (1 if above_0 == above_2 else 2)
    j, k = (alone + 1) % 3, (alone + 2) % 3
    ax, ay, az = pieces[0, alone, 0], pieces[0, alone, 1], pieces[0, alone, 2]
    bx, by, bz = pieces[0, j, 0] - ax, pieces[0, j, 1] - ay, pieces[0, j, 2] - az
    cx, cy, cz = pieces[0, k, 0] - ax, pieces[0, k, 1] - ay, pieces[0, k, 2] - az
    s, t = -az / bz, -az / cz
    part = s * t
    x, y, z = ax + (s * bx + t * cx) / 3.0, ay + (s * by + t * cy) / 3.0, az + (s * bz + t * cz) / 3.0
    if az < 0.0:
        rest = 1.0 - part
        x = (ax + (bx + cx) / 3.0 - part * x) / rest
        y = (ay + (by + cy) / 3.0 - part * y) / rest
        z = (az + (bz + cz) / 3.0 - part * z) / rest
        part = rest
    u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
    r = math.sqrt(u * u + v * v + z * z)
    if r <= 2.0 * CLOSEST * h:
        return 0.0, math.inf
    nearest = 1.0 / (r - 2.0 * h)
    return area * part / r, area * spread * nearest * nearest * nearest
