"""Opening the parts of a sum where that pays most, until their error bounds are small enough; see `tree_sum`."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.prefetch import prefetch
from replay.sensing.capacitive.cluster_bounds import (
    DROP,
    ERROR,
    FOUND,
    KEEP,
    LEAST,
    VERDICT,
    Triple,
    faces,
    judge_nodes,
)
from replay.sensing.capacitive.clusters import BEGIN, END, SECOND_CHILD, Clusters
from replay.sensing.capacitive.hard_triangles import Pieces
from replay.sensing.capacitive.lanes import LANES
from replay.sensing.capacitive.part_queue import CLUSTER, FREE, PART, RULE, Queue, pop, push
from replay.sensing.capacitive.part_sum import doubt_and_least
from replay.sensing.capacitive.triangle_bounds import ALLOWED, FIRST, judge_triangles
from replay.sensing.capacitive.triangle_bounds import RULE as RULE_FOUND
from replay.sensing.capacitive.triangle_rules import POINTS_1

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_EFFORT_RULE = 0.5
"""What it costs to take a triangle's next rule, against opening a node."""


class Room(NamedTuple):
    """Memory of one sum, used again for the next."""

    queue: Queue
    stack: Ints  # (n,) nodes to judge
    tasks: Ints  # (n,) triangles to judge
    firsts: Ints  # (n,) the first rule to try on each
    hard: Ints  # (n,) triangles without a rule
    lists: Ints  # (RULES + 1, n) of slots of the queue
    batch: Ints  # (LANES,)
    lanes: Floats  # (COLUMNS x LANES,)
    corners: Floats  # (1, 3, 3)
    scratch: Floats  # SCRATCH
    pieces: Pieces


@leaf_kernel
def refine(
    clusters: Clusters,
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
    blur: float,
    total: float,
    least: float,
    doubt: float,
    spent: float,
) -> tuple[int, int, float, float, float]:
    """Judge what is on the stack, and open the worst parts until the sum is good enough or a triangle has no rule.

    Returns how many triangles without a rule now are in `room.hard`, 0 when the parts are good enough; how many nodes
    were judged; the lower bound of the sum and the error of the parts so far; and a lower bound of what the triangles
    without a rule bring [m].
    """
    queue, stack, tasks, firsts, hard = room.queue, room.stack, room.tasks, room.firsts, room.hard
    batch, lanes = room.batch, room.lanes
    nodes, outlines = clusters.nodes, clusters.outlines
    waiting, judged, allowed = 0, 0, limit
    while True:
        while size > 0:
            count = min(size, LANES)
            size -= count
            judged += count
            for i in range(count):
                batch[i] = stack[size + i]
            judge_nodes(outlines, batch, count, T, half_x, half_y, both, blur, lanes)
            for i in range(count):
                node, verdict, error = batch[i], lanes[VERDICT * LANES + i], lanes[(FOUND + ERROR) * LANES + i]
                if verdict < 0.0:
                    continue
                keep = (verdict > 0.0) & (error <= limit)
                if keep and facing:
                    side = faces(nodes, node, centre)
                    if side == DROP:
                        continue
                    keep = side == KEEP
                if keep:
                    push(queue, node, CLUSTER, lanes, i, error * scale)
                    least += lanes[(FOUND + LEAST) * LANES + i]
                    doubt += error
                else:
                    size, waiting = _put_parts(clusters, node, stack, size, tasks, firsts, waiting)
        hard_ones, in_hard = 0, 0.0
        for begin in range(0, waiting, LANES):
            count = min(waiting - begin, LANES)
            for i in range(count):
                batch[i] = tasks[begin + i]
                lanes[FIRST * LANES + i], lanes[ALLOWED * LANES + i] = firsts[begin + i], allowed
            judge_triangles(clusters.parts, batch, count, T, half_x, half_y, both, facing, lanes)
            for i in range(count):
                verdict, error = lanes[VERDICT * LANES + i], lanes[(FOUND + ERROR) * LANES + i]
                if verdict > 0.0:
                    rule = int(lanes[RULE_FOUND * LANES + i])
                    push(queue, batch[i], rule, lanes, i, error * scale / _EFFORT_RULE)
                    least += lanes[(FOUND + LEAST) * LANES + i]
                    doubt += error
                elif verdict == 0.0:
                    hard[hard_ones] = batch[i]
                    hard_ones += 1
                    # one that does not face the plate may be among them
                    in_hard += 0.0 if facing else lanes[(FOUND + LEAST) * LANES + i]
        waiting = 0
        if hard_ones > 0:
            return hard_ones, judged, least, doubt, in_hard
        if doubt + spent <= rtol * least:
            # once more, without the rounding of sums that went up and down
            doubt, least = doubt_and_least(queue, total - spent)
            if doubt + spent <= rtol * least:
                return 0, judged, least, doubt, 0.0
        # open at least as much error as there is too much
        excess, opened, limit = doubt + spent - rtol * least, 0.0, math.inf
        while opened < excess:
            slot = pop(queue)
            if slot < 0:
                break
            part, rule, error = queue.labels[slot, PART], queue.labels[slot, RULE], queue.values[slot, ERROR]
            queue.labels[slot, RULE] = FREE
            doubt -= error
            least -= queue.values[slot, LEAST]
            opened += error
            limit = min(limit, error)
            if rule == CLUSTER:
                size, waiting = _put_parts(clusters, part, stack, size, tasks, firsts, waiting)
            else:
                tasks[waiting], firsts[waiting] = part, rule + 1
                waiting += 1
        if size == 0 and waiting == 0:
            return 0, judged, least, doubt, 0.0
        allowed = 0.5 * limit


@inlined_kernel
def _put_parts(
    clusters: Clusters, node: int, stack: Ints, size: int, tasks: Ints, firsts: Ints, waiting: int
) -> tuple[int, int]:
    """Put a node's children on the stack, or a leaf's triangles on the list of tasks; return the new sizes."""
    links, outlines, parts = clusters.links, clusters.outlines, clusters.parts
    second = links[node, SECOND_CHILD]
    if second >= 0:
        stack[size], stack[size + 1] = second, node + 1
        prefetch(outlines, second, 0)
        prefetch(links, second, 0)
        return size + 2, waiting
    for k in range(links[node, BEGIN], links[node, END]):
        tasks[waiting], firsts[waiting] = k, POINTS_1
        prefetch(parts, k, 0)
        prefetch(parts, k, 8)
        waiting += 1
    return size, waiting
