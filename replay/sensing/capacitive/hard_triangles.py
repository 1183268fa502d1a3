"""Triangles that no rule fits: cut into pieces that have one, many at a time; what is left needs the closed form.

A piece is cut where a border runs through it, else in four. Straight before the plate it has a closed form of its own,
1/dist being 1/|z|; elsewhere a rule must make no more error than the piece's share, by area, of what its triangle may
make. A triangle that may touch the plate, or that has become too many pieces, is left to the closed form as a whole.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.gauss import TRIANGLE_7, TRIANGLE_16
from replay.numerics.jit import inlined_kernel, kernel, leaf_kernel
from replay.numerics.log_difference import mean_inverse_linear
from replay.sensing.capacitive.cluster_bounds import ERROR, FOUND, REGION, SHIFT, VERDICT
from replay.sensing.capacitive.clusters import CORNERS, REACH, SIZE, SPREAD
from replay.sensing.capacitive.contact import CLEAR, contact
from replay.sensing.capacitive.exact import integral_over_triangle
from replay.sensing.capacitive.lanes import LANES, load, padded
from replay.sensing.capacitive.point_sums import SUM, TRIANGLE_3, sum_by_points
from replay.sensing.capacitive.saturation import may_touch
from replay.sensing.capacitive.triangle_bounds import ALLOWED, FIRST, RULE, judge_loaded
from replay.sensing.capacitive.triangle_cuts import OWNER, PIECE, cut, quarter, write_piece
from replay.sensing.capacitive.triangle_rules import POINTS_1, POINTS_3
from replay.sensing.capacitive.triangle_sum import faces_centre, part_into_plate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

MOST_PIECES = 48
"""Pieces that may be made of a triangle before the closed form is called for, which then is cheaper."""

IN_FOUR = 2
"""How a piece is cut that no border runs through."""

POOL = LANES * (MOST_PIECES + 4)

_WHERE, _BY = OWNER + 1, OWNER + 2
"""Columns of a piece that has its rule: its region, and the correction for borders [m]."""


class Pieces(NamedTuple):
    """Room for the pieces of up to LANES triangles, their owners."""

    pool: Floats  # (POOL, PIECE) pieces to judge
    done: Floats  # (3, 2 LANES, PIECE) pieces that are to be summed by 3, 7 and 16 points
    in_done: Ints  # (3,)
    rows: Ints  # (LANES,)
    totals: Floats  # (LANES,) sum of an owner's pieces [m]
    errors: Floats  # (LANES,) and their error bound [m]
    densities: Floats  # (LANES,) error that is allowed, over the area [1/m]
    made: Ints  # (LANES,) pieces made so far; above MOST_PIECES: given up
    triangles: Ints  # (LANES,) which triangles the owners are
    slow: Ints  # (LANES,) triangles that need the closed form
    identity: Floats  # (4, 4) pieces are in the plate's frame


@leaf_kernel
def sum_hard(
    parts: Floats,
    hard: Ints,
    begin: int,
    count: int,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    share: float,
    pieces: Pieces,
    corners: Floats,
    lanes: Floats,
) -> tuple[float, float, int]:
    """Return the sum over hard[begin : begin + count] and its error bound [m], at most `share` for each of them.

    Last is how many are left out of it, written to `pieces.slow`: those that may touch the plate, and those that would
    need too many pieces.
    """
    slow, size, owners = 0, 0, 0
    for at in range(begin, begin + count):
        k = hard[at]
        part_into_plate(T, parts, k, corners)
        area = parts[k, SIZE]
        if may_touch(corners, half_x, half_y):
            pieces.slow[slow] = k
            slow += 1
        elif (
            (both or max(corners[0, 0, 2], corners[0, 1, 2], corners[0, 2, 2]) > 0.0)
            and area > 0.0
            and not (facing and not faces_centre(corners))
        ):
            pieces.triangles[owners], pieces.densities[owners] = k, share / area
            size = _add_owner(pieces, size, owners, corners, area, half_x, half_y, both)
            owners += 1
    _sum_pieces(pieces, size, half_x, half_y, lanes)
    total, spent = 0.0, 0.0
    for owner in range(owners):
        if pieces.made[owner] > MOST_PIECES:
            pieces.slow[slow] = pieces.triangles[owner]
            slow += 1
        else:
            total += pieces.totals[owner]
            spent += pieces.errors[owner]
    return total, spent, slow


@kernel
def sum_exactly(
    parts: Floats,
    which: Ints,
    count: int,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    corners: Floats,
    scratch: Floats,
) -> tuple[float, bool]:
    """Return the closed form of the triangles which[:count] [m], inf if saturated, and whether one touches."""
    total, touching = 0.0, False
    for i in range(count):
        part_into_plate(T, parts, which[i], corners)
        touching = touching or contact(corners[0], half_x, half_y, both) != CLEAR
        if not (facing and not faces_centre(corners)):
            total += integral_over_triangle(corners[0], parts[which[i], SIZE], half_x, half_y, both, scratch)
    return total, touching


@leaf_kernel
def _add_owner(
    pieces: Pieces,
    size: int,
    owner: int,
    corners: Floats,
    area: float,
    half_x: float,
    half_y: float,
    both: bool,
) -> int:
    """Add a triangle corners[0], in the plate's frame, as a piece, or what of it is above z = 0.

    Returns the new number of pieces.
    """
    pool = pieces.pool
    a = (corners[0, 0, 0], corners[0, 0, 1], corners[0, 0, 2])
    b = (corners[0, 1, 0], corners[0, 1, 1], corners[0, 1, 2])
    c = (corners[0, 2, 0], corners[0, 2, 1], corners[0, 2, 2])
    pieces.totals[owner], pieces.errors[owner], pieces.made[owner] = 0.0, 0.0, 1
    write_piece(pool, size, a, b, c, area, float(owner))
    first, size = size, size + 1
    if not both and min(a[2], b[2], c[2]) < 0.0:
        size = cut(pool, size, 2, 0.0)
    return _sum_before_plate(pieces, first, size, half_x, half_y)


@inlined_kernel
def _sum_before_plate(pieces: Pieces, first: int, size: int, half_x: float, half_y: float) -> int:
    """Sum those of the pieces from `first` on that are straight before the plate; return the new number of pieces.

    There 1/dist is 1/|z|, whose mean has a closed form that costs no more than a rule.
    """
    pool = pieces.pool
    left = first
    for row in range(first, size):
        a, b, c = pool[row, CORNERS], pool[row, CORNERS + 3], pool[row, CORNERS + 6]
        across = max(abs(a), abs(b), abs(c)) > half_x
        a, b, c = pool[row, CORNERS + 1], pool[row, CORNERS + 4], pool[row, CORNERS + 7]
        if not across and max(abs(a), abs(b), abs(c)) <= half_y:
            mean = mean_inverse_linear(
                abs(pool[row, CORNERS + 2]), abs(pool[row, CORNERS + 5]), abs(pool[row, CORNERS + 8])
            )
            pieces.totals[int(pool[row, OWNER])] += pool[row, SIZE] * mean
        else:
            for column in range(OWNER + 1):
                pool[left, column] = pool[row, column]
            left += 1
    return left


@inlined_kernel
def _border_across(i: int, half_x: float, half_y: float, lanes: Floats) -> int:
    """Return the axis of a border that runs through the piece in a lane, or IN_FOUR if there is none."""
    for axis in range(2):
        half = half_x if axis == 0 else half_y
        a, b, c = (
            lanes[(CORNERS + axis) * LANES + i],
            lanes[(CORNERS + axis + 3) * LANES + i],
            lanes[(CORNERS + axis + 6) * LANES + i],
        )
        low, high = min(a, b, c), max(a, b, c)
        if low < half < high or low < -half < high:
            return axis
    return IN_FOUR


@leaf_kernel
def _sum_pieces(pieces: Pieces, size: int, half_x: float, half_y: float, lanes: Floats) -> None:
    """Sum the pieces in the pool by point rules, cutting them as long as that pays; `made` tells who was given up."""
    pool, in_done, rows, made = pieces.pool, pieces.in_done, pieces.rows, pieces.made
    in_done[:] = 0
    while size > 0:
        count = min(size, LANES)
        size -= count
        for i in range(count):
            rows[i] = size + i
        load(pool, PIECE, rows, count, lanes, 0)
        for i in range(count):
            owner = int(lanes[OWNER * LANES + i])
            rows[i] = owner
            lanes[ALLOWED * LANES + i] = pieces.densities[owner] * lanes[SIZE * LANES + i]
            lanes[FIRST * LANES + i] = POINTS_1
        _measure(count, lanes)
        judge_loaded(count, pieces.identity, half_x, half_y, True, False, lanes)
        for i in range(count):
            owner = rows[i]
            if made[owner] > MOST_PIECES:
                continue
            if lanes[VERDICT * LANES + i] > 0.0:
                pieces.errors[owner] += lanes[(FOUND + ERROR) * LANES + i]
                rule = int(lanes[RULE * LANES + i])
                if rule == POINTS_1:
                    pieces.totals[owner] += lanes[(FOUND + SHIFT) * LANES + i]
                else:
                    _put_aside(pieces, rule - POINTS_3, i, lanes)
                continue
            step = _border_across(i, half_x, half_y, lanes)
            made[owner] += 3 if step == IN_FOUR else 2
            if made[owner] > MOST_PIECES:
                continue
            for column in range(OWNER + 1):
                pool[size, column] = lanes[column * LANES + i]
            first, size = size, size + 1
            if step == IN_FOUR:
                size = quarter(pool, size)
            else:
                size = cut(pool, size, step, half_x if step == 0 else half_y)
                size = _sum_before_plate(pieces, first, size, half_x, half_y)
        for k in range(3):
            if in_done[k] >= LANES:
                _sum_done(pieces, k, half_x, half_y, lanes)
    for k in range(3):
        if in_done[k] > 0:
            _sum_done(pieces, k, half_x, half_y, lanes)


@inlined_kernel
def _measure(count: int, lanes: Floats) -> None:
    """Write what a row of `Clusters.parts` says of a triangle beside corners and area, from these."""
    for i in range(padded(count)):
        largest, squares = 0.0, 0.0
        x = (lanes[CORNERS * LANES + i] + lanes[(CORNERS + 3) * LANES + i] + lanes[(CORNERS + 6) * LANES + i]) / 3.0
        y = (
            lanes[(CORNERS + 1) * LANES + i] + lanes[(CORNERS + 4) * LANES + i] + lanes[(CORNERS + 7) * LANES + i]
        ) / 3.0
        z = (
            lanes[(CORNERS + 2) * LANES + i] + lanes[(CORNERS + 5) * LANES + i] + lanes[(CORNERS + 8) * LANES + i]
        ) / 3.0
        for corner in range(3):
            dx = lanes[(CORNERS + 3 * corner) * LANES + i] - x
            dy = lanes[(CORNERS + 3 * corner + 1) * LANES + i] - y
            dz = lanes[(CORNERS + 3 * corner + 2) * LANES + i] - z
            square = dx * dx + dy * dy + dz * dz
            squares += square
            largest = max(largest, square)
        lanes[REACH * LANES + i], lanes[SPREAD * LANES + i] = math.sqrt(largest), squares / 12.0


@inlined_kernel
def _put_aside(pieces: Pieces, kind: int, i: int, lanes: Floats) -> None:
    row = pieces.in_done[kind]
    pieces.in_done[kind] = row + 1
    for column in range(OWNER + 1):
        pieces.done[kind, row, column] = lanes[column * LANES + i]
    pieces.done[kind, row, _WHERE] = lanes[(FOUND + REGION) * LANES + i]
    pieces.done[kind, row, _BY] = lanes[(FOUND + SHIFT) * LANES + i]


@leaf_kernel
def _sum_done(pieces: Pieces, kind: int, half_x: float, half_y: float, lanes: Floats) -> None:
    """Sum the last pieces of a kind, as many as there are lanes."""
    count = min(pieces.in_done[kind], LANES)
    first = pieces.in_done[kind] - count
    pieces.in_done[kind] = first
    for i in range(count):
        pieces.rows[i] = first + i
    load(pieces.done[kind], PIECE, pieces.rows, count, lanes, 0)
    points = TRIANGLE_3 if kind == 0 else (TRIANGLE_7 if kind == 1 else TRIANGLE_16)
    sum_by_points(points, count, pieces.identity, half_x, half_y, _WHERE, _BY, lanes)
    for i in range(count):
        pieces.totals[int(lanes[OWNER * LANES + i])] += lanes[SUM * LANES + i]
