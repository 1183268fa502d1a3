"""The parts of a sum, once it is known how each is summed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.numerics.double_double import two_sum
from replay.numerics.gauss import TRIANGLE_7, TRIANGLE_16
from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.prefetch import prefetch
from replay.sensing.capacitive.tree.clusters import MOMENT_COLUMNS, NUMBER, PLACE, TRIANGLE_COLUMNS, WHOLE, Clusters
from replay.sensing.capacitive.tree.expansion import mean_by_moments
from replay.sensing.capacitive.tree.lanes import FOUND, LANES, REGION, SHIFT, SUM, load, padded
from replay.sensing.capacitive.tree.part_queue import CLUSTER, PART, RULE, RULES, VALUES, slots_used
from replay.sensing.capacitive.placed_plate import PlacedPlate, place, sides_of
from replay.sensing.capacitive.tree.point_sums import TRIANGLE_3, sum_by_points
from replay.sensing.capacitive.tree.room import Room
from replay.sensing.capacitive.tree.triangle_rules import PART_ABOVE, POINTS_1, POINTS_3, POINTS_7, POINTS_16

Floats = NDArray[np.float64]

_LINE = 8
"""Numbers in a line of memory."""


@leaf_kernel
def sum_of_parts(clusters: Clusters, plate: PlacedPlate, room: Room) -> tuple[float, float, int, int, int]:
    """Return the sum of all parts in the queue [m], what was lost in rounding it, and how many clusters, triangles in
    them and other triangles it has.
    """
    queue, lists = room.queue, room.lists
    filled = lists[RULES]
    for rule in range(RULES):
        filled[rule] = 0
    for slot in range(slots_used(queue)):
        # no branches, which no processor could foresee
        kind = np.uint64(queue.labels[slot, RULE])
        lists[kind, np.uint64(filled[kind])] = slot
        filled[kind] += 1
    for at in range(filled[CLUSTER]):
        for line in range(0, MOMENT_COLUMNS, _LINE):
            prefetch(clusters.moments, queue.labels[lists[CLUSTER, at], PART], line)
    total, lost, in_clusters = 0.0, 0.0, 0
    for rule in (POINTS_1, PART_ABOVE):
        for at in range(filled[rule]):
            total += queue.values[lists[rule, at], SHIFT]
    for begin in range(0, filled[CLUSTER], LANES):
        count = min(filled[CLUSTER] - begin, LANES)
        value, triangles = _clusters(clusters.moments, plate, room, begin, count)
        total, e = two_sum(total, value)
        lost += e
        in_clusters += triangles
    for rule in (POINTS_3, POINTS_7, POINTS_16):
        points = TRIANGLE_3 if rule == POINTS_3 else (TRIANGLE_7 if rule == POINTS_7 else TRIANGLE_16)
        for begin in range(0, filled[rule], LANES):
            count = min(filled[rule] - begin, LANES)
            value = _triangles(clusters.triangles, plate, room, rule, begin, count, points)
            total, e = two_sum(total, value)
            lost += e
    alone = filled[POINTS_1] + filled[PART_ABOVE] + filled[POINTS_3] + filled[POINTS_7] + filled[POINTS_16]
    return total, lost, filled[CLUSTER], in_clusters, alone


@inlined_kernel
def _load_parts(rows: Floats, columns: int, room: Room, rule: int, begin: int, count: int) -> None:
    """Write what was found of some parts in the list of a rule, and their rows, to the lanes."""
    queue, batch, lanes = room.queue, room.batch, room.lanes
    for i in range(count):
        batch[i] = room.lists[rule, begin + i]
    load(queue.values, VALUES, batch, count, lanes, FOUND)
    for i in range(count):
        batch[i] = queue.labels[batch[i], PART]
    load(rows, columns, batch, count, lanes, 0)


@leaf_kernel
def _clusters(moments: Floats, plate: PlacedPlate, room: Room, begin: int, count: int) -> tuple[float, int]:
    """Return the sum over some clusters in their list [m], and the number of their triangles."""
    _load_parts(moments, MOMENT_COLUMNS, room, CLUSTER, begin, count)
    T, half_x, half_y, lanes = plate.T_plate_body, plate.half_x, plate.half_y, room.lanes
    for i in range(padded(count)):
        x, y, z = place(T, lanes[PLACE * LANES + i], lanes[(PLACE + 1) * LANES + i], lanes[(PLACE + 2) * LANES + i])
        sx, sy = sides_of(lanes[(FOUND + REGION) * LANES + i])
        components = (abs(sx) * x - sx * half_x, abs(sy) * y - sy * half_y, z)
        mean = mean_by_moments(lanes, i, T, (sx, sy), components)
        lanes[SUM * LANES + i] = lanes[WHOLE * LANES + i] * mean + lanes[(FOUND + SHIFT) * LANES + i]
    total, triangles = 0.0, 0
    for i in range(count):
        total += lanes[SUM * LANES + i]
        triangles += int(lanes[NUMBER * LANES + i])
    return total, triangles


@leaf_kernel
def _triangles(
    triangles: Floats, plate: PlacedPlate, room: Room, rule: int, begin: int, count: int, points: Floats
) -> float:
    """Return the sum over some triangles in the list of a rule [m], each in the region of its centroid."""
    _load_parts(triangles, TRIANGLE_COLUMNS, room, rule, begin, count)
    lanes = room.lanes
    sum_by_points(points, count, plate, FOUND + REGION, FOUND + SHIFT, lanes)
    total = 0.0
    for i in range(count):
        total += lanes[SUM * LANES + i]
    return total
