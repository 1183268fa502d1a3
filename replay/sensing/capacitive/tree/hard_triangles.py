"""Triangles that no rule fits: cut into pieces that have one, many at a time; what is left needs the closed form.

A piece is cut where a border runs through it, else in four. Straight before the plate it has a closed form of its own,
1/dist being 1/|z|; elsewhere a rule must make no more error than the piece's share, by area, of what its triangle may
make. A triangle that may touch the plate, or that has become too many pieces, is left to the closed form as a whole.
"""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import inlined_kernel, kernel, leaf_kernel
from replay.numerics.log_difference import mean_inverse_linear
from replay.sensing.capacitive.contact import CLEAR, contact, may_touch
from replay.sensing.capacitive.exact import integral_over_triangle
from replay.sensing.capacitive.placed_plate import PlacedPlate, faces_centre, place_triangle, write_triangle
from replay.sensing.capacitive.tree.lanes import load, padded
from replay.sensing.capacitive.tree.part_sum import sum_by_points
from replay.sensing.capacitive.tree.registers import (
    ALLOWED,
    CORNERS,
    ERROR,
    FIRST_RULE,
    FOUND,
    LANES,
    OWNER,
    PIECE_COLUMNS,
    PIECE_REGION,
    PIECE_SHIFT,
    POINTS_1,
    POINTS_3,
    REACH,
    REGION,
    RULE_FOUND,
    SHIFT,
    SIZE,
    SPREAD,
    SUM,
    VERDICT,
)
from replay.sensing.capacitive.tree.triangle_bounds import judge_loaded
from replay.sensing.capacitive.tree.triangle_pieces import MOST_PIECES, Pieces, cut, quarter, write_piece

IN_FOUR = 2
"""How a piece is cut that no border runs through."""


_THIRD = 1.0 / 3.0
_IDENTITY = ((1.0, 0.0, 0.0, 0.0), (0.0, 1.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0))


@leaf_kernel
def sum_hard(
    triangles: Floats,
    hard: Integers,
    begin: int,
    count: int,
    plate: PlacedPlate,
    share: float,
    pieces: Pieces,
    lanes: Floats,
) -> tuple[float, float, int]:
    """Return the sum over the rows hard[begin : begin + count] and its error bound [m], at most `share` for each.

    Last is how many are left out of it, written to `pieces.slow`: those that may touch the plate, and those that would
    need too many pieces.
    """
    pool = pieces.pool
    slow, size, owners = 0, 0, 0
    for at in range(begin, begin + count):
        k = hard[at]
        a, b, c = place_triangle(plate, triangles, k)
        area, low, high = triangles[k, SIZE], min(a[2], b[2], c[2]), max(a[2], b[2], c[2])
        if may_touch(a, b, c, plate.half_x, plate.half_y):
            pieces.slow[slow] = k
            slow += 1
        elif (
            (plate.both or high > 0.0)
            and area > 0.0
            and not (plate.facing and not faces_centre(a, b, c, plate.rounding))
        ):
            pieces.triangles[owners], pieces.densities[owners] = k, share / area
            pieces.totals[owners], pieces.errors[owners], pieces.made[owners] = 0.0, 0.0, 1
            write_piece(pool, size, a, b, c, area, float(owners))
            first, size, owners = size, size + 1, owners + 1
            if not plate.both and low < 0.0:
                size = cut(pool, size, 2, 0.0)
            size = _sum_before_plate(pieces, plate, first, size)
    _sum_pieces(pieces, plate, size, lanes)
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
def sum_exactly(triangles: Floats, plate: PlacedPlate, pieces: Pieces, count: int) -> tuple[float, bool]:
    """Return the closed form of the first `count` of pieces.slow [m], inf if saturated, and whether one touches."""
    half_x, half_y, both, triangle = plate.half_x, plate.half_y, plate.both, pieces.triangle
    total, touching = 0.0, False
    for i in range(count):
        k = pieces.slow[i]
        a, b, c = place_triangle(plate, triangles, k)
        write_triangle(a, b, c, triangle)
        touching = touching or contact(triangle, half_x, half_y, both) != CLEAR
        if not (plate.facing and not faces_centre(a, b, c, plate.rounding)):
            total += integral_over_triangle(triangle, triangles[k, SIZE], half_x, half_y, both, pieces.scratch)
    return total, touching


