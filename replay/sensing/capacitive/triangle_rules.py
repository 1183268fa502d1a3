"""One triangle at the least cost that its share of the error budget allows; the bounds are derived in `tree_sum`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel
from replay.sensing.capacitive.clusters import RULE_7
from replay.sensing.capacitive.contact import CLEAR, contact
from replay.sensing.capacitive.exact import integral_over_triangle
from replay.sensing.capacitive.triangle_sum import faces_centre

Floats = NDArray[np.float64]

_GREED = 8.0
"""A node may take up to this many times its own share of the budget, if earlier nodes have left it."""

_THRIFT = 0.25
"""Largest part of what earlier nodes have left that one node may take."""


@kernel
def allowance(share: float, saved: float) -> float:
    """Return the error [m] that a node with a share of the budget may make, given what earlier nodes have saved."""
    return max(share, min(_GREED * share, _THRIFT * saved))


@kernel
def triangle_within(
    corners: Floats,
    area: float,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    rtol: float,
    saved: float,
    scratch: Floats,
) -> tuple[float, float, float, bool]:
    """Return the integral over a triangle (3, 3) in the plate's frame, its share, its error bound, if it touches."""
    z0, z1, z2 = corners[0, 2], corners[1, 2], corners[2, 2]
    touches = False
    if min(z0, z1, z2) <= 0.0 <= max(z0, z1, z2):
        touches = contact(corners, area, half_x, half_y, both) != CLEAR
    if (not both and max(z0, z1, z2) <= 0.0) or (facing and not faces_centre(corners)):
        return 0.0, 0.0, 0.0, touches
    if both or min(z0, z1, z2) > 0.0:
        value, share, error = _by_points(corners, area, half_x, half_y, rtol, saved)
        if error >= 0.0:
            return value, share, error, touches
    value = integral_over_triangle(corners, area, half_x, half_y, both, scratch)
    return value, (rtol * value if value < math.inf else 0.0), 0.0, touches


@kernel
def _by_points(
    corners: Floats, area: float, half_x: float, half_y: float, rtol: float, saved: float
) -> tuple[float, float, float]:
    """Return integral, share and error bound of the cheapest point rule that fits; error bound -1 when none does."""
    x = (corners[0, 0] + corners[1, 0] + corners[2, 0]) / 3.0
    y = (corners[0, 1] + corners[1, 1] + corners[2, 1]) / 3.0
    z = (corners[0, 2] + corners[1, 2] + corners[2, 2]) / 3.0
    u = x - math.copysign(half_x, x) if abs(x) > half_x else 0.0
    v = y - math.copysign(half_y, y) if abs(y) > half_y else 0.0
    r = math.sqrt(u * u + v * v + z * z)
    squares, largest, variance_x, variance_y, over_x, over_y = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for k in range(3):
        dx, dy, dz = corners[k, 0] - x, corners[k, 1] - y, corners[k, 2] - z
        square = dx * dx + dy * dy + dz * dz
        squares += square
        largest = max(largest, square)
        variance_x += dx * dx / 12.0
        variance_y += dy * dy / 12.0
        over_x = max(over_x, _over(corners[k, 0], u, x, half_x))
        over_y = max(over_y, _over(corners[k, 1], v, y, half_y))
    h, spread = math.sqrt(largest), squares / 12.0
    if r <= 2.0 * h:
        return 0.0, 0.0, -1.0
    share = rtol * area / (r + h)
    allowed = allowance(share, saved)
    nearest = r - h
    cube = area * spread / (nearest * nearest * nearest)
    if cube <= allowed:
        return area / r, share, cube
    border = area * (min(over_x * over_x, variance_x) + min(over_y * over_y, variance_y)) / (2.0 * nearest**3)
    ratio = h / r
    cube = area * spread / (r * r * nearest)
    keep_x, keep_y = 0.0 if u == 0.0 else 1.0, 0.0 if v == 0.0 else 1.0
    if border + 1.5 * cube * ratio <= allowed:
        total = 0.0
        for k in range(3):
            px = u + keep_x * 0.5 * (corners[k, 0] - x)
            py = v + keep_y * 0.5 * (corners[k, 1] - y)
            pz = z + 0.5 * (corners[k, 2] - z)
            total += 1.0 / math.sqrt(px * px + py * py + pz * pz)
        return area * total / 3.0, share, border + 1.5 * cube * ratio
    if border + 2.0 * cube * ratio**4 <= allowed:
        total = 0.0
        for k in range(7):
            a, b, c = RULE_7[k, 0], RULE_7[k, 1], RULE_7[k, 2]
            px = u + keep_x * (a * corners[0, 0] + b * corners[1, 0] + c * corners[2, 0] - x)
            py = v + keep_y * (a * corners[0, 1] + b * corners[1, 1] + c * corners[2, 1] - y)
            pz = a * corners[0, 2] + b * corners[1, 2] + c * corners[2, 2]
            total += RULE_7[k, 3] / math.sqrt(px * px + py * py + pz * pz)
        return area * total, share, border + 2.0 * cube * ratio**4
    return 0.0, 0.0, -1.0


@kernel
def _over(position: float, beyond: float, centroid: float, half: float) -> float:
    """Return how far a corner's coordinate lies outside the slab of the centroid, which is `beyond` the plate."""
    if beyond == 0.0:
        return max(abs(position) - half, 0.0)
    return max(half - math.copysign(1.0, centroid) * position, 0.0)
