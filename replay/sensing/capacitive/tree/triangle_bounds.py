"""How a triangle can be summed by a rule, and how wrong that may be; the folder's page derives the bounds."""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.triples import Triple
from replay.sensing.capacitive.placed_plate import PlacedPlate, beyond_borders, faces_centre, region_of
from replay.sensing.capacitive.tree.cluster_bounds import CLOSEST
from replay.sensing.capacitive.tree.lanes import corner_in_lanes, load, padded
from replay.sensing.capacitive.tree.registers import (
    ABOVE,
    ALLOWED,
    ERROR,
    FIRST_RULE,
    FOUND,
    LANES,
    LEAST,
    NO_RULE,
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

Pair = tuple[float, float]


_THIRD = 1.0 / 3.0

_RULE_3, _RULE_7, _RULE_16 = 0.12, 0.065, 0.005
"""Error constants of the point rules. Not proven: about twice the largest that a search over all shapes (slivers too),
directions, regions and h/r up to 2/3 climbs to, 0.062, 0.033 and 0.0022 (test_point_rules)."""


@leaf_kernel
def judge_triangles(triangles: Floats, which: Integers, count: int, plate: PlacedPlate, lanes: Floats) -> None:
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
        x, y, z = (a[0] + b[0] + c[0]) * _THIRD, (a[1] + b[1] + c[1]) * _THIRD, (a[2] + b[2] + c[2]) * _THIRD
        u, v = beyond_borders(x, y, half_x, half_y)
        r = math.sqrt(u * u + v * v + z * z)
        # the cheapest rule, with what lies over the borders
        both_inverse = 1.0 / (r * (r - h))
        inverse, nearest, farthest = (r - h) * both_inverse, r * both_inverse, 1.0 / (r + h)
        most, least = nearest * nearest * nearest, farthest * farthest * farthest
        borders, doubt, across = over_borders(a, b, c, (x, y), (half_x, half_y), most, least)
        rule, error = cheapest_rule(first, area, spread, h, (inverse, nearest), area * doubt, allowed)
        shift = area * inverse if rule == POINTS_1 else area * borders
        # 1/sqrt(1 + t) >= 1 - t/2
        at_least = area * max(farthest, inverse * (1.0 - 0.5 * spread * inverse * inverse))
        # across z = 0 only the part above counts
        crossing = not both and low <= 0.0
        value, wrong, weight = part_above(a, b, c, area, spread, h, half_x, half_y)
        # the small triangle is within the large one, and no corner is farther from its centroid than 4/3 h
        small = (nearest, 1.0 / (r - 7.0 * _THIRD * h))
        several = across == 0.0 and r > 3.0 * h
        above, error_above = cheapest_rule_above(
            first, area, spread, h, (inverse, nearest), small, wrong, several, allowed
        )
        rule, error = above if crossing else rule, error_above if crossing else error
        fits = rule != NO_RULE and (low < 0.0 < high if crossing else r > CLOSEST * h)
        # one that does not face the plate may still touch it
        averted = facing and r > CLOSEST * h and not faces_centre(a, b, c, rounding)
        kept = -1.0 if averted or (not both and high < 0.0) else (1.0 if fits else 0.0)
        value = value if rule == POINTS_1 else 0.0
        lanes[(FOUND + REGION) * LANES + i] = region_of(x, y, half_x, half_y)
        lanes[(FOUND + ERROR) * LANES + i] = error
        lanes[(FOUND + SHIFT) * LANES + i] = value if crossing else shift
        lanes[(FOUND + LEAST) * LANES + i] = max(0.0, area * weight * farthest) if crossing else at_least
        lanes[RULE_FOUND * LANES + i] = ABOVE + rule if crossing else rule
        lanes[VERDICT * LANES + i] = kept


@inlined_kernel
def rule_error(rule: int, area: float, spread: float, h: float, inverses: tuple[float, float], doubt: float) -> float:
    """Return the error bound [m] of a rule on a triangle of area [m^2], spread [m^2] and radius h [m].

    `inverses` are 1/r and 1/(r - h) [1/m]; `doubt` is what the borders add [m], see `over_borders`; one point does not
    care where it lies.
    """
    inverse, nearest = inverses
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
    first: float, area: float, spread: float, h: float, inverses: tuple[float, float], doubt: float, allowed: float
) -> tuple[float, float]:
    """Return the cheapest rule, from `first` on, whose error is allowed, and that error; or NO_RULE and inf.

    Rules are floats here, as lanes are.
    """
    rule, error = float(NO_RULE), math.inf
    # no early return: this is for lanes, too
    for candidate in (POINTS_16, POINTS_7, POINTS_3, POINTS_1):
        bound = rule_error(candidate, area, spread, h, inverses, doubt)
        good = candidate >= first and bound <= allowed
        rule, error = float(candidate) if good else rule, bound if good else error
    return rule, error


