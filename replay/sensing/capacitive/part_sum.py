"""The parts of a sum, once it is known how each is summed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.numerics.double_double import two_sum
from replay.numerics.gauss import TRIANGLE_7, TRIANGLE_16
from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.prefetch import prefetch
from replay.sensing.capacitive.cluster_bounds import ERROR, FOUND, LEAST, REGION, SHIFT, place, sides_of
from replay.sensing.capacitive.clusters import MOMENT_COLUMNS, NUMBER, PART_COLUMNS, PLACE, WHOLE, Clusters
from replay.sensing.capacitive.expansion import mean_by_moments
from replay.sensing.capacitive.lanes import LANES, load, padded
from replay.sensing.capacitive.part_queue import CLUSTER, FREE, PART, RULE, RULES, VALUES, Queue, slots_used
from replay.sensing.capacitive.point_sums import SUM, TRIANGLE_3, sum_by_points
from replay.sensing.capacitive.triangle_rules import PART_ABOVE, POINTS_1, POINTS_3, POINTS_7, POINTS_16

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]

_LINE = 8
"""Numbers in a line of memory."""


@inlined_kernel
def doubt_and_least(queue: Queue, least: float) -> tuple[float, float]:
    """Return the sum of the parts' error bounds, and of their lower bounds and `least` [m]."""
    doubt = 0.0
    for slot in range(slots_used(queue)):
        if queue.labels[slot, RULE] != FREE:
            doubt += queue.values[slot, ERROR]
            least += queue.values[slot, LEAST]
    return doubt, least


@leaf_kernel
def sum_of_parts(
    clusters: Clusters,
    queue: Queue,
    T: Floats,
    half_x: float,
    half_y: float,
    lists: Ints,
    batch: Ints,
    lanes: Floats,
) -> tuple[float, float, int, int, int]:
    """Return the sum of all parts [m], what was lost in rounding it, and how many clusters, triangles in them and other
    triangles it has. `lists` (RULES + 1, n) is scratch memory.
    """
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
        value, triangles = _clusters(clusters, queue, lists, begin, count, T, half_x, half_y, batch, lanes)
        total, e = two_sum(total, value)
        lost += e
        in_clusters += triangles
    for rule in (POINTS_3, POINTS_7, POINTS_16):
        points = TRIANGLE_3 if rule == POINTS_3 else (TRIANGLE_7 if rule == POINTS_7 else TRIANGLE_16)
        for begin in range(0, filled[rule], LANES):
            count = min(filled[rule] - begin, LANES)
            value = _triangles(clusters, queue, points, lists, rule, begin, count, T, half_x, half_y, batch, lanes)
            total, e = two_sum(total, value)
            lost += e
    alone = filled[POINTS_1] + filled[PART_ABOVE] + filled[POINTS_3] + filled[POINTS_7] + filled[POINTS_16]
    return total, lost, filled[CLUSTER], in_clusters, alone


@inlined_kernel
def _load_parts(
    rows: Floats,
    columns: int,
    queue: Queue,
    lists: Ints,
    rule: int,
    begin: int,
    count: int,
    batch: Ints,
    lanes: Floats,
) -> None:
    """Write what was found of some parts in the list of a rule, and their rows, to the lanes."""
    for i in range(count):
        batch[i] = lists[rule, begin + i]
    load(queue.values, VALUES, batch, count, lanes, FOUND)
    for i in range(count):
        batch[i] = queue.labels[batch[i], PART]
    load(rows, columns, batch, count, lanes, 0)


@leaf_kernel
def _clusters(
    clusters: Clusters,
    queue: Queue,
    lists: Ints,
    begin: int,
    count: int,
    T: Floats,
    half_x: float,
    half_y: float,
    batch: Ints,
    lanes: Floats,
) -> tuple[float, int]:
    """Return the sum over some clusters in their list [m], and the number of their triangles."""
    _load_parts(clusters.moments, MOMENT_COLUMNS, queue, lists, CLUSTER, begin, count, batch, lanes)
    for i in range(padded(count)):
        x, y, z = place(T, lanes[PLACE * LANES + i], lanes[(PLACE + 1) * LANES + i], lanes[(PLACE + 2) * LANES + i])
        sx, sy = sides_of(lanes[(FOUND + REGION) * LANES + i])
        mean = mean_by_moments(lanes, i, T, abs(sx), abs(sy), abs(sx) * x - sx * half_x, abs(sy) * y - sy * half_y, z)
        lanes[SUM * LANES + i] = lanes[WHOLE * LANES + i] * mean + lanes[(FOUND + SHIFT) * LANES + i]
    total, triangles = 0.0, 0
    for i in range(count):
        total += lanes[SUM * LANES + i]
        triangles += int(lanes[NUMBER * LANES + i])
    return total, triangles


@leaf_kernel
def _triangles(
    clusters: Clusters,
    queue: Queue,
    points: Floats,
    lists: Ints,
    rule: int,
    begin: int,
    count: int,
    T: Floats,
    half_x: float,
    half_y: float,
    batch: Ints,
    lanes: Floats,
) -> float:
    """Return the sum over some triangles in the list of a rule [m], each in the region of its centroid."""
    _load_parts(clusters.parts, PART_COLUMNS, queue, lists, rule, begin, count, batch, lanes)
    sum_by_points(points, count, T, half_x, half_y, FOUND + REGION, FOUND + SHIFT, lanes)
    total = 0.0
    for i in range(count):
        total += lanes[SUM * LANES + i]
    return total
