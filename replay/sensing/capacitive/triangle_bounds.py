"""How a triangle can be summed by a rule, and how wrong that may be; the bounds are derived in `tree_sum`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel
from replay.sensing.capacitive.cluster_bounds import (
    CLOSEST,
    DROP,
    ERROR,
    KEEP,
    LEAST,
    OPEN,
    SHIFT,
    R,
    Triple,
    X,
    Y,
    Z,
    place,
)
from replay.sensing.capacitive.clusters import OUTWARD, PLACE, REACH, SPREAD
from replay.sensing.capacitive.triangle_rules import NO_RULE, PART_ABOVE, POINTS_1, borders, cheapest_rule, part_above
from replay.sensing.capacitive.triangle_sum import faces_centre, into_plate

Floats = NDArray[np.float64]


@inlined_kernel
def judge_triangle(
    triangles: Floats,
    areas: Floats,
    parts: Floats,
    k: int,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    centre: Triple,
    first: int,
    allowed: float,
    corners: Floats,
    found: Floats,
) -> tuple[int, int]:
    """Return the verdict on a triangle, and if it can be kept its cheapest rule and what is found of it.

    It can be kept if one of the rules from `first` on makes at most the allowed error [m]. A triangle that may touch
    the plate is always OPEN. `corners` (1 or more, 3 or more, 3) is scratch memory.
    """
    x, y, z = place(T, parts[k, PLACE], parts[k, PLACE + 1], parts[k, PLACE + 2])
    h = parts[k, REACH]
    placed = False
    if not both and z - h <= 0.0:
        if z + h < 0.0:
            return DROP, NO_RULE
        into_plate(T, triangles, k, corners)
        placed = True
        heights = (corners[0, 0, 2], corners[0, 1, 2], corners[0, 2, 2])
        if max(heights) < 0.0:
            return DROP, NO_RULE
        if min(heights) <= 0.0:
            if first != POINTS_1 or min(heights) * max(heights) == 0.0 or (facing and not faces_centre(corners)):
                return OPEN, NO_RULE
            value, error = part_above(corners, areas[k], parts[k, SPREAD], h, half_x, half_y)
            found[ERROR], found[SHIFT], found[LEAST] = error, value, max(0.0, value - error)
            return KEEP if error <= allowed else OPEN, PART_ABOVE
    u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
    r = math.sqrt(u * u + v * v + z * z)
    if r <= CLOSEST * h:
        return OPEN, NO_RULE
    if facing:
        side = _side_of_centre(parts, k, centre)
        if side == OPEN:
            if not placed:
                into_plate(T, triangles, k, corners)
                placed = True
            side = KEEP if faces_centre(corners) else DROP
        if side == DROP:
            return DROP, NO_RULE
    area, spread = areas[k], parts[k, SPREAD]
    shift, doubt = 0.0, 0.0
    if abs(abs(x) - half_x) < h or abs(abs(y) - half_y) < h or abs(x) + half_x < h or abs(y) + half_y < h:
        if not placed:
            into_plate(T, triangles, k, corners)
        shift, doubt, _ = borders(corners, 0, area, x, y, h, r, half_x, half_y)
    rule, error = cheapest_rule(first, area, spread, h, r, doubt, allowed)
    if rule == NO_RULE:
        return OPEN, rule
    found[X], found[Y], found[Z], found[R], found[ERROR], found[SHIFT] = x, y, z, r, error, shift
    found[LEAST] = area / math.sqrt(r * r + spread)
    return KEEP, rule


@inlined_kernel
def _side_of_centre(parts: Floats, k: int, centre: Triple) -> int:
    """Return KEEP when a triangle faces the plate's centre, DROP when not, OPEN when `faces_centre` may round it."""
    a, b, c = parts[k, PLACE], parts[k, PLACE + 1], parts[k, PLACE + 2]
    nx, ny, nz = parts[k, OUTWARD], parts[k, OUTWARD + 1], parts[k, OUTWARD + 2]
    x, y, z = centre[0] - a, centre[1] - b, centre[2] - c
    along = nx * x + ny * y + nz * z
    extent = abs(a) + abs(b) + abs(c) + abs(centre[0]) + abs(centre[1]) + abs(centre[2]) + parts[k, REACH]
    margin = (1e-9 * (abs(nx) + abs(ny) + abs(nz)) + 1e-13 * parts[k, REACH] * extent) * (abs(x) + abs(y) + abs(z))
    return KEEP if along > margin else (DROP if along < -margin else OPEN)
