"""TODO"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import MAX_DEPTH, Tree
from replay.numerics.double_double import two_sum
from replay.numerics.jit import kernel, leaf_kernel
from replay.sensing.capacitive.cluster_bounds import (
    CLOSEST,
    DROP,
    ERROR,
    KEEP,
    LEAST,
    OPEN,
    SHIFT,
    R,
    X,
    Y,
    Z,
    judge_cluster,
)
from replay.sensing.capacitive.clusters import AREA, CENTROID, MEAN2, OUTWARD, PLACE, REACH, SPREAD, Clusters
from replay.sensing.capacitive.contact import CLEAR, contact
from replay.sensing.capacitive.exact import SCRATCH
from replay.sensing.capacitive.expansion import mean_by_moments
from replay.sensing.capacitive.refinement import (
    BUCKETS,
    CLUSTER,
    FREE,
    LABELS,
    PART,
    RULE,
    VALUES,
    Queue,
    empty,
    pop,
    push,
    slots_used,
)
from replay.sensing.capacitive.triangle_rules import (
    NO_RULE,
    PART_ABOVE,
    PIECES,
    POINTS_1,
    RULE_POINTS,
    borders,
    cheapest_rule,
    mean_by_rule,
    part_above,
    triangle_within,
)
from replay.sensing.capacitive.triangle_sum import faces_centre, into_plate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

_EFFORT_INNER, _EFFORT_LEAF, _EFFORT_RULE, _EFFORT_CUT = 1.0, 1.7, 0.5, 4.0
_FIRST_PARTS = 16.0
_HARD_SHARE = 1.0 / 128.0


class Room(NamedTuple):
    """Memory of one sum, used again for the next."""

    queue: Queue
    stack: Ints
    hard: Ints
    found: Floats
    corners: Floats
    whole: Floats
    scratch: Floats
    terms: Floats


@kernel
def sum_tree(
    clusters: Clusters,
    tree: Tree,
    T_plate_body: Floats,
    half_sizes: Floats,
    both: bool,
    facing: bool,
    rtol: float,
) -> tuple[Floats, Flags, Floats]:
    """Return what `sum_triangles` returns, to a relative tolerance, and the rigorous bound of the error.

    Args:
        clusters, tree: of the body, in its frame.
        T_plate_body: (n, p, 4, 4); half_sizes: (p, 2) [m]; both, facing: see `CapacitiveSensor`.
        rtol: largest relative error of each of the n x p integrals.

    Returns:
        (n, p) [m], inf when saturated; (n, p) flags: touching; (n, p) [m], bound of the error (0 when saturated).
    """
    capacity = len(clusters.triangles)
    room = Room(
        Queue(
            np.empty((capacity, VALUES)),
            np.empty((capacity, LABELS), np.int64),
            np.empty(BUCKETS, np.int64),
            np.empty(3, np.int64),
        ),
        np.empty(MAX_DEPTH + clusters.widest, np.int64),
        np.empty(capacity, np.int64),
        np.empty(VALUES),
        np.empty((PIECES, 4, 3)),
        np.empty((3, 3)),
        np.empty(SCRATCH),
        np.empty(RULE_POINTS),
    )
    n, plates = len(T_plate_body), len(half_sizes)
    integral, touching = np.zeros((n, plates)), np.zeros((n, plates), np.bool_)
    bound = np.zeros((n, plates))
    for frame in range(n):
        for plate in range(plates):
            T, half_x, half_y = T_plate_body[frame, plate], half_sizes[plate, 0], half_sizes[plate, 1]
            integral[frame, plate], touching[frame, plate], bound[frame, plate] = _sum_one(
                clusters, tree, T, half_x, half_y, both, facing, rtol, room
            )
    return integral, touching, bound


@kernel
def _sum_one(
    clusters: Clusters,
    tree: Tree,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    rtol: float,
    room: Room,
) -> tuple[float, bool, float]:
    queue, stack, hard, found = room.queue, room.stack, room.hard, room.found
    nodes, moments = clusters.nodes, clusters.moments
    triangles, areas, parts, corners = clusters.triangles, clusters.areas, clusters.parts, room.corners
    centre = (
        -(T[0, 0] * T[0, 3] + T[1, 0] * T[1, 3] + T[2, 0] * T[2, 3]),
        -(T[0, 1] * T[0, 3] + T[1, 1] * T[1, 3] + T[2, 1] * T[2, 3]),
        -(T[0, 2] * T[0, 3] + T[1, 2] * T[1, 3] + T[2, 2] * T[2, 3]),
    )
    empty(queue)
    ceiling = rtol * _least_of_root(nodes, T, half_x, half_y)
    scale = 1.0 / ceiling if ceiling > 0.0 else 1.0
    first_triangle = len(nodes)
    stack[0] = 0
    size, count = 1, 0
    first, limit = POINTS_1, ceiling / _FIRST_PARTS
    allowed = limit
    touching = False
    total, lost, least, doubt, spent = 0.0, 0.0, 0.0, 0.0, 0.0
    while True:
        if size > 0:
            size -= 1
            task = stack[size]
            if task < first_triangle:
                verdict = judge_cluster(nodes, moments, task, T, half_x, half_y, both, facing, centre, found)
                inner = tree.second[task] >= 0
                if verdict == OPEN or (verdict == KEEP and found[ERROR] > limit):
                    if inner:
                        stack[size], stack[size + 1] = tree.second[task], task + 1
                        size += 2
                    else:
                        for k in range(tree.begin[task], tree.end[task]):
                            stack[size] = first_triangle + k
                            size += 1
                    continue
                part, rule, effort = task, CLUSTER, _EFFORT_INNER if inner else _EFFORT_LEAF
            else:
                part, effort = task - first_triangle, _EFFORT_RULE
                verdict, rule = _judge_triangle(
                    triangles, areas, parts, part, T, half_x, half_y, both, facing, centre, first, allowed, corners, found
                )
                if verdict == OPEN:
                    hard[count] = part
                    count += 1
            if verdict == KEEP:
                push(queue, part, rule, found, found[ERROR] * scale / effort)
                least += found[LEAST]
                doubt += found[ERROR]
            continue
        if count > 0:
            count -= 1
            k = hard[count]
            into_plate(T, triangles, k, corners)
            low = min(corners[0, 0, 2], corners[0, 1, 2], corners[0, 2, 2])
            high = max(corners[0, 0, 2], corners[0, 1, 2], corners[0, 2, 2])
            touches = low <= 0.0 <= high and contact(corners[0], half_x, half_y, both) != CLEAR
            touching = touching or touches
            if (not both and high <= 0.0) or areas[k] <= 0.0 or (facing and not faces_centre(corners)):
                continue
            share = 0.0 if touches else max(0.0, _HARD_SHARE * (0.5 * rtol * least - spent))
            value, error = triangle_within(
                corners, areas[k], half_x, half_y, both, share, room.whole, room.scratch, room.terms
            )
            if value == math.inf:
                return math.inf, True, 0.0
            total, e = two_sum(total, value)
            lost += e
            least += value - error
            spent += error
            continue
        if doubt + spent <= rtol * least:
            # once more, without the rounding of sums that went up and down
            doubt, least = _doubt(queue, total - spent)
            if doubt + spent <= rtol * least:
                break
        slot = pop(queue)
        if slot < 0:
            break
        part, rule = queue.labels[slot, PART], queue.labels[slot, RULE]
        queue.labels[slot, RULE] = FREE
        doubt -= queue.values[slot, ERROR]
        least -= queue.values[slot, LEAST]
        limit = queue.values[slot, ERROR]
        first, allowed = POINTS_1, 0.5 * limit
        if rule != CLUSTER:
            first = rule + 1
            stack[0] = first_triangle + part
            size = 1
        elif tree.second[part] >= 0:
            stack[0], stack[1] = tree.second[part], part + 1
            size = 2
        else:
            for k in range(tree.begin[part], tree.end[part]):
                stack[size] = first_triangle + k
                size += 1
    total, lost = _evaluate(clusters, T, half_x, half_y, room, total, lost)
    return total + lost, touching, doubt + spent


@leaf_kernel
def _least_of_root(nodes: Floats, T: Floats, half_x: float, half_y: float) -> float:
    x, y, z = _place(T, nodes[0, CENTROID], nodes[0, CENTROID + 1], nodes[0, CENTROID + 2])
    u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
    square = u * u + v * v + z * z + nodes[0, MEAN2]
    return nodes[0, AREA] / math.sqrt(square) if square > 0.0 else 0.0


@leaf_kernel
def _place(T: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@leaf_kernel
def _judge_triangle(
    triangles: Floats,
    areas: Floats,
    parts: Floats,
    k: int,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    centre: tuple[float, float, float],
    first: int,
    allowed: float,
    corners: Floats,
    found: Floats,
) -> tuple[int, int]:
    x, y, z = _place(T, parts[k, PLACE], parts[k, PLACE + 1], parts[k, PLACE + 2])
    h = parts[k, REACH]
    placed = False
    if not both and z - h <= 0.0:
        if z + h < 0.0:
            return DROP, NO_RULE
        into_plate(T, triangles, k, corners)
        placed = True
        heights = (corners[0, 0, 2], corners[0, 1, 2], corners[0, 2, 2])
        if max(heights) < 0.0:
            return DROP, NO_RULE
        if min(heights) <= 0.0:
            if first != POINTS_1 or min(heights) == 0.0 or (facing and not faces_centre(corners)):
                return OPEN, NO_RULE
            value, error = part_above(corners, areas[k], parts[k, SPREAD], h, half_x, half_y)
            found[ERROR], found[SHIFT], found[LEAST] = error, value, max(0.0, value - error)
            return KEEP if error <= allowed else OPEN, PART_ABOVE
    u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
    r = math.sqrt(u * u + v * v + z * z)
    if r <= CLOSEST * h:
        return OPEN, NO_RULE
    if facing:
        side = _side_of_centre(parts, k, centre)
        if side == OPEN:
            if not placed:
                into_plate(T, triangles, k, corners)
                placed = True
            side = KEEP if faces_centre(corners) else DROP
        if side == DROP:
            return DROP, NO_RULE
    area, spread = areas[k], parts[k, SPREAD]
    shift, doubt = 0.0, 0.0
    if abs(abs(x) - half_x) < h or abs(abs(y) - half_y) < h or abs(x) + half_x < h or abs(y) + half_y < h:
        if not placed:
            into_plate(T, triangles, k, corners)
        shift, doubt, _ = borders(corners, 0, area, x, y, h, r, half_x, half_y)
    rule, error = cheapest_rule(first, area, spread, h, r, doubt, allowed)
    if rule == NO_RULE:
        return OPEN, rule
    found[X], found[Y], found[Z], found[R], found[ERROR], found[SHIFT] = x, y, z, r, error, shift
    found[LEAST] = area / math.sqrt(r * r + spread)
    return KEEP, rule


@leaf_kernel
def _side_of_centre(parts: Floats, k: int, centre: tuple[float, float, float]) -> int:
    """Return KEEP when a triangle faces the plate's centre, DROP when not, OPEN when `faces_centre` may round it."""
    a, b, c = parts[k, PLACE], parts[k, PLACE + 1], parts[k, PLACE + 2]
    nx, ny, nz = parts[k, OUTWARD], parts[k, OUTWARD + 1], parts[k, OUTWARD + 2]
    x, y, z = centre[0] - a, centre[1] - b, centre[2] - c
    along = nx * x + ny * y + nz * z
    extent = abs(a) + abs(b) + abs(c) + abs(centre[0]) + abs(centre[1]) + abs(centre[2]) + parts[k, REACH]
    margin = (1e-9 * (abs(nx) + abs(ny) + abs(nz)) + 1e-13 * parts[k, REACH] * extent) * (abs(x) + abs(y) + abs(z))
    return KEEP if along > margin else (DROP if along < -margin else OPEN)


