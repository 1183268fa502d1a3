"""Whether a tree node can be summed as a whole, and how wrong that may be; the bounds are derived in `tree_sum`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel
from replay.sensing.capacitive.clusters import (
    AREA,
    CENTROID,
    FARTHEST_PLANE,
    LOWER,
    MEAN2,
    MEAN5,
    MEAN6,
    NEAREST_PLANE,
    NORMAL,
    ODD5,
    OPENING,
    RADIUS,
    SECOND,
    UPPER,
)

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

DROP, OPEN, KEEP = -1, 0, 1
"""Verdicts on a node: nothing of it counts; it must be opened; it can be summed as a whole."""

CLOSEST = 1.5
"""Nodes and triangles nearer than so many of their radii are not expanded."""

X, Y, Z, R, ERROR, SHIFT, LEAST = range(7)
"""What is found of a node or triangle: centroid in the plate's frame [m], its distance [m], the error bound, what the
expansion is corrected by, and a lower bound of the integral [m]."""

_FIFTH = (math.sqrt(7.875), math.sqrt(4.203125), 1.0)
"""Frobenius norm of the form |Pd|^5 P_5(cos) when P drops none, one or two of three components."""


@inlined_kernel
def place(T: Floats, x: float, y: float, z: float) -> Triple:
    """Return a point of the body in the plate's frame."""
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@inlined_kernel
def judge_cluster(
    nodes: Floats,
    moments: Floats,
    index: int,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    centre: Triple,
    found: Floats,
) -> int:
    """Return the verdict on a node, and if it can be kept what is found of it."""
    a, b, c = nodes[index, CENTROID], nodes[index, CENTROID + 1], nodes[index, CENTROID + 2]
    z = T[2, 0] * a + T[2, 1] * b + T[2, 2] * c + T[2, 3]
    h, area = nodes[index, RADIUS], nodes[index, AREA]
    if not both and z - h <= 0.0:
        if z + h < 0.0 or z + _reach(nodes, index, T, 2, 1.0) < 0.0:
            return DROP
        if z - _reach(nodes, index, T, 2, -1.0) <= 0.0:
            return OPEN
    x = T[0, 0] * a + T[0, 1] * b + T[0, 2] * c + T[0, 3]
    y = T[1, 0] * a + T[1, 1] * b + T[1, 2] * c + T[1, 3]
    beyond_x, beyond_y = abs(x) - half_x, abs(y) - half_y
    square, folded = z * z, 2
    if beyond_x > 0.0:
        square += beyond_x * beyond_x
        folded -= 1
    if beyond_y > 0.0:
        square += beyond_y * beyond_y
        folded -= 1
    r = math.sqrt(square)
    if r <= CLOSEST * h:
        return OPEN
    if facing:
        verdict = _faces(nodes, index, centre)
        if verdict != KEEP:
            return verdict
    inverse, nearest = 1.0 / r, 1.0 / (r - h)
    cube = inverse * inverse * inverse
    odd = min(_FIFTH[folded] * nodes[index, ODD5], nodes[index, MEAN5])
    error, shift = area * cube * cube * (odd + nodes[index, MEAN6] * nearest), 0.0
    if abs(beyond_x) < h or abs(beyond_y) < h or abs(x) + half_x < h or abs(y) + half_y < h:
        factor = 0.25 * area * nearest * nearest * nearest
        more_x, less_x = _border(nodes, moments, index, T, 0, x, half_x)
        more_y, less_y = _border(nodes, moments, index, T, 1, y, half_y)
        error += factor * (more_x + less_x + more_y + less_y)
        shift = factor * (more_x - less_x + more_y - less_y)
    found[X], found[Y], found[Z], found[R], found[ERROR], found[SHIFT] = x, y, z, r, error, shift
    found[LEAST] = area / math.sqrt(square + nodes[index, MEAN2])
    return KEEP


@inlined_kernel
def _reach(nodes: Floats, index: int, T: Floats, axis: int, sign: float) -> float:
    """Return how far the node's box reaches from its centroid along a plate axis, sign +1 or -1."""
    reach = 0.0
    for k in range(3):
        e = sign * T[axis, k]
        reach += e * (nodes[index, UPPER + k] if e > 0.0 else nodes[index, LOWER + k])
    return min(reach, nodes[index, RADIUS])  # type: ignore[no-any-return]


@inlined_kernel
def _faces(nodes: Floats, index: int, centre: Triple) -> int:
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


@inlined_kernel
def _border(
    nodes: Floats, moments: Floats, index: int, T: Floats, axis: int, position: float, half: float
) -> tuple[float, float]:
    """Return bounds of mean(w^2) [m^2], w the depth by which the node lies over a border across one axis.

    First for a border that the centroid is beyond (the integral may be larger than the expansion says), then for the
    borders that it is within (it may be smaller).
    """
    more, less = 0.0, 0.0
    for side in range(2):
        sign = 1.0 - 2.0 * side
        gap = half - sign * position
        reach = _reach(nodes, index, T, axis, sign if gap >= 0.0 else -sign)
        over = reach - abs(gap)
        if over > 0.0:
            a, b, c = T[axis, 0], T[axis, 1], T[axis, 2]
            variance = (
                a * a * moments[index, SECOND] + b * b * moments[index, SECOND + 1] + c * c * moments[index, SECOND + 2]
            )
            variance += 2.0 * (
                a * b * moments[index, SECOND + 3]
                + a * c * moments[index, SECOND + 4]
                + b * c * moments[index, SECOND + 5]
            )
            square = min(over * over, max(variance, 0.0) * (over / reach) ** 2)
            if gap >= 0.0:
                less += square
            else:
                more += square
    return more, less
