"""Opening the parts of a sum where that pays most, until their error bounds are within the budget."""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.prefetch import prefetch
from replay.sensing.capacitive.placed_plate import PlacedPlate, place
from replay.sensing.capacitive.tree.budget import Budget, SumTally, is_met
from replay.sensing.capacitive.tree.cluster_bounds import faces, judge_nodes, judge_sides
from replay.sensing.capacitive.tree.clusters import Clusters
from replay.sensing.capacitive.tree.parts import Room, doubt_and_least, pop, push
from replay.sensing.capacitive.tree.registers import (
    ABOVE,
    ALLOWED,
    BEGIN,
    CLUSTER,
    END,
    ERROR,
    FIRST_RULE,
    FOUND,
    FREE,
    KEEP,
    LANES,
    LEAST,
    LINE,
    MOMENT_COLUMNS,
    OPEN,
    PART,
    POINTS_1,
    RULE,
    RULE_FOUND,
    SECOND_CHILD,
    SECOND_OF_SECOND,
    VERDICT,
)
from replay.sensing.capacitive.tree.triangle_bounds import judge_triangles

_EFFORT_RULE = 0.5
"""What it costs to take a triangle's next rule, against opening a node."""


_TWO_LEVELS = 16.0
"""A node whose error is so many times what is allowed is opened two levels at once: an error falls by a factor of 2 to
11 from a node to its children."""


@inlined_kernel
def split_at_plane(clusters: Clusters, plate: PlacedPlate, room: Room) -> tuple[int, int, int]:
    """Put the nodes before the plate on the stack, and the triangles of leaves across z = 0 on the list of tasks.

    What is across has to be opened, whatever its error. Returns how many nodes are on the stack, how many triangles
    wait to be judged, and how many nodes were looked at.
    """
    stack, across, batch, openers, lanes = room.stack, room.across, room.batch, room.openers, room.lanes
    stack[0], across[0] = 0, 0
    if plate.both:
        return 1, 0, 0
    left, size, waiting, seen = 1, 0, 0, 0
    while left > 0:
        count = min(left, LANES)
        left -= count
        seen += count
        for i in range(count):
            batch[i] = across[left + i]
        judge_sides(clusters.outlines, batch, count, plate, lanes)
        opened = 0
        for i in range(count):
            verdict = lanes[VERDICT * LANES + i]
            stack[size], openers[opened] = batch[i], batch[i]
            size += verdict > 0.0
            opened += verdict == 0.0
        for k in range(opened):
            left, waiting = _put_parts(clusters, room, across, openers[k], False, left, waiting)
    return size, waiting, seen


@leaf_kernel
def refine(
    clusters: Clusters, plate: PlacedPlate, budget: Budget, room: Room, size: int, waiting: int, tally: SumTally
) -> tuple[int, float, int, SumTally]:
    """Judge the nodes on the stack and the triangles that wait, `size` and `waiting` many, and open the worst parts.

    It ends when the sum is good enough or a triangle is hard.

    Returns how many hard triangles, those without a rule, now are in `room.hard`, 0 when the parts are good enough; a
    lower bound of what these bring [m]; how many nodes were judged; and the tally.
    """
    judged = 0
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


@leaf_kernel
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
    keepers, openers = room.keepers, room.openers
    judged, least, doubt = 0, tally.least, tally.doubt
    while size > 0:
        count = min(size, LANES)
        size -= count
        judged += count
        for i in range(count):
            batch[i] = stack[size + i]
        judge_nodes(clusters.outlines, batch, count, plate, lanes)
        # told apart without branches, which no processor could foresee
        kept, opened = 0, 0
        for i in range(count):
            verdict = lanes[VERDICT * LANES + i]
            keep = (verdict > 0.0) & (lanes[(FOUND + ERROR) * LANES + i] <= limit)
            keepers[kept], openers[opened] = i, i
            kept += keep
            opened += (verdict >= 0.0) & (not keep)
        for k in range(kept):
            i = keepers[k]
            node, error = batch[i], lanes[(FOUND + ERROR) * LANES + i]
            side = faces(clusters.nodes, node, plate.centre) if plate.facing else KEEP
            if side == OPEN:
                openers[opened] = i
                opened += 1
            if side != KEEP:
                continue
            push(room.queue, node, CLUSTER, lanes, i, error * scale)
            for line in range(0, MOMENT_COLUMNS, LINE):
                prefetch(clusters.moments, node, line)
            least += lanes[(FOUND + LEAST) * LANES + i]
            doubt += error
        for k in range(opened):
            i = openers[k]
            # far too much of an error is too much for children, too
            far_off = (lanes[VERDICT * LANES + i] == 0.0) | (lanes[(FOUND + ERROR) * LANES + i] > _TWO_LEVELS * limit)
            size, waiting = _put_parts(clusters, room, stack, batch[i], far_off, size, waiting)
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
    begin = 0
    while begin < waiting:
        count = 0
        while count < LANES and begin < waiting:
            batch[count] = tasks[begin]
            lanes[FIRST_RULE * LANES + count], lanes[ALLOWED * LANES + count] = firsts[begin], allowed
            # what is behind the plate is left out here, again without branches
            count += plate.both | (_highest(triangles, batch[count], plate) >= -plate.rounding)
            begin += 1
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
def _highest(triangles: Floats, k: int, plate: PlacedPlate) -> float:
    """Return the largest z of a triangle's corners in the plate's frame [m]."""
    T = plate.T_plate_body
    return max(
        place(T, triangles[k, 0], triangles[k, 1], triangles[k, 2])[2],
        place(T, triangles[k, 3], triangles[k, 4], triangles[k, 5])[2],
        place(T, triangles[k, 6], triangles[k, 7], triangles[k, 8])[2],
    )


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
            size, waiting = _put_parts(clusters, room, room.stack, part, False, size, waiting)
        else:
            tasks[waiting], firsts[waiting] = part, (rule - ABOVE if rule >= ABOVE else rule) + 1
            waiting += 1
    return size, waiting, limit, SumTally(tally.done, tally.spent, least, doubt)


@inlined_kernel
def _put_parts(
    clusters: Clusters, room: Room, stack: Integers, node: int, grandchildren: bool, size: int, waiting: int
) -> tuple[int, int]:
    """Put a node's children on a stack, or these' children, or a leaf's triangles on the list of tasks.

    Returns the new sizes.
    """
    links, triangles = clusters.links, clusters.triangles
    tasks, firsts = room.tasks, room.firsts
    first, second = node + 1, links[node, SECOND_CHILD]
    if second >= 0:
        of_second = links[node, SECOND_OF_SECOND]
        if grandchildren and of_second >= 0 and links[first, SECOND_CHILD] >= 0:
            size = _put_node(clusters, stack, second + 1, size)
            size = _put_node(clusters, stack, of_second, size)
            size = _put_node(clusters, stack, first + 1, size)
            return _put_node(clusters, stack, links[first, SECOND_CHILD], size), waiting
        size = _put_node(clusters, stack, second, size)
        return _put_node(clusters, stack, first, size), waiting
    for k in range(links[node, BEGIN], links[node, END]):
        tasks[waiting], firsts[waiting] = k, POINTS_1
        prefetch(triangles, k, 0)
        prefetch(triangles, k, LINE)
        waiting += 1
    return size, waiting


@inlined_kernel
def _put_node(clusters: Clusters, stack: Integers, node: int, size: int) -> int:
    stack[size] = node
    prefetch(clusters.outlines, node, 0)
    prefetch(clusters.links, node, 0)
    return size + 1