@leaf_kernel
def _doubt(queue: Queue, least: float) -> tuple[float, float]:
    doubt = 0.0
    for slot in range(slots_used(queue)):
        if queue.labels[slot, RULE] != FREE:
            doubt += queue.values[slot, ERROR]
            least += queue.values[slot, LEAST]
    return doubt, least


@leaf_kernel
def _evaluate(
    clusters: Clusters, T: Floats, half_x: float, half_y: float, room: Room, total: float, lost: float
) -> tuple[float, float]:
    queue = room.queue
    for slot in range(slots_used(queue)):
        rule, part = queue.labels[slot, RULE], queue.labels[slot, PART]
        if rule == FREE:
            continue
        x, y, z, r = queue.values[slot, X], queue.values[slot, Y], queue.values[slot, Z], queue.values[slot, R]
        if rule == CLUSTER:
            u = x - math.copysign(half_x, x) if abs(x) > half_x else 0.0
            v = y - math.copysign(half_y, y) if abs(y) > half_y else 0.0
            mean = mean_by_moments(clusters.moments, part, T, u, v, z, r)
            value = clusters.nodes[part, AREA] * mean + queue.values[slot, SHIFT]
        elif rule == POINTS_1:
            value = clusters.areas[part] / r
        elif rule == PART_ABOVE:
            value = queue.values[slot, SHIFT]
        else:
            into_plate(T, clusters.triangles, part, room.corners)
            mean = mean_by_rule(rule, room.corners, 0, x, y, half_x, half_y, room.terms)
            value = clusters.areas[part] * mean + queue.values[slot, SHIFT]
        total, e = two_sum(total, value)
        lost += e
    return total, lost
