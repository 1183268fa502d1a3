"""Two bodies without their box trees: every convex set of one against all of the other, from no earlier answer."""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.collision.bodies import BODIES_TYPE, Bodies
from replay.collision.gjk_exact import (
    CONTACT,
    DISTANCE,
    EXACT,
    SEPARATED,
    STEPS,
    UNDECIDED,
    WORKSPACE_TYPE,
    Workspace,
    precise_points,
    workspace,
)
from replay.collision.gjk_kernel import ROUNDING, query
from replay.collision.narrow import SEEN_INSIDE, hold_each_other, is_asked_for, write_found
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, PairFrames
from replay.collision.traversal import IN_DOUBLE_DOUBLE, ITERATIONS, QUERIES
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel


@leaf_kernel
def closest_of_all(
    bodies: Bodies,
    a: int,
    b: int,
    rotation: Floats,
    translation: Floats,
    limit: float,
    work: Workspace,
    precise: Floats,
    counts: Integers,
) -> tuple[int, float]:
    """Return what `traversal.closest` returns; arguments as there. A contact is the only early end."""
    size = bodies.reach[a] + bodies.reach[b]
    size += math.sqrt(translation[0] ** 2 + translation[1] ** 2 + translation[2] ** 2)
    slack = 2.0 * ROUNDING * size
    best, found, undecided = limit, False, False
    for set_a in range(bodies.set_first[a], bodies.set_first[a + 1]):
        for set_b in range(bodies.set_first[b], bodies.set_first[b + 1]):
            status = query(
                bodies.sets, set_a, bodies.sets, set_b, rotation, translation, size, best, slack, work, precise
            )
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


def decide_without_savings(bodies: Bodies, frames: PairFrames, limit: float, counts: Integers) -> None:
    """Do as `narrow.decide`, by every convex set of one body against all of the other."""
    decide_each(bodies, frames, limit, workspace(), precise_points(), counts)


@entry(BODIES_TYPE, PAIR_FRAMES_TYPE, float64, WORKSPACE_TYPE, float64[:, :, ::1], int64[::1])
@kernel
def decide_each(
    bodies: Bodies, frames: PairFrames, limit: float, work: Workspace, precise: Floats, counts: Integers
) -> None:
    """Do what `decide_without_savings` does, in arrays that it has made."""
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for p in range(len(frames.pairs)):
        for f in range(frames.task.shape[0]):
            if is_asked_for(frames, f, p, rotation, translation):
                a, b = frames.pairs[p, 0], frames.pairs[p, 1]
                status, distance = closest_of_all(bodies, a, b, rotation, translation, limit, work, precise, counts)
                # surfaces that are apart may still hold each other, where their volumes meet
                held = status == SEPARATED and frames.level[f, p] > 0 and (bodies.surface[a] or bodies.surface[b])
                if held and hold_each_other(bodies, a, b, rotation, translation):
                    status, distance = CONTACT, 0.0
                    counts[SEEN_INSIDE] += 1
                write_found(frames, f, p, status, distance, limit, counts)
