"""The narrow phase of a block: level and clearance of the pairs and frames that the broad phase left."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float64, int64, uint8

from replay.collision import traversal
from replay.collision.bodies import BODIES_TYPE, Bodies
from replay.collision.gjk_exact import CONTACT, LEFT, SEPARATED, UNDECIDED, Workspace, precise_points, workspace
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, REPEAT, RUN, PairFrames
from replay.collision.traversal import STACK, closest, contains_part
from replay.numerics.arrays import Bytes, Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, kernel, leaf_kernel, rare_entry, record_like

COUNTS = traversal.COUNTS + 4
RUNS, SEEN_INSIDE, CONTACTS, UNDECIDEDS = range(traversal.COUNTS, COUNTS)
"""Rows of the counters after those of `traversal`: pair-frames looked at, contacts found by containment alone,
contacts, and pair-frames that stayed undecided."""


def decide(bodies: Bodies, frames: PairFrames, limit: float, counts: Integers) -> None:
    """Finish the level, clearance and undecided of pairs in frames where their task asks for it.

    Nearly all is decided by GJK in doubles; what else it takes is as much code again, which few scenes call: kernels of
    their own, compiled when they are called first.

    Args:
        bodies: of the scene.
        frames: as the broad phase left them.
        limit: clearances above it are left NaN [m]; 0 leaves all of them NaN.
        counts: (COUNTS,) added to.
    """
    left = np.ones(len(frames.pairs), np.uint8)
    held = np.zeros(frames.task.shape, np.uint8)
    scratch = _scratch(len(counts))
    decide_by_doubles(bodies, frames, limit, left, held, scratch, counts)
    if left.any():
        decide_all(bodies, frames, limit, left, held, scratch, precise_points(), counts)
    if held.any():
        look_inside(bodies, frames, limit, held, counts)


class _Scratch(NamedTuple):
    """What a pair is decided with, and the counters of the one at hand."""

    work: Workspace
    nodes: Integers
    gaps: Floats
    seed: Integers
    rotation: Floats
    translation: Floats
    counts: Integers


def _scratch(counts: int = COUNTS) -> _Scratch:
    return _Scratch(
        workspace(),
        np.empty((STACK, 2), np.int64),
        np.empty(STACK),
        np.empty(2, np.int64),
        np.empty((3, 3)),
        np.empty(3),
        np.zeros(counts, np.int64),
    )


_DECIDES = (BODIES_TYPE, PAIR_FRAMES_TYPE, float64, uint8[::1], uint8[:, ::1], record_like(_scratch()))


@entry(*_DECIDES, int64[::1])
@leaf_kernel
def decide_by_doubles(
    bodies: Bodies, frames: PairFrames, limit: float, left: Bytes, held: Bytes, s: _Scratch, counts: Integers
) -> None:
    """Decide pairs as far as doubles do.

    Args:
        bodies, frames, limit, counts: as `decide` has them.
        left: (P,) which pairs to decide; 0 from then on for those that are.
        held: (n, P) out: 1 where surfaces are apart and may still hold each other.
        s: overwritten.
    """
    for p in range(len(frames.pairs)):
        if left[p] and _decide_pair(bodies, frames, p, limit, held, s, None):
            left[p] = 0
            _add(counts, s.counts)


@rare_entry(*_DECIDES, float64[:, :, ::1], int64[::1])
@leaf_kernel
def decide_all(
    bodies: Bodies,
    frames: PairFrames,
    limit: float,
    left: Bytes,
    held: Bytes,
    s: _Scratch,
    precise: Floats,
    counts: Integers,
) -> None:
    """Decide pairs that are `left`, by double-doubles where doubles do not; arguments as `decide_by_doubles`."""
    for p in range(len(frames.pairs)):
        if left[p]:
            _decide_pair(bodies, frames, p, limit, held, s, precise)
            _add(counts, s.counts)


@leaf_kernel
def _add(counts: Integers, more: Integers) -> None:
    for k in range(len(counts)):
        counts[k] += more[k]


@rare_entry(BODIES_TYPE, PAIR_FRAMES_TYPE, float64, uint8[:, ::1], int64[::1])
@kernel
def look_inside(bodies: Bodies, frames: PairFrames, limit: float, held: Bytes, counts: Integers) -> None:
    """Call surfaces that hold each other in contact; arguments as `decide_by_doubles`, after it."""
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for p in range(len(frames.pairs)):
        if held[:, p].any():
            a, b = frames.pairs[p, 0], frames.pairs[p, 1]
            for f in range(frames.task.shape[0]):
                asked = is_asked_for(frames, f, p, rotation, translation) and held[f, p] == 1
                if asked and hold_each_other(bodies, a, b, rotation, translation):
                    counts[RUNS] -= 1  # it was counted when it was decided
                    counts[SEEN_INSIDE] += 1
                    write_found(frames, f, p, CONTACT, 0.0, limit, counts)


@leaf_kernel
def _decide_pair(
    bodies: Bodies, frames: PairFrames, p: int, limit: float, held: Bytes, s: _Scratch, precise: Floats | None
) -> bool:
    """Decide a pair in all frames of its task; return False, with nothing of use written, where it is left."""
    a, b = frames.pairs[p, 0], frames.pairs[p, 1]
    s.counts[:] = 0
    s.seed[:] = -1
    for f in range(frames.task.shape[0]):
        if is_asked_for(frames, f, p, s.rotation, s.translation):
            status, distance = closest(
                bodies, a, b, s.rotation, s.translation, limit, s.seed, s.work, precise, s.nodes, s.gaps, s.counts
            )
            if status == LEFT:
                return False
            # surfaces that are apart may still hold each other, where their volumes meet
            if status == SEPARATED and frames.level[f, p] > 0 and (bodies.surface[a] or bodies.surface[b]):
                held[f, p] = 1
            write_found(frames, f, p, status, distance, limit, s.counts)
    return True


@inlined_kernel
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
