"""The narrow phase of a block: level and clearance of the pairs and frames that the broad phase left."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.collision import traversal
from replay.collision.bodies import Bodies
from replay.collision.gjk_exact import CONTACT, SEPARATED, UNDECIDED, workspace
from replay.collision.pair_frames import REPEAT, RUN, PairFrames
from replay.collision.scan import closest_of_all
from replay.collision.traversal import STACK, closest, contains_part
from replay.numerics.jit import kernel

Integers = NDArray[np.int64]

COUNTS = traversal.COUNTS + 4
RUNS, SEEN_INSIDE, CONTACTS, UNDECIDEDS = range(traversal.COUNTS, COUNTS)
"""Rows of the counters after those of `traversal`: pair-frames looked at, contacts found by containment alone,
contacts, and pair-frames that stayed undecided."""


@kernel
def decide(bodies: Bodies, frames: PairFrames, limit: float, counts: Integers, savings: bool) -> None:
    """Finish the level, clearance and undecided of pairs in frames where their task asks for it.

    Args:
        bodies: of the scene.
        frames: as the broad phase left them.
        limit: clearances above it are left NaN [m]; 0 leaves all of them NaN.
        counts: (COUNTS,) added to.
        savings: whether box trees and the last frame's answer may shorten the search.
    """
    pairs, poses, task = frames.pairs, frames.poses, frames.task
    level, clearance, undecided = frames.level, frames.clearance, frames.undecided
    work = workspace()
    nodes, gaps, seed = np.empty((STACK, 2), np.int64), np.empty(STACK), np.empty((7, 2), np.int64)
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for p in range(len(pairs)):
        a, b, q = pairs[p, 0], pairs[p, 1], pairs[p, 2]
        seed[0, 0], seed[0, 1] = -1, -1  # nothing is carried from one pair or block to the next
        for f in range(task.shape[0]):
            if task[f, p] == REPEAT:
                level[f, p], clearance[f, p], undecided[f, p] = (
                    level[f - 1, p],
                    clearance[f - 1, p],
                    undecided[f - 1, p],
                )
            if task[f, p] != RUN:
                continue
            for i in range(3):
                translation[i] = poses[q, f, i, 3]
                for j in range(3):
                    rotation[i, j] = poses[q, f, i, j]
            counts[RUNS] += 1
            if savings:
                status, distance = closest(bodies, a, b, rotation, translation, limit, seed, work, nodes, gaps, counts)
            else:
                status, distance = closest_of_all(bodies, a, b, rotation, translation, limit, work, counts)
            if status == SEPARATED and level[f, p] > 0:
                held = bodies.surface[a] and contains_part(bodies, a, b, rotation, translation, False)
                held = held or (bodies.surface[b] and contains_part(bodies, b, a, rotation, translation, True))
                if held:
                    status, distance = CONTACT, 0.0
                    counts[SEEN_INSIDE] += 1
            if status != SEPARATED:
                level[f, p] = 2
                counts[CONTACTS] += 1
            if status == UNDECIDED:
                undecided[f, p] = True
                counts[UNDECIDEDS] += 1
            if limit > 0.0 and distance <= limit:
                clearance[f, p] = distance
