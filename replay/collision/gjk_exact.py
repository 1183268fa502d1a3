"""GJK in double-doubles: the second opinion on queries that doubles cannot decide, ten to hundred times slower.

The sets are those of the doubles in A's frame: A's vertices as given, B's after mapping and rounding. Their differences
are exact as double-doubles, so a gap down to 2^-90 of the sets' size is told from a contact with a proof. Anything
nearer counts as touching: the poses themselves are known to 2^-53 only.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from replay.collision import exact_simplex
from replay.collision.support import Sets, candidates
from replay.numerics import double_double as dd
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import inlined_kernel, leaf_kernel, record_like

SEPARATED = 0
CONTACT = 1
UNDECIDED = 2
LEFT = 3
"""What a query ends with; LEFT: doubles do not decide it, and nothing else was wanted."""

ITERATIONS = 128
"""Cap of the loop; the hardest case seen (two 642-vertex spheres, gap 1e-14) needs 22. Reaching it is UNDECIDED."""

TOUCHING = 2.0**-90
"""Sets nearer than this times their size touch."""

INDISTINCT = 2.0**-53
"""Where neither a separating plane nor a nearer pair of points is found, points nearer than this times size are a
contact: coordinates are rounded by as much. Sheets of 1e-16 of their size through each other end here, 1 in 2 000."""

ROUNDING = 2.0**-94
"""Bound of the error of a lower bound on the gap, over size, in double-doubles."""

CLOSED = 2.0**-48
"""A duality gap below this times the distance ends the search: the distance is right to the last bits."""

SAFE = 1.0 - 2.0**-50
"""Keeps a lower bound below what its last division and root may have added."""

LISTED = 2.0**-44
"""A set's table is used if it leaves out only what is lower by this part of the size: rounding reaches 2^-50."""

# What a query leaves in `Workspace.result`.
DISTANCE = 0  # distance of the two witness points: an upper bound [m]; a lower one where that was above the cutoff
LOWER = 1  # verified lower bound on the distance [m]
DIRECTION = 2  # vector from A to B, of any length, that separates by LOWER, 3 numbers
POINT_A = 5  # witness points, in A's frame, 3 numbers each
POINT_B = 8
STEPS = 11  # iterations in doubles and double-doubles
EXACT = 12  # 1 if double-doubles were needed


class Workspace(NamedTuple):
    """Scratch of a query, kept by the caller."""

    simplex: Integers  # (5, 2): vertex rows of A and B of up to 4 points; [4, 0] = their number
    points: Floats  # (4, 3)
    weights: Floats  # (4,)
    result: Floats  # (16,), see DISTANCE..EXACT


def workspace() -> Workspace:
    """Return fresh scratch for queries."""
    return Workspace(np.zeros((5, 2), dtype=np.int64), np.zeros((4, 3)), np.zeros(4), np.zeros(16))


WORKSPACE_TYPE = record_like(workspace())


def precise_points() -> Floats:
    """Return scratch (4, 3, 2) for `refine`: the points of a simplex in double-doubles."""
    return np.zeros((4, 3, 2))


@inlined_kernel
def mapped(b: Sets, i: int, rotation: Floats, translation: Floats) -> tuple[float, float, float]:
    """Return B's vertex i in A's frame, rounded."""
    x, y, z = b.flat[3 * i], b.flat[3 * i + 1], b.flat[3 * i + 2]
    return (
        rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0],
        rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1],
        rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2],
    )