@inlined_kernel
def cheapest_rule_above(
    first: float,
    area: float,
    spread: float,
    h: float,
    inverses: Pair,
    inverses_of_small: Pair,
    wrong: float,
    several: bool,
    allowed: float,
) -> tuple[float, float]:
    """Return what `cheapest_rule` does, for the part above z = 0: the small triangle that it cuts off, or all but that.

    By one point the part is taken as a whole, with the error bound `wrong` [m]. By more points, if `several`, the small
    triangle is summed, and the large one if that part is below, each with the rule's error.
    """
    rule, error = float(NO_RULE), math.inf
    for candidate in (POINTS_16, POINTS_7, POINTS_3):
        bound = rule_error(candidate, area, spread, h, inverses, 0.0)
        bound += rule_error(candidate, area, spread, 4.0 * _THIRD * h, inverses_of_small, 0.0)
        good = several and candidate >= first and bound <= allowed
        rule, error = float(candidate) if good else rule, bound if good else error
    good = first == POINTS_1 and wrong <= allowed
    return float(POINTS_1) if good else rule, wrong if good else error


@inlined_kernel
def over_borders(
    a: Triple, b: Triple, c: Triple, centroid: Pair, halves: Pair, most: float, least: float
) -> tuple[float, float, float]:
    """Return how much larger the mean of 1/dist is than that of the centroid's region [1/m], and how wrong that may be.

    Last is 0 if nothing lies over a border, else more.

    The corners are a, b and c, in the plate's frame. The depth w over a border changes 1/dist by w^2/2 times `least` to
    `most` [1/m^3]: it becomes less outside, more between the borders. What reaches over the opposite border, too, gains
    or loses less than w says.
    """
    # as if the centroid were on the positive side
    side_x, side_y = math.copysign(1.0, centroid[0]), math.copysign(1.0, centroid[1])
    out_x, out_y = 1.0 if abs(centroid[0]) <= halves[0] else -1.0, 1.0 if abs(centroid[1]) <= halves[1] else -1.0
    ax, bx, cx = side_x * a[0] - halves[0], side_x * b[0] - halves[0], side_x * c[0] - halves[0]
    ay, by, cy = side_y * a[1] - halves[1], side_y * b[1] - halves[1], side_y * c[1] - halves[1]
    whole_x, mixed_x, top_x, bottom_x = _squares(out_x * ax, out_x * bx, out_x * cx)
    whole_y, mixed_y, top_y, bottom_y = _squares(out_y * ay, out_y * by, out_y * cy)
    # the parts beyond the borders of both axes by one division
    inverse = 1.0 / (bottom_x * bottom_y)
    square_x = whole_x + mixed_x * top_x * bottom_y * inverse
    square_y = whole_y + mixed_y * top_y * bottom_x * inverse
    far_x = max(-2.0 * halves[0] - min(ax, bx, cx), 0.0)
    far_y = max(-2.0 * halves[1] - min(ay, by, cy), 0.0)
    square_x, square_y = max(square_x, 0.0) + far_x * far_x, max(square_y, 0.0) + far_y * far_y
    least_x, least_y = least if far_x == 0.0 else 0.0, least if far_y == 0.0 else 0.0
    shift = out_x * square_x * (most + least_x) + out_y * square_y * (most + least_y)
    doubt = square_x * (most - least_x) + square_y * (most - least_y)
    return -0.25 * shift, 0.25 * doubt, square_x + square_y


