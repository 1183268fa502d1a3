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

_GREED = 8.0
"""A node may take up to this many times its own share of the budget, if earlier nodes have left it."""

_THRIFT = 0.25
"""Largest part of what earlier nodes have left that one node may take."""


FITS, NEAR, CROSSES_X, CROSSES_Y, CROSSES_Z = range(5)
"""Verdicts on a point rule: it fits; the triangle is too near; a border in x, in y, or z = 0 must be cut first."""

_RULE_3, _RULE_7, _RULE_16 = 0.12, 0.065, 0.005
"""Error constants of the point rules, twice the worst of 20 000 triangles (slivers too) at h/r = 0.06..0.5 in regions
of each kind. Rigorous are 1.5, 2 and 2, from the terms of Legendre's expansion at their largest, but no triangle comes
near: 0.056, 0.031 and 0.002 were the worst."""

RULE_POINTS = 16
"""Most points of a rule."""

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
    terms: Floats,
) -> tuple[float, float, float, bool]:
    """Return the integral over a triangle (3, 3) in the plate's frame, its share, its error bound, if it touches.

    Before the closed form is called for, the triangle is cut by z = 0 and by borders in its way, and point rules are
    tried on the pieces; `pieces` (PIECES, 4, 3) holds their corners and, last, their areas.
    """
    z0, z1, z2 = corners[0, 2], corners[1, 2], corners[2, 2]
    touches = False
    if min(z0, z1, z2) <= 0.0 <= max(z0, z1, z2):
        touches = contact(corners, half_x, half_y, both) != CLEAR
    if (not both and max(z0, z1, z2) <= 0.0) or (facing and not faces_centre(corners)):
        return 0.0, 0.0, 0.0, touches
    total, share, error = 0.0, 0.0, 0.0
    for k in range(3):
        for axis in range(3):
            pieces[0, k, axis] = corners[k, axis]
    pieces[0, 3, 0] = area
    size, near = 1, False
    verdict = CROSSES_Z if not both and min(z0, z1, z2) < 0.0 else FITS
    if verdict == CROSSES_Z and touches:
        near = True
    while size > 0 and not near:
        if verdict != CROSSES_Z:
            value, own, e, verdict = _by_points(pieces, size - 1, half_x, half_y, rtol, saved, terms)
        if verdict == FITS:
            total, share, error = total + value, share + own, error + e
            saved += own - e
            size -= 1
        elif verdict == NEAR:
            near = True
        else:
            size = _cut(pieces, size, verdict - CROSSES_X, half_x, half_y)
            verdict = FITS
    if not near:
        return total, share, error, touches
    value = integral_over_triangle(corners, area, half_x, half_y, both, scratch)
    return value, (rtol * value if value < math.inf else 0.0), 0.0, touches


@kernel
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


