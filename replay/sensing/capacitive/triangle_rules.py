"""One triangle at the least cost that its share of the error budget allows; the bounds are derived in `tree_sum`."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.gauss import TRIANGLE_7, TRIANGLE_16
from replay.numerics.jit import kernel
from replay.sensing.capacitive.contact import CLEAR, contact
from replay.sensing.capacitive.exact import integral_over_triangle
from replay.sensing.capacitive.triangle_sum import faces_centre

Floats = NDArray[np.float64]
Triple = tuple[float, float, float]

_GREED = 8.0
"""A node may take up to this many times its own share of the budget, if earlier nodes have left it."""

_THRIFT = 0.25
"""Largest part of what earlier nodes have left that one node may take."""


FITS, NEAR, CROSSES_X, CROSSES_Y = range(4)
"""Verdicts on a point rule: it fits; the triangle is too near for it; a border in x or y must be cut first."""

_RULE_3, _RULE_7, _RULE_16 = 0.12, 0.065, 0.005
"""Error constants of the point rules, twice the worst of 20 000 triangles (slivers too) at h/r = 0.06..0.5 in regions
of each kind. Rigorous are 1.5, 2 and 2, from the terms of Legendre's expansion at their largest, but no triangle comes
near: 0.056, 0.031 and 0.002 were the worst."""

PIECES = 16
"""Most pieces of one triangle: each of five planes replaces a piece by at most three, one after the other."""


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
    pieces: Floats,
) -> tuple[float, float, float, bool]:
    """Return the integral over a triangle (3, 3) in the plate's frame, its share, its error bound, if it touches.

    Before the closed form is called for, the triangle is cut by z = 0 and by borders in its way, and point rules are
    tried on the pieces; `pieces` (PIECES, 4, 3) holds their corners and, last, their areas.
    """
    z0, z1, z2 = corners[0, 2], corners[1, 2], corners[2, 2]
    touches = False
    if min(z0, z1, z2) <= 0.0 <= max(z0, z1, z2):
        touches = contact(corners, area, half_x, half_y, both) != CLEAR
    if (not both and max(z0, z1, z2) <= 0.0) or (facing and not faces_centre(corners)):
        return 0.0, 0.0, 0.0, touches
    total, share, error = 0.0, 0.0, 0.0
    for k in range(3):
        for axis in range(3):
            pieces[0, k, axis] = corners[k, axis]
    pieces[0, 3, 0] = area
    size = 1
    if not both and min(z0, z1, z2) < 0.0:
        size = 0 if touches else _cut(pieces, 1, 2, 0.0, True)
    near = size == 0
    while size > 0 and not near:
        piece = pieces[size - 1]
        value, own, e, verdict = _by_points(piece, piece[3, 0], half_x, half_y, rtol, saved)
        if verdict == FITS:
            total, share, error = total + value, share + own, error + e
            saved += own - e
            size -= 1
        elif verdict == CROSSES_X:
            size = _cut(pieces, size, 0, _border_between(piece, 0, half_x), False)
        elif verdict == CROSSES_Y:
            size = _cut(pieces, size, 1, _border_between(piece, 1, half_y), False)
        else:
            near = True
    if not near:
        return total, share, error, touches
    value = integral_over_triangle(corners, area, half_x, half_y, both, scratch)
    return value, (rtol * value if value < math.inf else 0.0), 0.0, touches


@kernel
def _border_between(piece: Floats, axis: int, half: float) -> float:
    """Return the border, half or -half, that has corners on both sides."""
    low, high = min(piece[0, axis], piece[1, axis], piece[2, axis]), max(piece[0, axis], piece[1, axis], piece[2, axis])
    return half if low < half < high else -half


@kernel
def _cut(pieces: Floats, size: int, axis: int, border: float, only_beyond: bool) -> int:
    """Replace the last piece by its two or three parts on either side of a plane; return the new number of pieces."""
    last = pieces[size - 1]
    beyond_0, beyond_1, beyond_2 = last[0, axis] > border, last[1, axis] > border, last[2, axis] > border
    alone = 0 if beyond_1 == beyond_2 else (1 if beyond_0 == beyond_2 else 2)
    area = last[3, 0]
    ax, ay, az = last[alone, 0], last[alone, 1], last[alone, 2]
    j, k = (alone + 1) % 3, (alone + 2) % 3
    bx, by, bz = last[j, 0], last[j, 1], last[j, 2]
    cx, cy, cz = last[k, 0], last[k, 1], last[k, 2]
    is_beyond = last[alone, axis] > border
    gap = last[alone, axis] - border
    s, t = gap / (last[alone, axis] - last[j, axis]), gap / (last[alone, axis] - last[k, axis])
    p = (ax + s * (bx - ax), ay + s * (by - ay), az + s * (bz - az))
    q = (ax + t * (cx - ax), ay + t * (cy - ay), az + t * (cz - az))
    p = (border if axis == 0 else p[0], border if axis == 1 else p[1], border if axis == 2 else p[2])
    q = (border if axis == 0 else q[0], border if axis == 1 else q[1], border if axis == 2 else q[2])
    size -= 1
    if is_beyond or not only_beyond:
        size = _put(pieces, size, (ax, ay, az), p, q, area * s * t)
    if not is_beyond or not only_beyond:
        size = _put(pieces, size, (bx, by, bz), (cx, cy, cz), q, area * (1.0 - t))
        size = _put(pieces, size, (bx, by, bz), q, p, area * t * (1.0 - s))
    return size


@kernel
def _put(pieces: Floats, size: int, a: Triple, b: Triple, c: Triple, area: float) -> int:
    for axis in range(3):
        pieces[size, 0, axis], pieces[size, 1, axis], pieces[size, 2, axis] = a[axis], b[axis], c[axis]
    pieces[size, 3, 0] = area
    return size + 1


@kernel
def _by_points(
    corners: Floats, area: float, half_x: float, half_y: float, rtol: float, saved: float
) -> tuple[float, float, float, int]:
    """Return integral, share, error bound and verdict of the cheapest point rule that fits, if one does."""
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
        return 0.0, 0.0, 0.0, NEAR
    share = rtol * area / (r + h)
    allowed = allowance(share, saved)
    nearest = r - h
    cube = area * spread / (nearest * nearest * nearest)
    if cube <= allowed:
        return area / r, share, cube, FITS
    ratio = h / r
    cube = area * spread / (r * r * nearest)
    best = _RULE_16 * cube * ratio**7
    if best > allowed:
        return 0.0, 0.0, 0.0, NEAR
    border_x = area * min(over_x * over_x, variance_x) / (2.0 * nearest**3)
    border_y = area * min(over_y * over_y, variance_y) / (2.0 * nearest**3)
    border = border_x + border_y
    if border + best > allowed:
        return 0.0, 0.0, 0.0, (CROSSES_X if border_x >= border_y else CROSSES_Y)
    keep_x, keep_y = 0.0 if u == 0.0 else 1.0, 0.0 if v == 0.0 else 1.0
    total = 0.0
    if border + _RULE_3 * cube * ratio <= allowed:
        for k in range(3):
            px = u + keep_x * 0.5 * (corners[k, 0] - x)
            py = v + keep_y * 0.5 * (corners[k, 1] - y)
            pz = z + 0.5 * (corners[k, 2] - z)
            total += 1.0 / math.sqrt(px * px + py * py + pz * pz)
        return area * total / 3.0, share, border + _RULE_3 * cube * ratio, FITS
    fits_7 = border + _RULE_7 * cube * ratio**4 <= allowed
    rule = TRIANGLE_7 if fits_7 else TRIANGLE_16
    for k in range(len(rule)):
        a, b, c = rule[k, 0], rule[k, 1], rule[k, 2]
        px = u + keep_x * (a * corners[0, 0] + b * corners[1, 0] + c * corners[2, 0] - x)
        py = v + keep_y * (a * corners[0, 1] + b * corners[1, 1] + c * corners[2, 1] - y)
        pz = a * corners[0, 2] + b * corners[1, 2] + c * corners[2, 2]
        total += rule[k, 3] / math.sqrt(px * px + py * py + pz * pz)
    return area * total, share, border + (_RULE_7 * cube * ratio**4 if fits_7 else best), FITS


@kernel
def _over(position: float, beyond: float, centroid: float, half: float) -> float:
    """Return how far a corner's coordinate lies outside the slab of the centroid, which is `beyond` the plate."""
    if beyond == 0.0:
        return max(abs(position) - half, 0.0)
    return max(half - math.copysign(1.0, centroid) * position, 0.0)
