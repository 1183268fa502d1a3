"""A triangle that no rule fits: cut into pieces that have one, or integrated in closed form."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel, leaf_kernel
from replay.sensing.capacitive.cluster_bounds import CLOSEST
from replay.sensing.capacitive.exact import integral_over_triangle
from replay.sensing.capacitive.triangle_rules import (
    NO_RULE,
    POINTS_1,
    POINTS_16,
    borders,
    cheapest_rule,
    mean_by_rule,
    rule_error,
)

Floats = NDArray[np.float64]

PIECES = 32
"""Most pieces of one triangle: each of five planes replaces a piece by at most three, one after the other, and each of
_QUARTERINGS replaces one by four."""

_QUARTERINGS = 3
"""Pieces of a triangle that are cut in four, when too near for a rule, before the closed form is called for."""


@kernel
def triangle_within(
    pieces: Floats,
    area: float,
    half_x: float,
    half_y: float,
    both: bool,
    allowed: float,
    whole: Floats,
    scratch: Floats,
    terms: Floats,
) -> tuple[float, float]:
    """Return the integral over a triangle in the plate's frame and its error bound [m], at most `allowed`.

    The triangle is cut by z = 0 and by borders in its way, and point rules are tried on the pieces, before the closed
    form of the whole is called for. `pieces` (PIECES, 4, 3) holds the triangle's corners, then the pieces' corners and,
    last, their areas.
    """
    for k in range(3):
        for axis in range(3):
            whole[k, axis] = pieces[0, k, axis]
    pieces[0, 3, 0] = area
    size = 1
    if not both and min(pieces[0, 0, 2], pieces[0, 1, 2], pieces[0, 2, 2]) < 0.0:
        size = _cut(pieces, 1, 2, half_x, half_y)
    share = allowed / area if area > 0.0 else 0.0
    total, spent = 0.0, 0.0
    quartered = 0
    while size > 0:
        last = size - 1
        part = pieces[last, 3, 0]
        x = (pieces[last, 0, 0] + pieces[last, 1, 0] + pieces[last, 2, 0]) / 3.0
        y = (pieces[last, 0, 1] + pieces[last, 1, 1] + pieces[last, 2, 1]) / 3.0
        z = (pieces[last, 0, 2] + pieces[last, 1, 2] + pieces[last, 2, 2]) / 3.0
        u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
        r = math.sqrt(u * u + v * v + z * z)
        squares, largest = 0.0, 0.0
        for k in range(3):
            dx, dy, dz = pieces[last, k, 0] - x, pieces[last, k, 1] - y, pieces[last, k, 2] - z
            square = dx * dx + dy * dy + dz * dz
            squares += square
            largest = max(largest, square)
        h = math.sqrt(largest)
        if r <= CLOSEST * h:
            if r <= 0.75 * h or quartered == _QUARTERINGS:
                break
            quartered += 1
            size = _quarter(pieces, size)
            continue
        shift, doubt, by_x = borders(pieces, last, part, x, y, h, r, half_x, half_y)
        rule, error = cheapest_rule(POINTS_1, part, squares / 12.0, h, r, doubt, share * part)
        if rule == POINTS_1:
            total += part / r
        elif rule != NO_RULE:
            total += part * mean_by_rule(rule, pieces, last, x, y, half_x, half_y, terms) + shift
        elif doubt > 0.0 and rule_error(POINTS_16, part, squares / 12.0, h, r, 0.0) <= share * part:
            size = _cut(pieces, size, 0 if 2.0 * by_x >= doubt else 1, half_x, half_y)
            continue
        elif quartered < _QUARTERINGS:
            quartered += 1
            size = _quarter(pieces, size)
            continue
        else:
            break
        spent += error
        size -= 1
    if size == 0:
        return total, spent
    return integral_over_triangle(whole, area, half_x, half_y, both, scratch), 0.0


@leaf_kernel
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


@leaf_kernel
def _quarter(pieces: Floats, size: int) -> int:
    """Replace the last piece by four, cut from the middles of its edges; return the new number of pieces."""
    last = size - 1
    for axis in range(3):
        a, b, c = pieces[last, 0, axis], pieces[last, 1, axis], pieces[last, 2, axis]
        d, e, f = 0.5 * (b + c), 0.5 * (c + a), 0.5 * (a + b)
        pieces[last, 1, axis], pieces[last, 2, axis] = f, e
        pieces[size, 0, axis], pieces[size, 1, axis], pieces[size, 2, axis] = f, b, d
        pieces[size + 1, 0, axis], pieces[size + 1, 1, axis], pieces[size + 1, 2, axis] = e, d, c
        pieces[size + 2, 0, axis], pieces[size + 2, 1, axis], pieces[size + 2, 2, axis] = d, e, f
    area = 0.25 * pieces[last, 3, 0]
    for k in range(4):
        pieces[last + k, 3, 0] = area
    return size + 3
