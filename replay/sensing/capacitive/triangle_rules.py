"""One triangle by point rules, at the least cost that an error allows; the bounds are derived in `tree_sum`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.gauss import TRIANGLE_7, TRIANGLE_16
from replay.numerics.jit import kernel, leaf_kernel
from replay.sensing.capacitive.cluster_bounds import CLOSEST
from replay.sensing.capacitive.exact import integral_over_triangle

Floats = NDArray[np.float64]

POINTS_1, POINTS_3, POINTS_7, POINTS_16, NO_RULE, PART_ABOVE = range(6)
"""What a triangle is summed by: points; or by one point, the part of it that is above z = 0."""

_RULE_3, _RULE_7, _RULE_16 = 0.12, 0.065, 0.005
"""Error constants of the point rules: about twice the largest that a search over all shapes (slivers too), directions,
regions and h/r up to 2/3 climbs to, 0.062, 0.033 and 0.0022 (test_point_rules)."""

RULE_POINTS = 16
"""Most points of a rule."""

PIECES = 32
"""Most pieces of one triangle: each of five planes replaces a piece by at most three, one after the other, and each of
_QUARTERINGS replaces one by four."""

_QUARTERINGS = 3
"""Pieces of a triangle that are cut in four, when they are too near for a rule, before the closed form is called for."""


@leaf_kernel
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


@leaf_kernel
def cheapest_rule(
    first: int, area: float, spread: float, h: float, r: float, doubt: float, allowed: float
) -> tuple[int, float]:
    """Return the cheapest rule, from `first` on, whose error is allowed, and that error; or NO_RULE and inf."""
    for rule in range(first, NO_RULE):
        error = rule_error(rule, area, spread, h, r, doubt)
        if error <= allowed:
            return rule, error
    return NO_RULE, math.inf


@leaf_kernel
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


@leaf_kernel
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
        return high * high / 6.0 * (high / (high - middle)) * (high / (high - low))
    square = (p * p + q * q + s * s + (p + q + s) ** 2) / 12.0
    if low < 0.0:
        square -= low * low / 6.0 * (low / (low - middle)) * (low / (low - high))
    return max(square, 0.0)


@leaf_kernel
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


@leaf_kernel
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


@kernel
def triangle_within(
    pieces: Floats,
    area: float,
    half_x: float,
    half_y: float,
    both: bool,
    allowed: float,
    whole: Floats,
    scratch: Floats,
    terms: Floats,
) -> tuple[float, float]:
    """Return the integral over a triangle in the plate's frame and its error bound [m], at most `allowed`.

    The triangle is cut by z = 0 and by borders in its way, and point rules are tried on the pieces, before the closed
    form of the whole is called for. `pieces` (PIECES, 4, 3) holds the triangle's corners, then the pieces' corners and,
    last, their areas.
    """
    for k in range(3):
        for axis in range(3):
            whole[k, axis] = pieces[0, k, axis]
    pieces[0, 3, 0] = area
    size = 1
    if not both and min(pieces[0, 0, 2], pieces[0, 1, 2], pieces[0, 2, 2]) < 0.0:
        size = _cut(pieces, 1, 2, half_x, half_y)
    share = allowed / area if area > 0.0 else 0.0
    total, spent = 0.0, 0.0
    quartered = 0
    while size > 0:
        last = size - 1
        part = pieces[last, 3, 0]
        x = (pieces[last, 0, 0] + pieces[last, 1, 0] + pieces[last, 2, 0]) / 3.0
        y = (pieces[last, 0, 1] + pieces[last, 1, 1] + pieces[last, 2, 1]) / 3.0
        z = (pieces[last, 0, 2] + pieces[last, 1, 2] + pieces[last, 2, 2]) / 3.0
        u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
        r = math.sqrt(u * u + v * v + z * z)
        squares, largest = 0.0, 0.0
        for k in range(3):
            dx, dy, dz = pieces[last, k, 0] - x, pieces[last, k, 1] - y, pieces[last, k, 2] - z
            square = dx * dx + dy * dy + dz * dz
            squares += square
            largest = max(largest, square)
        h = math.sqrt(largest)
        if r <= CLOSEST * h:
            if r <= 0.75 * h or quartered == _QUARTERINGS:
                break
            quartered += 1
            size = _quarter(pieces, size)
            continue
        shift, doubt, by_x = borders(pieces, last, part, x, y, h, r, half_x, half_y)
        rule, error = cheapest_rule(POINTS_1, part, squares / 12.0, h, r, doubt, share * part)
        if rule == POINTS_1:
            total += part / r
        elif rule != NO_RULE:
            total += part * mean_by_rule(rule, pieces, last, x, y, half_x, half_y, terms) + shift
        elif doubt > 0.0 and rule_error(POINTS_16, part, squares / 12.0, h, r, 0.0) <= share * part:
            size = _cut(pieces, size, 0 if 2.0 * by_x >= doubt else 1, half_x, half_y)
            continue
        elif quartered < _QUARTERINGS:
            quartered += 1
            size = _quarter(pieces, size)
            continue
        else:
            break
        spent += error
        size -= 1
    if size == 0:
        return total, spent
    return integral_over_triangle(whole, area, half_x, half_y, both, scratch), 0.0


@leaf_kernel
def part_above(
    pieces: Floats, area: float, spread: float, h: float, half_x: float, half_y: float
) -> tuple[float, float]:
    """Return the integral over the part above z = 0 of a triangle that crosses it, by one point, and its error bound [m].

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


