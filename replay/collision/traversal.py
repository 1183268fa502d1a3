"""Two bodies under box trees: their nearest convex sets by branch and bound, and whether one holds the other.

A node of A's tree is a box along A's axes, one of B's is turned by the relative rotation. The gaps along A's three axes
are those of two boxes along A's axes, so the norm of the positive ones is a lower bound on the distance; likewise along
B's axes. Pairs of nodes farther apart than the best distance so far are dropped, the nearer child is looked at first,
and what remains at the leaves is decided by GJK.
"""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64

from replay.collision.bodies import BODIES_TYPE, Bodies
from replay.collision.gjk_exact import CONTACT, DISTANCE, EXACT, LEFT, LOWER, SEPARATED, STEPS, UNDECIDED, Workspace
from replay.collision.gjk_kernel import ROUNDING, query
from replay.geometry.containment import inside
from replay.geometry.tree import MAX_DEPTH, Tree
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, kernel, leaf_kernel

STACK = 4 * MAX_DEPTH
"""Room for waiting node pairs: each of the at most 2 MAX_DEPTH splits on the way down leaves one behind."""

COUNTS = 4
BOXES, QUERIES, ITERATIONS, IN_DOUBLE_DOUBLE = range(COUNTS)
"""Rows of the counters: node pairs bounded, GJK queries, their iterations, and queries that needed 106 bits."""


@inlined_kernel
def box_gap(center: Floats, half: Floats, i: int, j: int, rotation: Floats, translation: Floats, slack: float) -> float:
    """Return a lower bound on the distance [m] of box i of body A and box j of body B, B at (R, t).

    Args:
        center, half: (m, 3) [m] of all boxes, such as the nodes of `Bodies`.
        i, j: rows.
        rotation, translation: (3, 3) and (3,) of T_a_b.
        slack: is subtracted [m].
    """
    r00, r01, r02 = rotation[0, 0], rotation[0, 1], rotation[0, 2]
    r10, r11, r12 = rotation[1, 0], rotation[1, 1], rotation[1, 2]
    r20, r21, r22 = rotation[2, 0], rotation[2, 1], rotation[2, 2]
    bx, by, bz = center[j, 0], center[j, 1], center[j, 2]
    dx = r00 * bx + r01 * by + r02 * bz + translation[0] - center[i, 0]
    dy = r10 * bx + r11 * by + r12 * bz + translation[1] - center[i, 1]
    dz = r20 * bx + r21 * by + r22 * bz + translation[2] - center[i, 2]
    ax, ay, az = half[i, 0], half[i, 1], half[i, 2]
    bx, by, bz = half[j, 0], half[j, 1], half[j, 2]
    # along A's axes
    x = max(0.0, abs(dx) - ax - abs(r00) * bx - abs(r01) * by - abs(r02) * bz)
    y = max(0.0, abs(dy) - ay - abs(r10) * bx - abs(r11) * by - abs(r12) * bz)
    z = max(0.0, abs(dz) - az - abs(r20) * bx - abs(r21) * by - abs(r22) * bz)
    square = x * x + y * y + z * z
    # along B's axes
    x = max(0.0, abs(r00 * dx + r10 * dy + r20 * dz) - bx - abs(r00) * ax - abs(r10) * ay - abs(r20) * az)
    y = max(0.0, abs(r01 * dx + r11 * dy + r21 * dz) - by - abs(r01) * ax - abs(r11) * ay - abs(r21) * az)
    z = max(0.0, abs(r02 * dx + r12 * dy + r22 * dz) - bz - abs(r02) * ax - abs(r12) * ay - abs(r22) * az)
    return math.sqrt(max(square, x * x + y * y + z * z)) - slack