@inlined_kernel
def _squares(p: float, q: float, s: float) -> tuple[float, float, float, float]:
    """Return the mean of max(d, 0)^2 over a triangle on which d is linear, and p, q and s at the corners.

    It is the first number plus the second times the quotient of the last two: the mean of d^2, or 0, and what the small
    triangle brings that 0 cuts off, added or taken away.
    """
    low, high = min(p, q, s), max(p, q, s)
    middle = max(min(p, q), min(max(p, q), s))
    # the corner that is alone on its side of 0
    tip, other = high if middle <= 0.0 else low, low if middle <= 0.0 else high
    whole = (p * p + q * q + s * s + (p + q + s) * (p + q + s)) * (1.0 / 12.0)
    cut = low < 0.0 < high
    bottom = (tip - middle) * (tip - other) if cut else 1.0
    tip *= tip
    sign = 1.0 if middle <= 0.0 else -1.0
    return whole if low >= 0.0 or middle > 0.0 else 0.0, sign if cut else 0.0, tip * tip * (1.0 / 6.0), bottom


@inlined_kernel
def tip_of(a: Triple, b: Triple, c: Triple) -> tuple[Triple, Triple, Triple, float, float]:
    """Return the corner of a triangle alone on its side of z = 0, the edges from it, and how far they go to z = 0.

    Shares of the edges; their product is that of the area. Nothing is to be used of a triangle that does not cross.
    """
    above_a, above_b, above_c = a[2] > 0.0, b[2] > 0.0, c[2] > 0.0
    second, third = above_a == above_c and above_a != above_b, above_a == above_b and above_a != above_c
    tx, ty, tz = b[0] if second else a[0], b[1] if second else a[1], b[2] if second else a[2]
    tx, ty, tz = c[0] if third else tx, c[1] if third else ty, c[2] if third else tz
    px, py, pz = a[0] if second else b[0], a[1] if second else b[1], a[2] if second else b[2]
    qx, qy, qz = a[0] if third else c[0], a[1] if third else c[1], a[2] if third else c[2]
    px, py, pz, qx, qy, qz = px - tx, py - ty, pz - tz, qx - tx, qy - ty, qz - tz
    both_inverse = -tz / (pz * qz)
    return (tx, ty, tz), (px, py, pz), (qx, qy, qz), qz * both_inverse, pz * both_inverse


@inlined_kernel
def part_above(
    a: Triple, b: Triple, c: Triple, area: float, spread: float, h: float, half_x: float, half_y: float
) -> tuple[float, float, float]:
    """Return the integral over the part above z = 0 of a triangle that crosses it, by one point, and its bound [m].

    About its own centroid the part's integral of |d|^2 is less than that of the triangle about the triangle's. inf is
    the bound of what is too near. Last is the part's share of the area.
    """
    tip, p, q, s, t = tip_of(a, b, c)
    part = s * t
    # the tip's centroid from the tip, times three, and that of the rest
    x, y, z = s * p[0] + t * q[0], s * p[1] + t * q[1], s * p[2] + t * q[2]
    tip_above = tip[2] > 0.0
    weight = part if tip_above else 1.0 - part
    scale = _THIRD if tip_above else _THIRD / weight
    x = tip[0] + scale * (x if tip_above else p[0] + q[0] - part * x)
    y = tip[1] + scale * (y if tip_above else p[1] + q[1] - part * y)
    z = tip[2] + scale * (z if tip_above else p[2] + q[2] - part * z)
    u, v = beyond_borders(x, y, half_x, half_y)
    r = math.sqrt(u * u + v * v + z * z)
    both_inverse = 1.0 / (r * (r - 2.0 * h))
    inverse, nearest = (r - 2.0 * h) * both_inverse, r * both_inverse
    bound = area * spread * nearest * nearest * nearest
    return area * weight * inverse, bound if r > 2.0 * CLOSEST * h else math.inf, weight
