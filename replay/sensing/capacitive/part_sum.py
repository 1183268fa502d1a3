"""The parts of a sum, once it is known how each is summed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.double_double import two_sum
from replay.numerics.jit import inlined_kernel
from replay.sensing.capacitive.cluster_bounds import ERROR, LEAST, SHIFT, R, X, Y, Z
from replay.sensing.capacitive.clusters import AREA, Clusters
from replay.sensing.capacitive.expansion import mean_by_moments
from replay.sensing.capacitive.part_queue import CLUSTER, FREE, PART, RULE, Queue, slots_used
from replay.sensing.capacitive.triangle_rules import PART_ABOVE, POINTS_1, mean_by_rule
from replay.sensing.capacitive.triangle_sum import into_plate

Floats = NDArray[np.float64]


@inlined_kernel
def doubt_and_least(queue: Queue, least: float) -> tuple[float, float]:
    """Return the sum of the parts' error bounds, and of their lower bounds and `least` [m]."""
    doubt = 0.0
    for slot in range(slots_used(queue)):
        if queue.labels[slot, RULE] != FREE:
            doubt += queue.values[slot, ERROR]
            least += queue.values[slot, LEAST]
    return doubt, least


@inlined_kernel
def sum_of_parts(
    clusters: Clusters,
    queue: Queue,
    T: Floats,
    half_x: float,
    half_y: float,
    total: float,
    lost: float,
    corners: Floats,
    terms: Floats,
) -> tuple[float, float]:
    """Return the sum of all parts and of total + lost [m], and what was lost in rounding it."""
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
            into_plate(T, clusters.triangles, part, corners)
            mean = mean_by_rule(rule, corners, 0, x, y, half_x, half_y, terms)
            value = clusters.areas[part] * mean + queue.values[slot, SHIFT]
        total, e = two_sum(total, value)
        lost += e
    return total, lost
