"""Whether a tree node can be summed as a whole, and how wrong that may be; the folder's page derives the bounds."""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats, Integers, Singles
from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.triples import Triple
from replay.sensing.capacitive.placed_plate import PlacedPlate, beyond_borders, place, region_of
from replay.sensing.capacitive.tree.lanes import load, padded
from replay.sensing.capacitive.tree.registers import (
    AREA,
    CENTROID,
    CORNER5,
    DROP,
    EDGE5,
    ERROR,
    FARTHEST_PLANE,
    FOUND,
    HALF,
    KEEP,
    LANES,
    LEAST,
    MEAN2,
    MEAN6,
    MIDDLE,
    NEAREST_PLANE,
    NORMAL,
    OPEN,
    OPENING,
    OUTLINE_COLUMNS,
    RADIUS,
    REGION,
    SHIFT,
    SIGMA,
    VERDICT,
)

CLOSEST = 1.5
"""Nodes and triangles nearer than so many of their radii are not expanded."""

_MORE, _LEAST_AREA = 1.0 + 2.0**-22, 1e-37
"""An area in half the digits, rounded down, is less than it is by no more than these factor and sum [m^2]."""


@inlined_kernel
def _reaches(e: Triple, middle: Triple, half: Triple, radius: float) -> tuple[float, float]:
    """Return how far a node reaches from its centroid along a unit vector and against it: its box, or its sphere."""
    offset = e[0] * middle[0] + e[1] * middle[1] + e[2] * middle[2]
    extent = abs(e[0]) * half[0] + abs(e[1]) * half[1] + abs(e[2]) * half[2]
    return min(extent + offset, radius), min(extent - offset, radius)


@inlined_kernel
def _over_borders(
    position: float, half: float, up: float, down: float, sigma: float, blur: float
) -> tuple[float, float]:
    """Return bounds of mean(w^2) [m^2] across one axis, w the depth over a border.

    First for a border that the centroid is beyond (the integral may be larger than the expansion says), then for the
    borders that it is within (it may be smaller).
    """
    # as if the centroid were on the positive side
    ahead, back = up if position >= 0.0 else down, down if position >= 0.0 else up
    gap = half - abs(position)
    reach = max(ahead if gap >= 0.0 else back, 0.0)
    opposite = max(back, 0.0)
    square = blur * blur
    variance = min(sigma * sigma, max((up + blur) * (down + blur), 0.0)) + square
    # V D^2 / (R^2 + V) for both, by one division
    first, second = reach * reach + variance, opposite * opposite + variance
    share = variance / (first * second)
    depth, beyond = max(reach - abs(gap) + 2.0 * blur, 0.0), max(opposite - half - abs(position) + 2.0 * blur, 0.0)
    near = depth * depth * second * share + (square if depth > 0.0 else 0.0)
    far = beyond * beyond * first * share + (square if beyond > 0.0 else 0.0)
    return near if gap < 0.0 else 0.0, far + (near if gap >= 0.0 else 0.0)


