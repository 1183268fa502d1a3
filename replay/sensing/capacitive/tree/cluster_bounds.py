"""Whether a tree node can be summed as a whole, and how wrong that may be; the folder's page derives the bounds."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.sensing.capacitive.placed_plate import PlacedPlate, Triple, beyond_borders, region_of
from replay.sensing.capacitive.tree.lanes import load, padded
from replay.sensing.capacitive.tree.registers import (
    AREA,
    CENTROID,
    DROP,
    ERROR,
    FARTHEST_PLANE,
    FOUND,
    HALF,
    KEEP,
    LANES,
    LEAST,
    MEAN2,
    MEAN5,
    MEAN6,
    MIDDLE,
    NEAREST_PLANE,
    NORMAL,
    ODD5,
    OPEN,
    OPENING,
    OUTLINE_COLUMNS,
    RADIUS,
    REGION,
    SHIFT,
    SIGMA,
    VERDICT,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Singles = NDArray[np.float32]

CLOSEST = 1.5
"""Nodes and triangles nearer than so many of their radii are not expanded."""

_MORE, _LEAST_AREA = 1.0 + 2.0**-22, 1e-37
"""An area in half the digits, rounded down, is less than it is by no more than these factor and sum [m^2]."""

_FIFTH = (math.sqrt(7.875), math.sqrt(4.203125), 1.0)
"""Frobenius norm of the form |Pd|^5 P_5(cos) when P drops none, one or two of three components."""


@inlined_kernel
def _reaches(e: Triple, middle: Triple, half: Triple, radius: float) -> tuple[float, float]:
    """Return how far a node reaches from its centroid along a unit vector and against it: its box, or its sphere."""
    offset = e[0] * middle[0] + e[1] * middle[1] + e[2] * middle[2]
    extent = abs(e[0]) * half[0] + abs(e[1]) * half[1] + abs(e[2]) * half[2]
    return min(extent + offset, radius), min(extent - offset, radius)


@inlined_kernel
def _spread(sigma: float, up: float, down: float, blur: float) -> float:
    """Return a bound of the standard deviation along an axis [m], of points of a mean that reach so far up and down."""
    return min(sigma, math.sqrt(max((up + blur) * (down + blur), 0.0)))


@inlined_kernel
def _over(reach: float, gap: float, sigma: float, blur: float) -> float:
    """Return a bound of mean(w^2) [m^2], w the depth by which a node that reaches so far lies over a border."""
    depth = max(reach - gap, 0.0)
    ratio = depth / reach if reach > 0.0 else 0.0
    w = min(depth, sigma * ratio) + blur
    return w * w if reach + blur > gap else 0.0


@inlined_kernel
def _over_borders(
    position: float, half: float, up: float, down: float, sigma: float, blur: float
) -> tuple[float, float]:
    """Return bounds of mean(w^2) [m^2] across one axis.

    First for a border that the centroid is beyond (the integral may be larger than the expansion says), then for the
    borders that it is within (it may be smaller).
    """
    # as if the centroid were on the positive side
    ahead, back = up if position >= 0.0 else down, down if position >= 0.0 else up
    gap = half - abs(position)
    near = _over(ahead if gap >= 0.0 else back, abs(gap), sigma, blur)
    opposite = _over(back, half + abs(position), sigma, blur)
    return near if gap < 0.0 else 0.0, opposite + (near if gap >= 0.0 else 0.0)


@leaf_kernel
def judge_nodes(outlines: Singles, which: Ints, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    """Write what is found of the nodes which[:count], and the verdict on each, to the lanes.

    Places may be off by the plate's `blur`; the distance that is computed with is a lower bound.
    """
    T, half_x, half_y, both, blur = plate.T_plate_body, plate.half_x, plate.half_y, plate.both, plate.blur
    load(outlines, OUTLINE_COLUMNS, which, count, lanes, 0)
    # taken out of the loop by hand: the compiler cannot know that lanes and pose are different memory
    ex, ey, ez = (T[0, 0], T[0, 1], T[0, 2]), (T[1, 0], T[1, 1], T[1, 2]), (T[2, 0], T[2, 1], T[2, 2])
    tx, ty, tz = T[0, 3], T[1, 3], T[2, 3]
    for i in range(padded(count)):
        a, b, c = (
            lanes[CENTROID * LANES + i],
            lanes[(CENTROID + 1) * LANES + i],
            lanes[(CENTROID + 2) * LANES + i],
        )
        h, area, sigma = lanes[RADIUS * LANES + i], lanes[AREA * LANES + i], lanes[SIGMA * LANES + i]
        middle = (lanes[MIDDLE * LANES + i], lanes[(MIDDLE + 1) * LANES + i], lanes[(MIDDLE + 2) * LANES + i])
        half = (lanes[HALF * LANES + i], lanes[(HALF + 1) * LANES + i], lanes[(HALF + 2) * LANES + i])
        # where the node lies, and the verdict
        x = ex[0] * a + ex[1] * b + ex[2] * c + tx
        y = ey[0] * a + ey[1] * b + ey[2] * c + ty
        z = ez[0] * a + ez[1] * b + ez[2] * c + tz
        above, below = _reaches(ez, middle, half, h)
        beyond_x, beyond_y = beyond_borders(x, y, half_x, half_y)
        r = math.sqrt(beyond_x * beyond_x + beyond_y * beyond_y + z * z) - blur
        verdict = 1.0 if r > CLOSEST * h else 0.0
        verdict = 0.0 if not both and z - below <= blur else verdict
        verdict = -1.0 if not both and z + above < -blur else verdict
        # what the expansion leaves out
        inverse, nearest = 1.0 / r, 1.0 / (r - h)
        cube = inverse * inverse * inverse
        fifth = _FIFTH[0] if beyond_x > 0.0 else _FIFTH[1]
        fifth = fifth if beyond_y > 0.0 else (_FIFTH[1] if beyond_x > 0.0 else _FIFTH[2])
        odd = min(fifth * lanes[ODD5 * LANES + i], lanes[MEAN5 * LANES + i])
        error = cube * cube * (odd + lanes[MEAN6 * LANES + i] * nearest)
        # what lies over the borders
        up, down = _reaches(ex, middle, half, h)
        more_x, less_x = _over_borders(x, half_x, up, down, _spread(sigma, up, down, blur), blur)
        up, down = _reaches(ey, middle, half, h)
        more_y, less_y = _over_borders(y, half_y, up, down, _spread(sigma, up, down, blur), blur)
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