@inlined_kernel
def turned_back(rotation: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Return a direction of A's frame along B's axes."""
    return (
        rotation[0, 0] * x + rotation[1, 0] * y + rotation[2, 0] * z,
        rotation[0, 1] * x + rotation[1, 1] * y + rotation[2, 1] * z,
        rotation[0, 2] * x + rotation[1, 2] * y + rotation[2, 2] * z,
    )


@inlined_kernel
def keep_supporting(simplex: Integers, points: Floats, weights: Floats, n: int) -> int:
    """Drop the points (4, 3) of weight 0 from a simplex of n, in place; return how many remain."""
    kept = 0
    for i in range(n):
        if weights[i] > 0.0:
            if kept != i:
                simplex[kept, 0], simplex[kept, 1] = simplex[i, 0], simplex[i, 1]
                points[kept, 0], points[kept, 1], points[kept, 2] = points[i, 0], points[i, 1], points[i, 2]
                weights[kept] = weights[i]
            kept += 1
    simplex[4, 0] = kept
    return kept


@inlined_kernel
def write_witness(a: Sets, b: Sets, rotation: Floats, translation: Floats, work: Workspace) -> None:
    """Write the points of A and B that the simplex and its weights stand for, in A's frame."""
    result = work.result
    for axis in range(3):
        result[POINT_A + axis] = 0.0
        result[POINT_B + axis] = 0.0
    total = 0.0
    for k in range(work.simplex[4, 0]):
        total += work.weights[k]
    for k in range(work.simplex[4, 0]):
        weight = work.weights[k] / total
        i = work.simplex[k, 0]
        x, y, z = mapped(b, work.simplex[k, 1], rotation, translation)
        result[POINT_A] += weight * a.vertices[i, 0]
        result[POINT_A + 1] += weight * a.vertices[i, 1]
        result[POINT_A + 2] += weight * a.vertices[i, 2]
        result[POINT_B] += weight * x
        result[POINT_B + 1] += weight * y
        result[POINT_B + 2] += weight * z


@inlined_kernel
def _point(points: Floats, k: int, a: Sets, i: int, b: Sets, j: int, rotation: Floats, translation: Floats) -> None:
    x, y, z = mapped(b, j, rotation, translation)
    points[k, 0, 0], points[k, 0, 1] = dd.two_sum(a.vertices[i, 0], -x)
    points[k, 1, 0], points[k, 1, 1] = dd.two_sum(a.vertices[i, 1], -y)
    points[k, 2, 0], points[k, 2, 1] = dd.two_sum(a.vertices[i, 2], -z)


@leaf_kernel
def _farthest(
    sets: Sets, k: int, rotation: Floats, translation: Floats, direction: dd.Vector, is_b: bool, size: float
) -> int:
    """Return the vertex row of set k farthest along a direction (A's frame), compared in double-doubles."""
    x, y, z = direction[0][0], direction[1][0], direction[2][0]
    begin, end = sets.first[k], sets.first[k + 1]
    listed = sets.side[k] > 0 and sets.margin[k] > LISTED * size
    if listed:
        u, v, w = turned_back(rotation, x, y, z) if is_b else (x, y, z)
        begin, end = candidates(sets, sets.table[k], sets.side[k], u, v, w)
    top = -np.inf
    for e in range(begin, end):
        p = _placed(sets, sets.candidates[e] if listed else e, rotation, translation, is_b)
        top = max(top, p[0] * x + p[1] * y + p[2] * z)
    top -= 2.0**-48 * size * (abs(x) + abs(y) + abs(z))
    best, highest = 0, (-np.inf, 0.0)
    for e in range(begin, end):
        i = sets.candidates[e] if listed else e
        p = _placed(sets, i, rotation, translation, is_b)
        if p[0] * x + p[1] * y + p[2] * z >= top:
            height = dd.dot(((p[0], 0.0), (p[1], 0.0), (p[2], 0.0)), direction)
            if dd.is_less(highest, height):
                highest, best = height, i
    return best


@inlined_kernel
def _placed(sets: Sets, i: int, rotation: Floats, translation: Floats, is_b: bool) -> tuple[float, float, float]:
    """Return vertex i in A's frame."""
    if is_b:
        return mapped(sets, i, rotation, translation)
    return sets.flat[3 * i], sets.flat[3 * i + 1], sets.flat[3 * i + 2]


@leaf_kernel
def refine(
    a: Sets,
    set_a: int,
    b: Sets,
    set_b: int,
    rotation: Floats,
    translation: Floats,
    size: float,
    cutoff: float,
    work: Workspace,
    points: Floats,
) -> int:
    """Decide a query in double-doubles, from the simplex in `work`; arguments as `gjk_kernel.query`, and scratch."""
    simplex, weights, result = work.simplex, work.weights, work.result
    n = simplex[4, 0]
    for k in range(n):
        _point(points, k, a, simplex[k, 0], b, simplex[k, 1], rotation, translation)
    result[EXACT] = 1.0
    result[LOWER] = 0.0
    result[DIRECTION], result[DIRECTION + 1], result[DIRECTION + 2] = 0.0, 0.0, 0.0
    inside, v, square = exact_simplex.nearest(points, n, -1, size, weights)
    for _ in range(ITERATIONS):
        result[STEPS] += 1.0
        # v, the simplex's nearest point: the upper bound
        length = math.sqrt(square[0])
        result[DISTANCE] = length
        if inside or not length > TOUCHING * size:
            result[DISTANCE] = 0.0
            result[LOWER] = 0.0
            keep_supporting(simplex, work.points, weights, n)
            write_witness(a, b, rotation, translation, work)
            return CONTACT if inside or length <= TOUCHING * size else UNDECIDED
        n = keep_supporting(simplex, work.points, weights, n)
        for k in range(n):
            _point(points, k, a, simplex[k, 0], b, simplex[k, 1], rotation, translation)
        # w, the point of A - B that is lowest along v: the lower bound
        backward = (dd.negative(v[0]), dd.negative(v[1]), dd.negative(v[2]))
        i = _farthest(a, set_a, rotation, translation, backward, False, size)
        j = _farthest(b, set_b, rotation, translation, v, True, size)
        _point(points, n, a, i, b, j, rotation, translation)
        lower = SAFE * (dd.dot(v, exact_simplex.corner(points, n))[0] / length) - ROUNDING * size
        if lower > result[LOWER]:
            result[LOWER] = lower
            for axis in range(3):
                result[DIRECTION + axis] = -v[axis][0] / length
        repeated = False
        for k in range(n):
            repeated = repeated or (simplex[k, 0] == i and simplex[k, 1] == j)
        if result[LOWER] > cutoff or repeated or length - result[LOWER] <= CLOSED * length:
            break
        # w joins the simplex
        simplex[n, 0], simplex[n, 1] = i, j
        inside, nearer, square_nearer = exact_simplex.nearest(points, n + 1, n, size, weights)
        # equal lengths go on, since they still turn v; one that grows by more than its rounding ends the search
        if not inside and not math.sqrt(square_nearer[0]) <= length + ROUNDING * size:
            break
        v, square = nearer, square_nearer
        n += 1
        simplex[4, 0] = n
    # the verdict on what the search ended with
    n = simplex[4, 0]
    exact_simplex.nearest(points, n, -1, size, weights)
    write_witness(a, b, rotation, translation, work)
    if result[LOWER] > 0.0:
        return SEPARATED
    if result[DISTANCE] <= INDISTINCT * size:
        result[DISTANCE] = 0.0
        return CONTACT
    return UNDECIDED