@kernel
def _by_points(
    pieces: Floats, index: int, half_x: float, half_y: float, rtol: float, saved: float, terms: Floats
) -> tuple[float, float, float, int]:
    """Return integral, share, error bound and verdict of the cheapest point rule that fits, if one does."""
    area = pieces[index, 3, 0]
    x = (pieces[index, 0, 0] + pieces[index, 1, 0] + pieces[index, 2, 0]) / 3.0
    y = (pieces[index, 0, 1] + pieces[index, 1, 1] + pieces[index, 2, 1]) / 3.0
    z = (pieces[index, 0, 2] + pieces[index, 1, 2] + pieces[index, 2, 2]) / 3.0
    u = x - math.copysign(half_x, x) if abs(x) > half_x else 0.0
    v = y - math.copysign(half_y, y) if abs(y) > half_y else 0.0
    r = math.sqrt(u * u + v * v + z * z)
    squares, largest = 0.0, 0.0
    for k in range(3):
        dx, dy, dz = pieces[index, k, 0] - x, pieces[index, k, 1] - y, pieces[index, k, 2] - z
        square = dx * dx + dy * dy + dz * dz
        squares += square
        largest = max(largest, square)
    if r * r <= 4.0 * largest:
        return 0.0, 0.0, 0.0, NEAR
    h, spread = math.sqrt(largest), squares / 12.0
    share = rtol * area / (r + h)
    allowed = allowance(share, saved)
    nearest = 1.0 / (r - h)
    cube = area * spread * nearest * nearest * nearest
    if cube <= allowed:
        return area / r, share, cube, FITS
    inverse = 1.0 / r
    ratio = h * inverse
    smooth = area * spread * nearest * inverse * inverse
    ratio_3 = ratio * ratio * ratio
    error_3, error_7 = _RULE_3 * smooth * ratio, _RULE_7 * smooth * ratio_3 * ratio
    error_16 = _RULE_16 * smooth * ratio_3 * ratio_3 * ratio
    if error_16 > allowed:
        return 0.0, 0.0, 0.0, NEAR
    border = 0.0
    if abs(abs(x) - half_x) < h or abs(abs(y) - half_y) < h or abs(x) + half_x < h or abs(y) + half_y < h:
        border_x = 0.5 * area * _border(pieces, index, 0, x, half_x) * nearest * nearest * nearest
        border_y = 0.5 * area * _border(pieces, index, 1, y, half_y) * nearest * nearest * nearest
        border = border_x + border_y
        if border + error_16 > allowed:
            return 0.0, 0.0, 0.0, (CROSSES_X if border_x >= border_y else CROSSES_Y)
    keep_x, keep_y = 0.0 if u == 0.0 else 1.0, 0.0 if v == 0.0 else 1.0
    total = 0.0
    if border + error_3 <= allowed:
        for k in range(3):
            px = u + keep_x * 0.5 * (pieces[index, k, 0] - x)
            py = v + keep_y * 0.5 * (pieces[index, k, 1] - y)
            pz = z + 0.5 * (pieces[index, k, 2] - z)
            total += 1.0 / math.sqrt(px * px + py * py + pz * pz)
        return area * total / 3.0, share, border + error_3, FITS
    fits_7 = border + error_7 <= allowed
    if fits_7:
        total = _points(TRIANGLE_7, pieces, index, u - x * keep_x, v - y * keep_y, keep_x, keep_y, terms)
        return area * total, share, border + error_7, FITS
    total = _points(TRIANGLE_16, pieces, index, u - x * keep_x, v - y * keep_y, keep_x, keep_y, terms)
    return area * total, share, border + error_16, FITS


@kernel
def _points(
    rule: Floats,
    pieces: Floats,
    index: int,
    shift_x: float,
    shift_y: float,
    keep_x: float,
    keep_y: float,
    terms: Floats,
) -> float:
    """Return the mean of 1/dist by a symmetric rule; the first loop has no sum in it, so that it is vectorised."""
    ax, ay, az = keep_x * pieces[index, 0, 0] + shift_x, keep_y * pieces[index, 0, 1] + shift_y, pieces[index, 0, 2]
    bx, by, bz = keep_x * pieces[index, 1, 0] + shift_x, keep_y * pieces[index, 1, 1] + shift_y, pieces[index, 1, 2]
    cx, cy, cz = keep_x * pieces[index, 2, 0] + shift_x, keep_y * pieces[index, 2, 1] + shift_y, pieces[index, 2, 2]
    for k in range(rule.shape[1]):
        a, b, c = rule[0, k], rule[1, k], rule[2, k]
        px, py, pz = a * ax + b * bx + c * cx, a * ay + b * by + c * cy, a * az + b * bz + c * cz
        terms[k] = rule[3, k] / math.sqrt(px * px + py * py + pz * pz)
    total = 0.0
    for k in range(rule.shape[1]):
        total += terms[k]
    return total


@kernel
def _border(pieces: Floats, index: int, axis: int, centroid: float, half: float) -> float:
    """Return a bound of mean(w^2) [m^2], w the depth by which a triangle lies outside its centroid's slab."""
    over, variance = 0.0, 0.0
    for k in range(3):
        offset = pieces[index, k, axis] - centroid
        variance += offset * offset / 12.0
        if abs(centroid) > half:
            over = max(over, half - math.copysign(1.0, centroid) * pieces[index, k, axis])
        else:
            over = max(over, abs(pieces[index, k, axis]) - half)
    gap = abs(abs(centroid) - half)
    return min(over * over, variance * (over / (over + gap)) ** 2) if over > 0.0 else 0.0