@inlined_kernel
def _sum_before_plate(pieces: Pieces, plate: PlacedPlate, first: int, size: int) -> int:
    """Sum those of the pieces from `first` on that are straight before the plate; return the new number of pieces.

    There 1/dist is 1/|z|, whose mean has a closed form that costs no more than a rule.
    """
    pool, half_x, half_y = pieces.pool, plate.half_x, plate.half_y
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
def _border_across(plate: PlacedPlate, lanes: Floats, i: int) -> int:
    """Return the axis of a border that runs through the piece in a lane, or IN_FOUR if there is none."""
    for axis in range(2):
        half = plate.half_x if axis == 0 else plate.half_y
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
def _sum_pieces(pieces: Pieces, plate: PlacedPlate, size: int, lanes: Floats) -> None:
    """Sum the pieces in the pool by point rules, cutting them as long as that pays; `made` tells who was given up."""
    # pieces are in the plate's frame, and what did not count is cut off
    here = PlacedPlate(_IDENTITY, plate.half_x, plate.half_y, True, False, (0.0, 0.0, 0.0), 0.0, 0.0)
    pool, in_done, rows, made = pieces.pool, pieces.in_done, pieces.rows, pieces.made
    in_done[:] = 0
    while size > 0:
        count = min(size, LANES)
        size -= count
        for i in range(count):
            rows[i] = size + i
        load(pool, PIECE_COLUMNS, rows, count, lanes, 0)
        for i in range(count):
            owner = int(lanes[OWNER * LANES + i])
            rows[i] = owner
            lanes[ALLOWED * LANES + i] = pieces.densities[owner] * lanes[SIZE * LANES + i]
            lanes[FIRST_RULE * LANES + i] = POINTS_1
        _measure(count, lanes)
        judge_loaded(count, here, lanes)
        for i in range(count):
            owner = rows[i]
            if made[owner] > MOST_PIECES:
                continue
            if lanes[VERDICT * LANES + i] > 0.0:
                pieces.errors[owner] += lanes[(FOUND + ERROR) * LANES + i]
                rule = int(lanes[RULE_FOUND * LANES + i])
                if rule == POINTS_1:
                    pieces.totals[owner] += lanes[(FOUND + SHIFT) * LANES + i]
                else:
                    _put_aside(pieces, rule - POINTS_3, i, lanes)
                continue
            step = _border_across(here, lanes, i)
            made[owner] += 3 if step == IN_FOUR else 2
            if made[owner] > MOST_PIECES:
                continue
            for column in range(OWNER + 1):
                pool[size, column] = lanes[column * LANES + i]
            first, size = size, size + 1
            if step == IN_FOUR:
                size = quarter(pool, size)
            else:
                size = cut(pool, size, step, here.half_x if step == 0 else here.half_y)
                size = _sum_before_plate(pieces, here, first, size)
        for k in range(3):
            if in_done[k] >= LANES:
                _sum_done(pieces, here, k, lanes)
    for k in range(3):
        if in_done[k] > 0:
            _sum_done(pieces, here, k, lanes)


@inlined_kernel
def _measure(count: int, lanes: Floats) -> None:
    """Write what a row of `Clusters.triangles` says of a triangle beside corners and area, from these."""
    for i in range(padded(count)):
        largest, squares = 0.0, 0.0
        x = lanes[CORNERS * LANES + i] + lanes[(CORNERS + 3) * LANES + i] + lanes[(CORNERS + 6) * LANES + i]
        y = lanes[(CORNERS + 1) * LANES + i] + lanes[(CORNERS + 4) * LANES + i] + lanes[(CORNERS + 7) * LANES + i]
        z = lanes[(CORNERS + 2) * LANES + i] + lanes[(CORNERS + 5) * LANES + i] + lanes[(CORNERS + 8) * LANES + i]
        x, y, z = _THIRD * x, _THIRD * y, _THIRD * z
        for corner in range(3):
            dx = lanes[(CORNERS + 3 * corner) * LANES + i] - x
            dy = lanes[(CORNERS + 3 * corner + 1) * LANES + i] - y
            dz = lanes[(CORNERS + 3 * corner + 2) * LANES + i] - z
            square = dx * dx + dy * dy + dz * dz
            squares += square
            largest = max(largest, square)
        lanes[REACH * LANES + i], lanes[SPREAD * LANES + i] = math.sqrt(largest), squares * (1.0 / 12.0)


@inlined_kernel
def _put_aside(pieces: Pieces, kind: int, i: int, lanes: Floats) -> None:
    row = pieces.in_done[kind]
    pieces.in_done[kind] = row + 1
    for column in range(OWNER + 1):
        pieces.done[kind, row, column] = lanes[column * LANES + i]
    pieces.done[kind, row, PIECE_REGION] = lanes[(FOUND + REGION) * LANES + i]
    pieces.done[kind, row, PIECE_SHIFT] = lanes[(FOUND + SHIFT) * LANES + i]


@leaf_kernel
def _sum_done(pieces: Pieces, plate: PlacedPlate, kind: int, lanes: Floats) -> None:
    """Sum the last pieces of a kind, as many as there are lanes."""
    count = min(pieces.in_done[kind], LANES)
    first = pieces.in_done[kind] - count
    pieces.in_done[kind] = first
    for i in range(count):
        pieces.rows[i] = first + i
    load(pieces.done[kind], PIECE_COLUMNS, pieces.rows, count, lanes, 0)
    for i in range(count):
        lanes[(FOUND + REGION) * LANES + i] = lanes[PIECE_REGION * LANES + i]
        lanes[(FOUND + SHIFT) * LANES + i] = lanes[PIECE_SHIFT * LANES + i]
    sum_by_points(POINTS_3 + kind, count, plate, lanes)
    for i in range(count):
        pieces.totals[int(lanes[OWNER * LANES + i])] += lanes[SUM * LANES + i]