@leaf_kernel
def closest(
    bodies: Bodies,
    a: int,
    b: int,
    rotation: Floats,
    translation: Floats,
    limit: float,
    seed: Integers,
    work: Workspace,
    precise: Floats | None,
    nodes: Integers,
    gaps: Floats,
    counts: Integers,
) -> tuple[int, float]:
    """Return (CONTACT | UNDECIDED | LEFT, 0), or (SEPARATED, distance [m] of the sets, inf if it is above `limit`).

    Args:
        bodies: of the scene.
        a, b: the two.
        rotation, translation: (3, 3) and (3,) of T_a_b.
        limit: larger distances are of no interest [m]; 0 asks for contact only.
        seed: (2,) the sets (global) that were nearest last time, -1 for none, which are looked at first; in and out.
            They save work and change no result.
        work, precise: scratch of GJK; LEFT is returned where a query needs `precise` and it is None.
        nodes, gaps: (STACK, 2), (STACK,) scratch.
        counts: (COUNTS, ...) added to.
    """
    size = bodies.reach[a] + bodies.reach[b]
    size += math.sqrt(translation[0] ** 2 + translation[1] ** 2 + translation[2] ** 2)
    slack = 2.0 * ROUNDING * size
    center, half = bodies.node_center, bodies.node_half
    best, found, undecided = limit, False, False
    nearest = np.inf
    tried_a, tried_b = seed[0], seed[1]
    set_a, set_b = tried_a, tried_b
    # the node pair on top of the stack, or, first, the seed
    waiting = 0
    if tried_a < 0:
        nodes[0, 0], nodes[0, 1] = 0, 0
        gaps[0] = box_gap(center, half, bodies.node_first[a], bodies.node_first[b], rotation, translation, slack)
        waiting = 1
        counts[BOXES] += 1
    first = tried_a >= 0
    while first or waiting > 0:
        if not first:
            waiting -= 1
            if gaps[waiting] > best:
                continue
            i, j = nodes[waiting, 0], nodes[waiting, 1]
            row_i, row_j = bodies.node_first[a] + i, bodies.node_first[b] + j
            child_i, child_j = bodies.tree.second[row_i], bodies.tree.second[row_j]
            if child_i >= 0 or child_j >= 0:
                # split the larger of the two; the nearer child goes on top
                split_a = child_j < 0 or (child_i >= 0 and _larger(half, row_i, row_j))
                i0, i1, j0, j1 = (i + 1, child_i, j, j) if split_a else (i, i, j + 1, child_j)
                shift_a, shift_b = bodies.node_first[a], bodies.node_first[b]
                gap0 = box_gap(center, half, shift_a + i0, shift_b + j0, rotation, translation, slack)
                gap1 = box_gap(center, half, shift_a + i1, shift_b + j1, rotation, translation, slack)
                counts[BOXES] += 2
                if gap0 < gap1:
                    i0, i1, j0, j1, gap0, gap1 = i1, i0, j1, j0, gap1, gap0
                if gap0 <= best:
                    nodes[waiting, 0], nodes[waiting, 1], gaps[waiting] = i0, j0, gap0
                    waiting += 1
                if gap1 <= best:
                    nodes[waiting, 0], nodes[waiting, 1], gaps[waiting] = i1, j1, gap1
                    waiting += 1
                continue
            # two leaves: their convex sets, unless the seed was these
            set_a = bodies.set_first[a] + bodies.tree.order[bodies.set_first[a] + bodies.tree.begin[row_i]]
            set_b = bodies.set_first[b] + bodies.tree.order[bodies.set_first[b] + bodies.tree.begin[row_j]]
            if set_a == tried_a and set_b == tried_b:
                continue
        status = query(bodies.sets, set_a, bodies.sets, set_b, rotation, translation, size, best, slack, work, precise)
        if status == LEFT:
            return LEFT, 0.0
        counts[QUERIES] += 1
        counts[ITERATIONS] += int(work.result[STEPS])
        counts[IN_DOUBLE_DOUBLE] += int(work.result[EXACT])
        distance = 0.0
        if status == SEPARATED:
            distance = work.result[DISTANCE]
            if distance <= best and limit > 0.0:
                best, found = distance, True
            distance = max(work.result[LOWER], 0.0)
        # the nearest sets seed the next frame
        if distance < nearest or status != SEPARATED:
            nearest = distance
            seed[0], seed[1] = set_a, set_b
        if status == CONTACT:
            return CONTACT, 0.0
        if status == UNDECIDED:
            undecided, best = True, 0.0  # from here on only a proven contact is better
        if first:
            first = False
            nodes[0, 0], nodes[0, 1] = 0, 0
            gaps[0] = box_gap(center, half, bodies.node_first[a], bodies.node_first[b], rotation, translation, slack)
            waiting = 1
            counts[BOXES] += 1
    if undecided:
        return UNDECIDED, 0.0
    return SEPARATED, best if found else np.inf


@leaf_kernel
def _larger(half: Floats, i: int, j: int) -> bool:
    larger: bool = half[i, 0] + half[i, 1] + half[i, 2] >= half[j, 0] + half[j, 1] + half[j, 2]
    return larger


@entry(BODIES_TYPE, int64, int64, float64[:, ::1], float64[::1], boolean)
@kernel
def contains_part(bodies: Bodies, a: int, b: int, rotation: Floats, translation: Floats, from_b: bool) -> bool:
    """Return whether body a's surface holds a connected part of b, the surfaces being apart.

    Args:
        bodies: of the scene.
        a: the body that may hold, a surface.
        b: the body that may be held.
        rotation, translation: of T_a_b, or of T_b_a if `from_b`.
        from_b: see above.
    """
    nodes, sets = bodies.node_first[a], bodies.set_first[a]
    nodes_end, sets_end = bodies.node_first[a + 1], bodies.set_first[a + 1]
    tree = Tree(
        bodies.tree.lower[nodes:nodes_end],
        bodies.tree.upper[nodes:nodes_end],
        bodies.tree.second[nodes:nodes_end],
        bodies.tree.begin[nodes:nodes_end],
        bodies.tree.end[nodes:nodes_end],
        bodies.tree.order[sets:sets_end],
    )
    begin, end = bodies.sets.first[sets], bodies.sets.first[sets_end]
    triangles = bodies.sets.vertices[begin:end].reshape((sets_end - sets, 3, 3))
    closing = bodies.closing[bodies.closing_first[a] : bodies.closing_first[a + 1]]
    point = np.empty(3)
    for k in range(bodies.probe_first[b], bodies.probe_first[b + 1]):
        for axis in range(3):
            point[axis] = 0.0 if from_b else translation[axis]
            for other in range(3):
                if from_b:
                    point[axis] += rotation[other, axis] * (bodies.probes[k, other] - translation[other])
                else:
                    point[axis] += rotation[axis, other] * bodies.probes[k, other]
        if inside(point, triangles, tree, closing) == 1:
            return True
    return False
