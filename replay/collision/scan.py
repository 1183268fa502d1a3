"""Two bodies without their box trees: every convex set of one against all of the other, from no earlier answer."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.collision.bodies import Bodies
from replay.collision.gjk_exact import CONTACT, DISTANCE, EXACT, SEPARATED, STEPS, UNDECIDED, Workspace
from replay.collision.gjk_kernel import ROUNDING, query
from replay.collision.traversal import IN_DOUBLE_DOUBLE, ITERATIONS, QUERIES
from replay.numerics.jit import leaf_kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


@leaf_kernel
def closest_of_all(
    bodies: Bodies,
    a: int,
    b: int,
    rotation: Floats,
    translation: Floats,
    limit: float,
    work: Workspace,
    counts: Integers,
) -> tuple[int, float]:
    """Return what `traversal.closest` returns; arguments as there. A contact is the only early end."""
    size = bodies.reach[a] + bodies.reach[b]
    size += math.sqrt(translation[0] ** 2 + translation[1] ** 2 + translation[2] ** 2)
    slack = 2.0 * ROUNDING * size
    best, found, undecided = limit, False, False
    for set_a in range(bodies.set_first[a], bodies.set_first[a + 1]):
        for set_b in range(bodies.set_first[b], bodies.set_first[b + 1]):
            work.simplex[4, 0] = 0
            status = query(bodies.sets, set_a, bodies.sets, set_b, rotation, translation, size, best, slack, work)
            counts[QUERIES] += 1
            counts[ITERATIONS] += int(work.result[STEPS])
            counts[IN_DOUBLE_DOUBLE] += int(work.result[EXACT])
            if status == CONTACT:
                return CONTACT, 0.0
            if status == UNDECIDED:
                undecided, best = True, 0.0  # from here on only a proven contact is better
            elif status == SEPARATED and work.result[DISTANCE] <= best and limit > 0.0:
                best, found = work.result[DISTANCE], True
    if undecided:
        return UNDECIDED, 0.0
    return SEPARATED, best if found else np.inf
