"""Opening the parts of a sum where that pays most, until their error bounds are within the budget."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.prefetch import prefetch
from replay.sensing.capacitive.placed_plate import PlacedPlate, beyond_borders, place
from replay.sensing.capacitive.tree.cluster_bounds import faces, judge_nodes
from replay.sensing.capacitive.tree.clusters import Clusters
from replay.sensing.capacitive.tree.parts import Room, doubt_and_least, pop, push
from replay.sensing.capacitive.tree.registers import (
    ALLOWED,
    AREA,
    BEGIN,
    CENTROID,
    CLUSTER,
    DROP,
    END,
    ERROR,
    FIRST_RULE,
    FOUND,
    FREE,
    KEEP,
    LANES,
    LEAST,
    MEAN2,
    PART,
    POINTS_1,
    RULE,
    RULE_FOUND,
    SECOND_CHILD,
    VERDICT,
)
from replay.sensing.capacitive.tree.triangle_bounds import judge_triangles

Floats = NDArray[np.float64]

_EFFORT_RULE = 0.5
"""What it costs to take a triangle's next rule, against opening a node."""


_FIRST_PARTS = 100.0
"""A part with more than this fraction of the whole error is opened before the errors are compared."""


class Budget(NamedTuple):
    """What is asked of a sum.

    Attributes:
        rtol: largest relative error.
        first: a part with a larger error is opened before the errors are compared [m].
        scale: brings the errors of parts to the order of 1 at most [1/m].
    """

    rtol: float
    first: float
    scale: float


class SumTally(NamedTuple):
    """What is known of a sum.

    Attributes:
        done: sum over the triangles without a rule, as far as they are summed [m].
        spent: bound of the error of `done` [m].
        least: lower bound of the whole sum [m].
        doubt: sum of the error bounds of the parts in the queue [m].
    """

    done: float
    spent: float
    least: float
    doubt: float


@inlined_kernel
def budget_of(nodes: Floats, plate: PlacedPlate, rtol: float) -> Budget:
    """Return the budget of a sum over all of a body's `Clusters.nodes`."""
    ceiling = rtol * _least_of_root(nodes, plate)
    return Budget(rtol, ceiling / _FIRST_PARTS, 1.0 / ceiling if ceiling > 0.0 else 1.0)


@inlined_kernel
def is_met(budget: Budget, tally: SumTally) -> bool:
    """Return whether the error bounds are small enough."""
    return tally.doubt + tally.spent <= budget.rtol * tally.least


@inlined_kernel
def _least_of_root(nodes: Floats, plate: PlacedPlate) -> float:
    """Return a lower bound of the integral over all triangles [m], by Jensen."""
    x, y, z = place(plate.T_plate_body, nodes[0, CENTROID], nodes[0, CENTROID + 1], nodes[0, CENTROID + 2])
    u, v = beyond_borders(x, y, plate.half_x, plate.half_y)
    square = u * u + v * v + z * z + nodes[0, MEAN2]
    return nodes[0, AREA] / math.sqrt(square) if square > 0.0 else 0.0


@leaf_kernel
def refine(
    clusters: Clusters, plate: PlacedPlate, budget: Budget, room: Room, size: int, tally: SumTally
) -> tuple[int, float, int, SumTally]:
    """Judge the `size` nodes on the stack, and open the worst parts until the sum is good enough or a triangle is hard.

    Returns how many hard triangles, those without a rule, now are in `room.hard`, 0 when the parts are good enough; a
    lower bound of what these bring [m]; how many nodes were judged; and the tally.
    """
    waiting, judged = 0, 0
    limit = allowed = budget.first
    while True:
        waiting, opened, tally = _settle_nodes(clusters, plate, room, size, waiting, limit, budget.scale, tally)
        judged += opened
        hard, in_hard, tally = _settle_triangles(clusters.triangles, plate, room, waiting, allowed, budget.scale, tally)
        if hard > 0:
            return hard, in_hard, judged, tally
        if is_met(budget, tally):
            # once more, without the rounding of sums that went up and down
            doubt, least = doubt_and_least(room.queue, tally.done - tally.spent)
            tally = SumTally(tally.done, tally.spent, least, doubt)
            if is_met(budget, tally):
                return 0, 0.0, judged, tally
        size, waiting, limit, tally = _open_worst(clusters, budget, room, tally)
        if size == 0 and waiting == 0:
            return 0, 0.0, judged, tally
        allowed = 0.5 * limit