@leaf_kernel
def _cut(pieces: Floats, size: int, axis: int, half_x: float, half_y: float) -> int:
    """Replace the last piece by its parts on either side of a border across an axis, or by those above z = 0.

    Returns the new number of pieces.
    """
    last = size - 1
    only_beyond = axis == 2
    border = 0.0 if only_beyond else (half_x if axis == 0 else half_y)
    low, high = (
        min(pieces[last, 0, axis], pieces[last, 1, axis], pieces[last, 2, axis]),
        max(pieces[last, 0, axis], pieces[last, 1, axis], pieces[last, 2, axis]),
    )
    if not low < border < high:
        border = -border
    beyond_0, beyond_1, beyond_2 = (
        pieces[last, 0, axis] > border,
        pieces[last, 1, axis] > border,
        pieces[last, 2, axis] > border,
    )
    alone = 0 if beyond_1 == beyond_2 else (1 if beyond_0 == beyond_2 else 2)
    area = pieces[last, 3, 0]
    ax, ay, az = pieces[last, alone, 0], pieces[last, alone, 1], pieces[last, alone, 2]
    j, k = (alone + 1) % 3, (alone + 2) % 3
    bx, by, bz = pieces[last, j, 0], pieces[last, j, 1], pieces[last, j, 2]
    cx, cy, cz = pieces[last, k, 0], pieces[last, k, 1], pieces[last, k, 2]
    is_beyond = pieces[last, alone, axis] > border
    gap = pieces[last, alone, axis] - border
    s, t = (
        gap / (pieces[last, alone, axis] - pieces[last, j, axis]),
        gap / (pieces[last, alone, axis] - pieces[last, k, axis]),
    )
    p = (ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az))
    q = (ax + t * (cx - ax), ay + t * (cy - ay), az + t * (cz - az))
    p = (border if axis == 0 else p[0], border if axis == 1 else p[1], border if axis == 2 else p[2])
    q = (border if axis == 0 else q[0], border if axis == 1 else q[1], border if axis == 2 else q[2])
    size -= 1
    for part in range(3):
        if only_beyond and is_beyond != (part == 0):
            continue
        first = (ax, ay, az) if part == 0 else (bx, by, bz)
        second = p if part == 0 else ((cx, cy, cz) if part == 1 else q)
        third = p if part == 2 else q
        for k in range(3):
            pieces[size, 0, k], pieces[size, 1, k], pieces[size, 2, k] = first[k], second[k], third[k]
        pieces[size, 3, 0] = area * (s * t if part == 0 else (1.0 - t if part == 1 else t * (1.0 - s)))
        size += 1
    return size




@leaf_kernel
def _quarter(pieces: Floats, size: int) -> int:
    """Replace the last piece by four, cut from the middles of its edges; return the new number of pieces."""
    last = size - 1
    for axis in range(3):
        a, b, c = pieces[last, 0, axis], pieces[last, 1, axis], pieces[last, 2, axis]
        d, e, f = 0.5 * (b + c), 0.5 * (c + a), 0.5 * (a + b)
        pieces[last, 1, axis], pieces[last, 2, axis] = f, e
        pieces[size, 0, axis], pieces[size, 1, axis], pieces[size, 2, axis] = f, b, d
        pieces[size + 1, 0, axis], pieces[size + 1, 1, axis], pieces[size + 1, 2, axis] = e, d, c
        pieces[size + 2, 0, axis], pieces[size + 2, 1, axis], pieces[size + 2, 2, axis] = d, e, f
    area = 0.25 * pieces[last, 3, 0]
    for k in range(4):
        pieces[last + k, 3, 0] = area
    return size + 3
