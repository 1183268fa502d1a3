"""Opening the parts of a sum where that pays most, until their error bounds are small enough; see `tree_sum`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import Tree
from replay.numerics.jit import leaf_kernel
from replay.sensing.capacitive.cluster_bounds import ERROR, KEEP, LEAST, OPEN, Triple, judge_cluster
from replay.sensing.capacitive.clusters import Clusters
from replay.sensing.capacitive.part_queue import CLUSTER, FREE, PART, RULE, Queue, pop, push
from replay.sensing.capacitive.part_sum import doubt_and_least
from replay.sensing.capacitive.triangle_bounds import judge_triangle
from replay.sensing.capacitive.triangle_rules import POINTS_1

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_EFFORT_INNER, _EFFORT_LEAF, _EFFORT_RULE = 1.0, 1.7, 0.5
"""What it costs to open a node, a leaf, or to take a triangle's next rule, one against the other."""


class Room(NamedTuple):
    """Memory of one sum, used again for the next."""

    queue: Queue
    stack: Ints  # nodes to judge, and triangles, counted on from the last node
    hard: Ints  # triangles without a rule
    found: Floats  # (VALUES,)
    corners: Floats  # (PIECES, 4, 3)
    whole: Floats  # (3, 3)
    scratch: Floats  # SCRATCH
    terms: Floats  # (RULE_POINTS,)


@leaf_kernel
def refine(
    clusters: Clusters,
    tree: Tree,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    centre: Triple,
    room: Room,
    size: int,
    limit: float,
    scale: float,
    rtol: float,
    total: float,
    least: float,
    doubt: float,
    spent: float,
) -> tuple[int, int, float, float]:
    """Judge what is on the stack, and open the worst parts until the sum is good enough or a triangle has no rule.

    Returns how many triangles without a rule now are in `room.hard`, 0 when the parts are good enough; how many nodes
    were judged; and the lower bound of the sum and the error of the parts so far [m].
    """
    queue, stack, hard, found = room.queue, room.stack, room.hard, room.found
    nodes, moments, triangles = clusters.nodes, clusters.moments, clusters.triangles
    first_triangle = len(nodes)
    first, allowed = POINTS_1, limit
    count, judged = 0, 0
    while True:
        while size > 0:
            size -= 1
            task = stack[size]
            if task < first_triangle:
                judged += 1
                verdict = judge_cluster(nodes, moments, task, T, half_x, half_y, both, facing, centre, found)
                inner = tree.second[task] >= 0
                if verdict == OPEN or (verdict == KEEP and found[ERROR] > limit):
                    size = _put_parts(tree, task, first_triangle, stack, size)
                    continue
                part, rule, effort = task, CLUSTER, _EFFORT_INNER if inner else _EFFORT_LEAF
            else:
                part, effort = task - first_triangle, _EFFORT_RULE
                verdict, rule = judge_triangle(
                    triangles,
                    clusters.areas,
                    clusters.parts,
                    part,
                    T,
                    half_x,
                    half_y,
                    both,
                    facing,
                    centre,
                    first,
                    allowed,
                    room.corners,
                    found,
                )
                if verdict == OPEN:
                    hard[count] = part
                    count += 1
            if verdict == KEEP:
                push(queue, part, rule, found, found[ERROR] * scale / effort)
                least += found[LEAST]
                doubt += found[ERROR]
        if count > 0:
            return count, judged, least, doubt
        if doubt + spent <= rtol * least:
            # once more, without the rounding of sums that went up and down
            doubt, least = doubt_and_least(queue, total - spent)
            if doubt + spent <= rtol * least:
                return 0, judged, least, doubt
        slot = pop(queue)
        if slot < 0:
            return 0, judged, least, doubt
        part, rule = queue.labels[slot, PART], queue.labels[slot, RULE]
        queue.labels[slot, RULE] = FREE
        doubt -= queue.values[slot, ERROR]
        least -= queue.values[slot, LEAST]
        limit = queue.values[slot, ERROR]
        first, allowed = POINTS_1, 0.5 * limit
        if rule == CLUSTER:
            size = _put_parts(tree, part, first_triangle, stack, 0)
        else:
            first = rule + 1
            stack[0], size = first_triangle + part, 1


@leaf_kernel
def _put_parts(tree: Tree, node: int, first_triangle: int, stack: Ints, size: int) -> int:
    """Put a node's children, or a leaf's triangles, on the stack; return its new size."""
    if tree.second[node] >= 0:
        stack[size], stack[size + 1] = tree.second[node], node + 1
        return size + 2
    for k in range(tree.begin[node], tree.end[node]):
        stack[size] = first_triangle + k
        size += 1
    return size