@inlined_kernel
def _settle_nodes(
    clusters: Clusters,
    plate: PlacedPlate,
    room: Room,
    size: int,
    waiting: int,
    limit: float,
    scale: float,
    tally: SumTally,
) -> tuple[int, int, SumTally]:
    """Judge the nodes on the stack and those below: up to an error of `limit` [m] they become parts, else are opened.

    Returns how many triangles wait to be judged, how many nodes were judged, and the tally.
    """
    stack, batch, lanes = room.stack, room.batch, room.lanes
    judged, least, doubt = 0, tally.least, tally.doubt
    while size > 0:
        count = min(size, LANES)
        size -= count
        judged += count
        for i in range(count):
            batch[i] = stack[size + i]
        judge_nodes(clusters.outlines, batch, count, plate, lanes)
        for i in range(count):
            node, verdict, error = batch[i], lanes[VERDICT * LANES + i], lanes[(FOUND + ERROR) * LANES + i]
            if verdict < 0.0:
                continue
            keep = (verdict > 0.0) & (error <= limit)
            if keep and plate.facing:
                side = faces(clusters.nodes, node, plate.centre)
                if side == DROP:
                    continue
                keep = side == KEEP
            if keep:
                push(room.queue, node, CLUSTER, lanes, i, error * scale)
                least += lanes[(FOUND + LEAST) * LANES + i]
                doubt += error
            else:
                size, waiting = _put_parts(clusters, room, node, size, waiting)
    return waiting, judged, SumTally(tally.done, tally.spent, least, doubt)


@inlined_kernel
def _settle_triangles(
    triangles: Floats, plate: PlacedPlate, room: Room, waiting: int, allowed: float, scale: float, tally: SumTally
) -> tuple[int, float, SumTally]:
    """Judge the triangles that wait: those with a rule of an error up to `allowed` [m] become parts, others are hard.

    Returns how many are hard, a lower bound of what these bring [m], and the tally.
    """
    tasks, firsts, batch, lanes = room.tasks, room.firsts, room.batch, room.lanes
    hard, in_hard, least, doubt = 0, 0.0, tally.least, tally.doubt
    for begin in range(0, waiting, LANES):
        count = min(waiting - begin, LANES)
        for i in range(count):
            batch[i] = tasks[begin + i]
            lanes[FIRST_RULE * LANES + i], lanes[ALLOWED * LANES + i] = firsts[begin + i], allowed
        judge_triangles(triangles, batch, count, plate, lanes)
        for i in range(count):
            verdict, error = lanes[VERDICT * LANES + i], lanes[(FOUND + ERROR) * LANES + i]
            if verdict > 0.0:
                rule = int(lanes[RULE_FOUND * LANES + i])
                push(room.queue, batch[i], rule, lanes, i, error * scale / _EFFORT_RULE)
                least += lanes[(FOUND + LEAST) * LANES + i]
                doubt += error
            elif verdict == 0.0:
                room.hard[hard] = batch[i]
                hard += 1
                # one that does not face the plate may be among them
                in_hard += 0.0 if plate.facing else lanes[(FOUND + LEAST) * LANES + i]
    return hard, in_hard, SumTally(tally.done, tally.spent, least, doubt)


@inlined_kernel
def _open_worst(clusters: Clusters, budget: Budget, room: Room, tally: SumTally) -> tuple[int, int, float, SumTally]:
    """Open the worst parts, at least as much error as there is too much.

    Returns how many nodes are on the stack, how many triangles wait to be judged, the least error that was opened [m],
    and the tally of the parts that are left.
    """
    queue, tasks, firsts = room.queue, room.tasks, room.firsts
    least, doubt = tally.least, tally.doubt
    excess, opened, limit = doubt + tally.spent - budget.rtol * least, 0.0, math.inf
    size, waiting = 0, 0
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
            size, waiting = _put_parts(clusters, room, part, size, waiting)
        else:
            tasks[waiting], firsts[waiting] = part, rule + 1
            waiting += 1
    return size, waiting, limit, SumTally(tally.done, tally.spent, least, doubt)


@inlined_kernel
def _put_parts(clusters: Clusters, room: Room, node: int, size: int, waiting: int) -> tuple[int, int]:
    """Put a node's children on the stack, or a leaf's triangles on the list of tasks; return the new sizes."""
    links, outlines, triangles = clusters.links, clusters.outlines, clusters.triangles
    stack, tasks, firsts = room.stack, room.tasks, room.firsts
    second = links[node, SECOND_CHILD]
    if second >= 0:
        stack[size], stack[size + 1] = second, node + 1
        prefetch(outlines, second, 0)
        prefetch(links, second, 0)
        return size + 2, waiting
    for k in range(links[node, BEGIN], links[node, END]):
        tasks[waiting], firsts[waiting] = k, POINTS_1
        prefetch(triangles, k, 0)
        prefetch(triangles, k, 8)
        waiting += 1
    return size, waiting
