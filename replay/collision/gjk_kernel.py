"""GJK on two convex vertex sets: do they meet, and how far apart are they; in doubles, with proofs.

A and B meet iff the Minkowski difference A - B holds the origin; their distance is its distance to the origin. The loop
keeps a simplex of 1..4 points of A - B, its point v nearest to the origin (an upper bound |v| on the distance) as a
direction d of any length, and asks for the point w of A - B that is lowest along d. Nothing in A - B is lower, so
d.w/|d| is a lower bound on the distance along -d, and w is the simplex's next point. At first, without a simplex, d is
the mean of B's vertices subtracted from that of A's: every query starts afresh, so that its answer depends on nothing
else, to the last bit. Divisions and roots wait until a bound is worth having.

Nothing is answered without a proof:
- SEPARATED: a lower bound minus its rounding error is above `cutoff` (0 asks for the boolean, inf for the distance),
  or lower and upper bound have met;
- CONTACT: the origin is in a tetrahedron of A - B by more than the rounding error;
- whatever ends otherwise (v too short for its direction to mean anything, a repeated or useless support point,
  a doubtful tetrahedron, the iteration cap) is decided by `gjk_exact`.

Rounding: with size >= max|a| + max|b| + |translation|, heights along a unit vector are good to 3u size for A and 9u
size for B (whose direction is rotated), so the lowest point found may be 2 (3u + 9u) size too high; mapping, the
difference and its inner product add 8u size. ROUNDING = 32u covers them.

Source: E. G. Gilbert, D. W. Johnson, S. S. Keerthi 1988; G. van den Bergen 1999 (bounds); the double-double half is
derived here.
"""

from __future__ import annotations

import math

import numpy as np

from replay.collision import simplex as faces
from replay.collision.exact_simplex import WITNESS
from replay.collision.gjk_exact import (
    CONTACT,
    DIRECTION,
    DISTANCE,
    EXACT,
    LEFT,
    LOWER,
    SEPARATED,
    STEPS,
    Workspace,
    keep_supporting,
    mapped,
    refine,
    turned_back,
    write_witness,
)
from replay.collision.support import Sets, farthest
from replay.numerics.arrays import Floats
from replay.numerics.jit import inlined_kernel
from replay.numerics.triples import dot

ITERATIONS = 48
"""Cap of the loop in doubles; random pairs of 642-vertex hulls need at most about 20. Beyond it, double-doubles."""

ROUNDING = 32.0 * 2.0**-53
"""Bound of the error of a lower bound on the gap, over size: see above."""

CLOSED = 1e-12
"""Relative duality gap at which a distance is accepted."""


