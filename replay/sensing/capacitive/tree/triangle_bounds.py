"""How a triangle can be summed by a rule, and how wrong that may be; the bounds are derived in `tree_sum`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.sensing.capacitive.tree.cluster_bounds import CLOSEST
from replay.sensing.capacitive.tree.clusters import REACH, SIZE, SPREAD, TRIANGLE_COLUMNS
from replay.sensing.capacitive.tree.lanes import (
    ALLOWED,
    ERROR,
    FIRST_RULE,
    FOUND,
    LANES,
    LEAST,
    REGION,
    RULE_FOUND,
    SHIFT,
    VERDICT,
    load,
    padded,
)
from replay.sensing.capacitive.placed_plate import PlacedPlate, beyond_borders, faces_centre, region_of
from replay.sensing.capacitive.tree.point_sums import corner_in_lanes
from replay.sensing.capacitive.tree.triangle_rules import (
    NO_RULE,
    PART_ABOVE,
    POINTS_1,
    cheapest_rule,
    over_borders,
    part_above,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


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
