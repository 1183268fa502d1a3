"""How a triangle can be summed by a rule, and how wrong that may be; the folder's page derives the bounds."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.sensing.capacitive.placed_plate import PlacedPlate, Triple, beyond_borders, faces_centre, region_of
from replay.sensing.capacitive.tree.cluster_bounds import CLOSEST
from replay.sensing.capacitive.tree.lanes import corner_in_lanes, load, padded
from replay.sensing.capacitive.tree.registers import (
    ALLOWED,
    ERROR,
    FIRST_RULE,
    FOUND,
    LANES,
    LEAST,
    NO_RULE,
    PART_ABOVE,
    POINTS_1,
    POINTS_3,
    POINTS_7,
    POINTS_16,
    REACH,
    REGION,
    RULE_FOUND,
    SHIFT,
    SIZE,
    SPREAD,
    TRIANGLE_COLUMNS,
    VERDICT,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


_RULE_3, _RULE_7, _RULE_16 = 0.12, 0.065, 0.005
"""Error constants of the point rules. Not proven: about twice the largest that a search over all shapes (slivers too),
directions, regions and h/r up to 2/3 climbs to, 0.062, 0.033 and 0.0022 (test_point_rules)."""


@leaf_kernel
def judge_triangles(triangles: Floats, which: Ints, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    """Write what is found of the rows which[:count] of triangles, verdict and cheapest rule to the lanes.

    FIRST_RULE and ALLOWED are given there. A triangle that may touch the plate is always OPEN. What one point sums is
    found as SHIFT.
    """
    load(triangles, TRIANGLE_COLUMNS, which, count, lanes, 0)
    judge_loaded(count, plate, lanes)


@inlined_kernel
def judge_loaded(count: int, plate: PlacedPlate, lanes: Floats) -> None:
    """Do what `judge_triangles` does, of rows that are in the lanes."""
    T, half_x, half_y, both, facing = plate.T_plate_body, plate.half_x, plate.half_y, plate.both, plate.facing
    rounding = plate.rounding
    for i in range(padded(count)):
        a = corner_in_lanes(T, rounding, lanes, 0, i)
        b = corner_in_lanes(T, rounding, lanes, 1, i)
        c = corner_in_lanes(T, rounding, lanes, 2, i)
        h, spread, area = lanes[REACH * LANES + i], lanes[SPREAD * LANES + i], lanes[SIZE * LANES + i]
        first, allowed = lanes[FIRST_RULE * LANES + i], lanes[ALLOWED * LANES + i]
        low, high = min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        x, y, z = (a[0] + b[0] + c[0]) / 3.0, (a[1] + b[1] + c[1]) / 3.0, (a[2] + b[2] + c[2]) / 3.0
        u, v = beyond_borders(x, y, half_x, half_y)
        square = u * u + v * v + z * z
        r = math.sqrt(square)
        # the cheapest rule, with what lies over the borders
        inverse, nearest, farthest = 1.0 / r, 1.0 / (r - h), 1.0 / (r + h)
        most, least = nearest * nearest * nearest, farthest * farthest * farthest
        shift_x, doubt_x = over_borders(a[0], b[0], c[0], x, half_x, most, least)
        shift_y, doubt_y = over_borders(a[1], b[1], c[1], y, half_y, most, least)
        rule, error = cheapest_rule(first, area, spread, h, r, area * (doubt_x + doubt_y), allowed)
        shift = area * (shift_x + shift_y)
        shift = area * inverse if rule == POINTS_1 else shift
        at_least = area / math.sqrt(square + spread)
        # across z = 0 only the part above counts
        crossing = not both and low <= 0.0
        value, wrong = part_above(a, b, c, area, spread, h, half_x, half_y)
        far_enough = first == POINTS_1 and low < 0.0 < high and wrong <= allowed
        kept = 1.0 if rule != NO_RULE and r > CLOSEST * h else 0.0
        kept = (1.0 if far_enough else 0.0) if crossing else kept
        # one that does not face the plate may still touch it
        averted = facing and r > CLOSEST * h and not faces_centre(a, b, c, rounding)
        kept = -1.0 if averted or (not both and high < 0.0) else kept
        lanes[(FOUND + REGION) * LANES + i] = region_of(x, y, half_x, half_y)
        lanes[(FOUND + ERROR) * LANES + i] = wrong if crossing else error
        lanes[(FOUND + SHIFT) * LANES + i] = value if crossing else shift
        lanes[(FOUND + LEAST) * LANES + i] = max(0.0, value - wrong) if crossing else at_least
        lanes[RULE_FOUND * LANES + i] = PART_ABOVE if crossing else rule
        lanes[VERDICT * LANES + i] = kept


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
    rule, error = NO_RULE, math.inf
    # no early return: this is for lanes, too
    for candidate in (POINTS_16, POINTS_7, POINTS_3, POINTS_1):
        bound = rule_error(candidate, area, spread, h, r, doubt)
        good = candidate >= first and bound <= allowed
        rule, error = candidate if good else rule, bound if good else error
    return rule, error


@inlined_kernel
def over_borders(
    a: float, b: float, c: float, centroid: float, half: float, most: float, least: float
) -> tuple[float, float]:
    """Return how much larger the mean of 1/dist is than that of the centroid's region [1/m], and how wrong that may be.

    The corners' coordinates across the borders are a, b and c. The depth w over a border changes 1/dist by w^2/2 times
    `least` to `most` [1/m^3]: it becomes less outside, more between the borders. A piece that also reaches over the
    opposite border gains less than w says.
    """
    # as if the centroid were on the positive side
    side = math.copysign(1.0, centroid)
    a, b, c = side * a, side * b, side * c
    inside = abs(centroid) <= half
    out = 1.0 if inside else -1.0
    near = _mean_square(out * (a - half), out * (b - half), out * (c - half))
    opposite = _mean_square(-a - half, -b - half, -c - half)
    least = 0.0 if not inside and near > 0.0 and opposite > 0.0 else least
    square = near + opposite if inside else near
    return -0.25 * out * square * (most + least), 0.25 * square * (most - least)


@inlined_kernel
def _mean_square(p: float, q: float, s: float) -> float:
    """Return the mean of max(d, 0)^2 over a triangle on which d is linear, and p, q and s at the corners."""
    low, high = min(p, q, s), max(p, q, s)
    middle = max(min(p, q), min(max(p, q), s))
    # the corner that is alone on its side of 0, and what the small triangle that it cuts off brings
    tip, other = high if middle <= 0.0 else low, low if middle <= 0.0 else high
    small = tip * tip / 6.0 * (tip / (tip - middle)) * (tip / (tip - other))
    whole = (p * p + q * q + s * s + (p + q + s) * (p + q + s)) / 12.0
    mixed = small if middle <= 0.0 else max(whole - small, 0.0)
    return 0.0 if high <= 0.0 else (whole if low >= 0.0 else mixed)


@inlined_kernel
def part_above(
    a: Triple, b: Triple, c: Triple, area: float, spread: float, h: float, half_x: float, half_y: float
) -> tuple[float, float]:
    """Return the integral over the part above z = 0 of a triangle that crosses it, by one point, and its bound [m].

    About its own centroid the part's integral of |d|^2 is less than that of the triangle about the triangle's. inf is
    the bound of what is too near.
    """
    # the corner that is alone on its side comes first
    above_a, above_b, above_c = a[2] > 0.0, b[2] > 0.0, c[2] > 0.0
    second, third = above_a == above_c and above_a != above_b, above_a == above_b and above_a != above_c
    tx, ty, tz = b[0] if second else a[0], b[1] if second else a[1], b[2] if second else a[2]
    tx, ty, tz = c[0] if third else tx, c[1] if third else ty, c[2] if third else tz
    px, py, pz = a[0] if second else b[0], a[1] if second else b[1], a[2] if second else b[2]
    qx, qy, qz = a[0] if third else c[0], a[1] if third else c[1], a[2] if third else c[2]
    px, py, pz, qx, qy, qz = px - tx, py - ty, pz - tz, qx - tx, qy - ty, qz - tz
    s, t = -tz / pz, -tz / qz
    part = s * t
    # the tip's centroid from the tip, and that of the rest
    x, y, z = (s * px + t * qx) / 3.0, (s * py + t * qy) / 3.0, (s * pz + t * qz) / 3.0
    rest = 1.0 - part
    tip_above = tz > 0.0
    x = tx + (x if tip_above else ((px + qx) / 3.0 - part * x) / rest)
    y = ty + (y if tip_above else ((py + qy) / 3.0 - part * y) / rest)
    z = tz + (z if tip_above else ((pz + qz) / 3.0 - part * z) / rest)
    u, v = beyond_borders(x, y, half_x, half_y)
    r = math.sqrt(u * u + v * v + z * z)
    nearest = 1.0 / (r - 2.0 * h)
    bound = area * spread * nearest * nearest * nearest
    return area * (part if tip_above else rest) / r, bound if r > 2.0 * CLOSEST * h else math.inf
