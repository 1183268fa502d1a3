"""The narrow phase of a block: level and clearance of the pairs and frames that the broad phase left."""

from __future__ import annotations

import numpy as np
from numba import float64, int64

from replay.collision import traversal
from replay.collision.bodies import BODIES_TYPE, Bodies
from replay.collision.gjk_exact import CONTACT, SEPARATED, UNDECIDED, workspace
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, REPEAT, RUN, PairFrames
from replay.collision.traversal import STACK, closest, contains_part
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel

COUNTS = traversal.COUNTS + 4
RUNS, SEEN_INSIDE, CONTACTS, UNDECIDEDS = range(traversal.COUNTS, COUNTS)
"""Rows of the counters after those of `traversal`: pair-frames looked at, contacts found by containment alone,
contacts, and pair-frames that stayed undecided."""


@entry(BODIES_TYPE, PAIR_FRAMES_TYPE, float64, int64[::1])
@kernel
def decide(bodies: Bodies, frames: PairFrames, limit: float, counts: Integers) -> None:
    """Finish the level, clearance and undecided of pairs in frames where their task asks for it.

    Args:
        bodies: of the scene.
        frames: as the broad phase left them.
        limit: clearances above it are left NaN [m]; 0 leaves all of them NaN.
        counts: (COUNTS,) added to.
    """
    work = workspace()
    nodes, gaps, seed = np.empty((STACK, 2), np.int64), np.empty(STACK), np.empty((7, 2), np.int64)
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for p in range(len(frames.pairs)):
        seed[0, 0], seed[0, 1] = -1, -1  # nothing is carried from one pair or block to the next
        for f in range(frames.task.shape[0]):
            if is_asked_for(frames, f, p, rotation, translation):
                a, b = frames.pairs[p, 0], frames.pairs[p, 1]
                status, distance = closest(bodies, a, b, rotation, translation, limit, seed, work, nodes, gaps, counts)
                # surfaces that are apart may still hold each other, where their volumes meet
                held = status == SEPARATED and frames.level[f, p] > 0 and (bodies.surface[a] or bodies.surface[b])
                if held and hold_each_other(bodies, a, b, rotation, translation):
                    status, distance = CONTACT, 0.0
                    counts[SEEN_INSIDE] += 1
                write_found(frames, f, p, status, distance, limit, counts)


@leaf_kernel
def is_asked_for(frames: PairFrames, f: int, p: int, rotation: Floats, translation: Floats) -> bool:
    """Return whether a pair is to be decided in a frame, and write its pose; a repeated frame takes the last answer."""
    if frames.task[f, p] == REPEAT:
        frames.level[f, p] = frames.level[f - 1, p]
        frames.clearance[f, p] = frames.clearance[f - 1, p]
        frames.undecided[f, p] = frames.undecided[f - 1, p]
    if frames.task[f, p] != RUN:
        return False
    q = frames.pairs[p, 2]
    for i in range(3):
        translation[i] = frames.poses[q, f, i, 3]
        for j in range(3):
            rotation[i, j] = frames.poses[q, f, i, j]
    return True


@kernel
def hold_each_other(bodies: Bodies, a: int, b: int, rotation: Floats, translation: Floats) -> bool:
    """Return whether one of two bodies, whose surfaces are apart, holds a part of the other; T_a_b given."""
    if bodies.surface[a] and contains_part(bodies, a, b, rotation, translation, False):
        return True
    return bodies.surface[b] and contains_part(bodies, b, a, rotation, translation, True)


@leaf_kernel
def write_found(
    frames: PairFrames, f: int, p: int, status: int, distance: float, limit: float, counts: Integers
) -> None:
    """Write what was found of a pair in a frame, and count it."""
    counts[RUNS] += 1
    if status != SEPARATED:
        frames.level[f, p] = 2
        counts[CONTACTS] += 1
    if status == UNDECIDED:
        frames.undecided[f, p] = True
        counts[UNDECIDEDS] += 1
    if limit > 0.0 and distance <= limit:
        frames.clearance[f, p] = distance
