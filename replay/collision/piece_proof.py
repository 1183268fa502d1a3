"""Two bodies that stay apart over an interval, piece by piece: what the whole bodies' bound cannot prove.

The trees of both bodies are walked down together. Nodes whose boxes are farther apart at both ends, added up, than the
bodies can approach each other are proven. Pairs of convex sets at the leaves are asked for their distance at both ends,
and where that is not enough for bounds along directions (`directed`): the separating directions at both ends, their
mean, and each without its part along the way that the pieces take. One pair that is not proven fails the interval.

A surface that is open but has an inside may hold what has entered by its opening without touching it; that is looked
for at the moments that are looked at, not proven in between.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from replay.collision.bodies import Bodies
from replay.collision.directed import Lines, apart_along
from replay.collision.gjk_exact import DIRECTION, LOWER, SEPARATED, Workspace
from replay.collision.gjk_kernel import ROUNDING, query
from replay.collision.support import Sets
from replay.collision.traversal import QUERIES, STACK, box_gap
from replay.collision.way_steps import Scratch
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import leaf_kernel, record_like

MOST_PIECES = 512
"""Cap of pairs of convex sets looked at for one interval; shorter ones have fewer that are near."""


class Ends(NamedTuple):
    """T_a_b at both ends of an interval, and what is asked of the pieces there."""

    rotation: Floats  # (2, 3, 3)
    translation: Floats  # (2, 3)
    normal: Floats  # (2, 3) separating directions from A to B, in A's frame
    candidate: Floats  # (3,) direction that is tried, in A's frame
    nodes: Integers  # (STACK, 2)


def ends() -> Ends:
    """Return scratch."""
    return Ends(np.empty((2, 3, 3)), np.empty((2, 3)), np.empty((2, 3)), np.empty(3), np.empty((STACK, 2), np.int64))


ENDS_TYPE = record_like(ends())


@leaf_kernel
def write_end(end: int, relative: Floats, e: Ends) -> None:
    """Write T_a_b (4, 4) of one end."""
    for i in range(3):
        e.translation[end, i] = relative[i, 3]
        for j in range(3):
            e.rotation[end, i, j] = relative[i, j]


@leaf_kernel
def apart_by_pieces(
    bodies: Bodies,
    a: int,
    b: int,
    way: float,
    split: int,
    n: int,
    size: float,
    slack: float,
    s: Scratch,
    d: Lines,
    e: Ends,
    work: Workspace,
    precise: Floats,
    counts: Integers,
) -> float:
    """Return a proven lower bound on the distance of two bodies over an interval [m]; not above 0 where none is proven.

    Args:
        bodies: of the scene.
        a, b: the two.
        way: no point of one moves farther in the interval as seen from the other [m].
        split, n: the link m is after so many of n steps from A to B.
        size: of bodies and way, what GJK's rounding is relative to [m].
        slack: rounding of a bound along a direction [m].
        s, d, e: travel, arms and lines of the steps, poses at both ends.
        work: of GJK.
        counts: as of `traversal`.
    """
    bound, pieces, waiting = np.inf, 0, 1
    rounding = 2.0 * ROUNDING * size
    e.nodes[0, 0], e.nodes[0, 1] = 0, 0
    while waiting > 0:
        waiting -= 1
        i, j = e.nodes[waiting, 0], e.nodes[waiting, 1]
        row_i, row_j = bodies.node_first[a] + i, bodies.node_first[b] + j
        gap = -way
        for end in range(2):
            apart = box_gap(
                bodies.node_center, bodies.node_half, row_i, row_j, e.rotation[end], e.translation[end], rounding
            )
            gap += max(apart, 0.0)
        if gap > 0.0:
            bound = min(bound, 0.5 * gap)
            continue
        child_i, child_j = bodies.tree.second[row_i], bodies.tree.second[row_j]
        if child_i >= 0 or child_j >= 0:
            half = bodies.node_half
            larger = (
                half[row_i, 0] + half[row_i, 1] + half[row_i, 2] >= half[row_j, 0] + half[row_j, 1] + half[row_j, 2]
            )
            if child_j < 0 or (child_i >= 0 and larger):
                e.nodes[waiting, 0], e.nodes[waiting, 1] = i + 1, j
                e.nodes[waiting + 1, 0], e.nodes[waiting + 1, 1] = child_i, j
            else:
                e.nodes[waiting, 0], e.nodes[waiting, 1] = i, j + 1
                e.nodes[waiting + 1, 0], e.nodes[waiting + 1, 1] = i, child_j
            waiting += 2
            continue
        pieces += 1
        if pieces > MOST_PIECES:
            return 0.0
        set_a = bodies.set_first[a] + bodies.tree.order[bodies.set_first[a] + bodies.tree.begin[row_i]]
        set_b = bodies.set_first[b] + bodies.tree.order[bodies.set_first[b] + bodies.tree.begin[row_j]]
        apart = sets_apart(bodies.sets, set_a, set_b, 0.0, way, split, n, size, slack, s, d, e, work, precise, counts)
        if not apart > 0.0:
            return 0.0
        bound = min(bound, apart)
    return bound


@leaf_kernel
def sets_apart(
    sets: Sets,
    set_a: int,
    set_b: int,
    pad: float,
    way: float,
    split: int,
    n: int,
    size: float,
    slack: float,
    s: Scratch,
    d: Lines,
    e: Ends,
    work: Workspace,
    precise: Floats,
    counts: Integers,
) -> float:
    """Return what `apart_by_pieces` does, of two convex sets that are thicker by `pad` together [m]."""
    total = -way - 2.0 * pad
    rounding = 2.0 * ROUNDING * size
    for end in range(2):
        rotation, translation, cutoff = e.rotation[end], e.translation[end], way + 2.0 * pad
        status = query(sets, set_a, sets, set_b, rotation, translation, size, cutoff, rounding, work, precise)
        counts[QUERIES] += 1
        if status != SEPARATED:
            return 0.0
        total += work.result[LOWER]
        for k in range(3):
            e.normal[end, k] = work.result[DIRECTION + k]
        _normalise(e.normal[end])
    if total > 0.0:
        return 0.5 * total
    best = 0.0
    for attempt in range(8):
        end, choice = attempt % 2, attempt // 2
        normal, other = e.normal[end], e.normal[1 - end]
        for k in range(3):
            if choice == 1:
                e.candidate[k] = other[k]
            elif choice == 2:
                e.candidate[k] = normal[k] + other[k]
            else:
                e.candidate[k] = normal[k]
        if choice == 3:
            _without_way(e)
        if not _normalise(e.candidate):
            continue
        pose = d.pose[end, 0]
        for k in range(3):
            d.normal[k] = pose[k, 0] * e.candidate[0] + pose[k, 1] * e.candidate[1] + pose[k, 2] * e.candidate[2]
        best = max(best, apart_along(sets, (set_a, set_b), end, split, n, slack, s, d) - pad)
        if best > 0.0:
            break
    return best


@leaf_kernel
def apart_in_world(sets: Sets, a: int, b: int, n: int, slack: float, s: Scratch, d: Lines) -> float:
    """Return a proven lower bound on the distance of two boxes along the world's axes over an interval [m].

    Along such an axis a box and the turned box that it is around reach as far. The way is the one over the world.

    Args:
        sets: whose rows a and b are the turned boxes.
        a, b: see above.
        n, slack, s, d: as of `apart_by_pieces`.
    """
    split = 0
    while split < n and s.side[split] == 0:
        split += 1
    best = 0.0
    for attempt in range(12):
        axis, end = attempt // 4, attempt // 2 % 2
        d.normal[0], d.normal[1], d.normal[2] = 0.0, 0.0, 0.0
        d.normal[axis] = 1.0 if attempt % 2 == 0 else -1.0
        best = max(best, apart_along(sets, (a, b), end, split, n, slack, s, d))
        if best > 0.0:
            break
    return best


@leaf_kernel
def _without_way(e: Ends) -> None:
    """Take from the candidate its part along the way of B's origin in A's frame."""
    x = e.translation[1, 0] - e.translation[0, 0]
    y = e.translation[1, 1] - e.translation[0, 1]
    z = e.translation[1, 2] - e.translation[0, 2]
    square = x * x + y * y + z * z
    if square > 0.0:
        share = (e.candidate[0] * x + e.candidate[1] * y + e.candidate[2] * z) / square
        e.candidate[0] -= share * x
        e.candidate[1] -= share * y
        e.candidate[2] -= share * z


@leaf_kernel
def _normalise(v: Floats) -> bool:
    """Make a vector a unit vector, in place; return whether it has a direction."""
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if not length > 1e-100:
        return False
    for k in range(3):
        v[k] /= length
    return True