@inlined_kernel
def query(
    a: Sets,
    set_a: int,
    b: Sets,
    set_b: int,
    rotation: Floats,
    translation: Floats,
    size: float,
    cutoff: float,
    slack: float,
    work: Workspace,
    precise: Floats | None,
) -> int:
    """Decide whether set_a of body a and set_b of body b meet; return SEPARATED, CONTACT, UNDECIDED or LEFT.

    Args:
        a, set_a: body and set within it.
        b, set_b: body and set within it.
        rotation: (3, 3) of T_a_b.
        translation: (3,) of T_a_b [m].
        size: max|a| + max|b| + |translation| or more [m]; errors are relative to it.
        cutoff: a proof that the distance is larger ends the search; 0 for a boolean, inf for the distance [m].
        slack: duality gap accepted besides the relative one [m]; 0 asks for every digit.
        work: scratch; `work.result` holds the outcome, witness points only where the distance was asked for.
        precise: scratch of `gjk_exact.refine`, which decides what doubles do not; None leaves it, and is compiled
            without `refine`, which is as large as all the rest and seldom needed.
    """
    simplex, points, weights, result = work.simplex, work.points, work.weights, work.result
    n = 0
    simplex[4, 0] = 0
    result[DISTANCE], result[LOWER], result[STEPS], result[EXACT] = np.inf, 0.0, 0.0, 0.0
    result[DIRECTION], result[DIRECTION + 1], result[DIRECTION + 2] = 0.0, 0.0, 0.0
    begin_a, end_a, table_a, side_a = a.first[set_a], a.first[set_a + 1], a.table[set_a], a.side[set_a]
    begin_b, end_b, table_b, side_b = b.first[set_b], b.first[set_b + 1], b.table[set_b], b.side[set_b]
    bound = ROUNDING * size
    shortest = np.inf
    for _ in range(ITERATIONS):
        if n == 0:  # the way from mean to mean is a point of A - B too, though of no simplex
            d = _between_means(a, set_a, b, set_b, rotation, translation)
            square = dot(d, d)
            if not square > bound * bound:
                d, square = (size, 0.0, 0.0), size * size
        else:
            # v, the simplex's nearest point: the upper bound
            place, d, square, wa, wb, wc, wd = _nearest(points, n, size)
            weights[0], weights[1], weights[2], weights[3] = wa, wb, wc, wd
            # CONTACT
            if place == faces.INSIDE:
                if not _witness_distance(points, n, weights) <= WITNESS * size:
                    break  # a flat tetrahedron: its shares are mostly rounding
                result[DISTANCE] = 0.0
                write_witness(a, b, rotation, translation, work)
                return CONTACT
            # a doubtful tetrahedron, no direction left in v, or v does not shrink
            if place == faces.UNSURE or not (bound * bound < square < shortest):
                break
            shortest = square
            n = keep_supporting(simplex, points, weights, n)
        result[STEPS] += 1.0
        # w, the point of A - B that is lowest along d: the lower bound
        i = farthest(a, begin_a, end_a, table_a, side_a, -d[0], -d[1], -d[2])
        x, y, z = turned_back(rotation, d[0], d[1], d[2])
        j = farthest(b, begin_b, end_b, table_b, side_b, x, y, z)
        x, y, z = mapped(b, j, rotation, translation)
        w = (a.flat[3 * i] - x, a.flat[3 * i + 1] - y, a.flat[3 * i + 2] - z)
        along = dot(d, w)
        if along > 0.0:
            lower = along / math.sqrt(dot(d, d)) - bound
            if lower > result[LOWER]:
                result[LOWER] = lower
                result[DIRECTION], result[DIRECTION + 1], result[DIRECTION + 2] = -d[0], -d[1], -d[2]
                # SEPARATED by more than is asked for
                if lower > cutoff:
                    result[DISTANCE] = lower
                    return SEPARATED
            length = math.sqrt(square)
            # SEPARATED, both bounds met
            if n > 0 and length - result[LOWER] <= CLOSED * length + slack:
                witness = _witness_distance(points, n, weights)
                if not max(abs(witness - length), result[LOWER] - length) <= CLOSED * length + slack + bound:
                    break  # a sliver's normal was off, and v with it
                result[DISTANCE] = length
                write_witness(a, b, rotation, translation, work)
                return SEPARATED
        # w joins the simplex, unless it is there
        repeated = False
        for k in range(n):
            repeated = repeated or (simplex[k, 0] == i and simplex[k, 1] == j)
        if repeated:
            break
        simplex[n, 0], simplex[n, 1] = i, j
        points[n, 0], points[n, 1], points[n, 2] = w
        n += 1
        simplex[4, 0] = n
    if precise is None:
        return LEFT
    return refine(a, set_a, b, set_b, rotation, translation, size, cutoff, work, precise)


@inlined_kernel
def _between_means(
    a: Sets, set_a: int, b: Sets, set_b: int, rotation: Floats, translation: Floats
) -> tuple[float, float, float]:
    """Return the mean of A's vertices less that of B's, in A's frame."""
    x, y, z = b.center[set_b, 0], b.center[set_b, 1], b.center[set_b, 2]
    return (
        a.center[set_a, 0] - (rotation[0, 0] * x + rotation[0, 1] * y + rotation[0, 2] * z + translation[0]),
        a.center[set_a, 1] - (rotation[1, 0] * x + rotation[1, 1] * y + rotation[1, 2] * z + translation[1]),
        a.center[set_a, 2] - (rotation[2, 0] * x + rotation[2, 1] * y + rotation[2, 2] * z + translation[2]),
    )


@inlined_kernel
def _witness_distance(points: Floats, n: int, weights: Floats) -> float:
    """Return the distance from the origin of the point of the simplex that the weights stand for."""
    x, y, z, total = 0.0, 0.0, 0.0, 0.0
    for k in range(n):
        x += weights[k] * points[k, 0]
        y += weights[k] * points[k, 1]
        z += weights[k] * points[k, 2]
        total += weights[k]
    return math.sqrt(x * x + y * y + z * z) / total


@inlined_kernel
def _nearest(points: Floats, n: int, size: float) -> faces.Near4:
    """Return `simplex.nearest_on_tetrahedron` of the first n points, 1 to 4."""
    a = (points[0, 0], points[0, 1], points[0, 2])
    if n == 1:
        return faces.OUTSIDE, a, dot(a, a), 1.0, 0.0, 0.0, 0.0
    b = (points[1, 0], points[1, 1], points[1, 2])
    if n == 2:
        point, square, wa, wb = faces.nearest_on_segment(a, b)
        return faces.OUTSIDE, point, square, wa, wb, 0.0, 0.0
    c = (points[2, 0], points[2, 1], points[2, 2])
    if n == 3:
        point, square, wa, wb, wc = faces.nearest_on_triangle(a, b, c)
        return faces.OUTSIDE, point, square, wa, wb, wc, 0.0
    d = (points[3, 0], points[3, 1], points[3, 2])
    return faces.nearest_on_tetrahedron(a, b, c, d, size)