@leaf_kernel
def judge_sides(outlines: Singles, which: Integers, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    """Write on which side of z = 0 the nodes which[:count] are: verdicts DROP behind, KEEP before, OPEN across it."""
    T, blur = plate.T_plate_body, plate.blur
    load(outlines, OUTLINE_COLUMNS, which, count, lanes, 0)
    for i in range(padded(count)):
        a, b, c = (
            lanes[CENTROID * LANES + i],
            lanes[(CENTROID + 1) * LANES + i],
            lanes[(CENTROID + 2) * LANES + i],
        )
        z = place(T, a, b, c)[2]
        middle = (lanes[MIDDLE * LANES + i], lanes[(MIDDLE + 1) * LANES + i], lanes[(MIDDLE + 2) * LANES + i])
        half = (lanes[HALF * LANES + i], lanes[(HALF + 1) * LANES + i], lanes[(HALF + 2) * LANES + i])
        above, below = _reaches(T[2][:3], middle, half, lanes[RADIUS * LANES + i])
        verdict = 0.0 if z - below <= blur else 1.0
        lanes[VERDICT * LANES + i] = -1.0 if z + above < -blur else verdict


@leaf_kernel
def judge_nodes(outlines: Singles, which: Integers, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    """Write what is found of the nodes which[:count], and the verdict on each, to the lanes.

    Places may be off by the plate's `blur`; the distance that is computed with is a lower bound.
    """
    T, half_x, half_y, both, blur = plate.T_plate_body, plate.half_x, plate.half_y, plate.both, plate.blur
    load(outlines, OUTLINE_COLUMNS, which, count, lanes, 0)
    ex, ey, ez = T[0][:3], T[1][:3], T[2][:3]
    for i in range(padded(count)):
        a, b, c = (
            lanes[CENTROID * LANES + i],
            lanes[(CENTROID + 1) * LANES + i],
            lanes[(CENTROID + 2) * LANES + i],
        )
        h, area, sigma = lanes[RADIUS * LANES + i], lanes[AREA * LANES + i], lanes[SIGMA * LANES + i]
        corner5, edge5 = lanes[CORNER5 * LANES + i], lanes[EDGE5 * LANES + i]
        middle = (lanes[MIDDLE * LANES + i], lanes[(MIDDLE + 1) * LANES + i], lanes[(MIDDLE + 2) * LANES + i])
        half = (lanes[HALF * LANES + i], lanes[(HALF + 1) * LANES + i], lanes[(HALF + 2) * LANES + i])
        # where the node lies, and the verdict
        x, y, z = place(T, a, b, c)
        above, below = _reaches(ez, middle, half, h)
        beyond_x, beyond_y = beyond_borders(x, y, half_x, half_y)
        r = math.sqrt(beyond_x * beyond_x + beyond_y * beyond_y + z * z) - blur
        verdict = 1.0 if r > CLOSEST * h else 0.0
        verdict = 0.0 if not both and z - below <= blur else verdict
        verdict = -1.0 if not both and z + above < -blur else verdict
        # what the expansion leaves out
        both_inverse = 1.0 / (r * (r - h))
        inverse, nearest = (r - h) * both_inverse, r * both_inverse
        cube = inverse * inverse * inverse
        odd = corner5 if min(beyond_x, beyond_y) > 0.0 else edge5
        error = cube * cube * (odd + lanes[MEAN6 * LANES + i] * nearest)
        # what lies over the borders
        up, down = _reaches(ex, middle, half, h)
        more_x, less_x = _over_borders(x, half_x, up, down, sigma, blur)
        up, down = _reaches(ey, middle, half, h)
        more_y, less_y = _over_borders(y, half_y, up, down, sigma, blur)
        factor = 0.25 * (area * _MORE + _LEAST_AREA) * nearest * nearest * nearest
        # 1/sqrt(1 + t) >= 1 - t/2, and r may be short by 2 blur
        part = 1.0 - inverse * (2.0 * blur + 0.5 * lanes[MEAN2 * LANES + i] * inverse)
        lanes[(FOUND + ERROR) * LANES + i] = error + factor * (more_x + less_x + more_y + less_y)
        lanes[(FOUND + SHIFT) * LANES + i] = factor * (more_x - less_x + more_y - less_y)
        lanes[(FOUND + LEAST) * LANES + i] = max(area * inverse * part, 0.0)
        lanes[(FOUND + REGION) * LANES + i] = region_of(x, y, half_x, half_y)
        lanes[VERDICT * LANES + i] = verdict


@inlined_kernel
def faces(nodes: Floats, index: int, centre: Triple) -> int:
    """Return KEEP when all triangles of the node face the plate's centre, DROP when none does, OPEN otherwise.

    With v from the centroid to the centre, a triangle of normal n faces it if n.v exceeds the offset of its plane. The
    angle between n and v is the one between the cone's axis and v, give or take the cone's half angle.
    """
    opening = nodes[index, OPENING]
    if opening <= 0.0:
        return OPEN
    x, y, z = (
        centre[0] - nodes[index, CENTROID],
        centre[1] - nodes[index, CENTROID + 1],
        centre[2] - nodes[index, CENTROID + 2],
    )
    along = x * nodes[index, NORMAL] + y * nodes[index, NORMAL + 1] + z * nodes[index, NORMAL + 2]
    square = x * x + y * y + z * z
    across = math.sqrt(max(0.0, square - along * along))
    sine = math.sqrt(max(0.0, 1.0 - opening * opening))
    margin = 1e-9 * (math.sqrt(square) + nodes[index, RADIUS])
    if along > 0.0 and along * opening - across * sine > nodes[index, FARTHEST_PLANE] + margin:
        return KEEP
    # inside the cone, some normal may point straight at the centre
    largest = along * opening + across * sine if along < opening * math.sqrt(square) else math.sqrt(square)
    return DROP if largest < nodes[index, NEAREST_PLANE] - margin else OPEN
