"""The broad phase of a block: which pairs, in which frames, the narrow phase has to look at.

Three sieves, each exact. (1) The block: with T_f = (R_f, t_f) the pose of link b in link a and m the middle frame, the
centre c of b's volume moves by |T_f c - T_m c| <= |t_f - t_m| + |R_f - R_m| |c| (Frobenius norm), so one bound for the
link pair and two numbers for the pair rule out all frames at once. (2) The frame: the bounding spheres. (3) The pair's
own bounding volumes, which also define the level `bounds`.
"""

from __future__ import annotations

import math

from numba import float64, int64

from replay.collision.bodies import AABB, SPHERE, VOLUMES_TYPE, Volumes
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, REPEAT, RUN, SKIP, PairFrames
from replay.geometry.overlap import aabbs_meet, obbs_meet, spheres_meet
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, leaf_kernel

COUNTS = 5
BY_BLOCK, BY_REPEAT, BY_SPHERE, BY_VOLUME, BY_WAY = range(COUNTS)
"""Rows of the counters: pair-frames settled by each sieve, by a pose that repeats, and by how far bodies can move."""

_SLACK = 2.0**-44
"""Relative to the lengths that enter a distance of spheres: far above their rounding."""


@leaf_kernel
def spread(poses: Floats) -> tuple[float, float]:
    """Return how far (n, 4, 4) poses are from the middle one: max |t_f - t_m| [m] and max |R_f - R_m| [-]."""
    n = len(poses)
    m = n // 2
    shift, turn = 0.0, 0.0
    for f in range(n):
        s, r = 0.0, 0.0
        for i in range(3):
            s += (poses[f, i, 3] - poses[m, i, 3]) ** 2
            for j in range(3):
                r += (poses[f, i, j] - poses[m, i, j]) ** 2
        shift, turn = max(shift, s), max(turn, r)
    return math.sqrt(shift), math.sqrt(turn)


@inlined_kernel
def sphere_gap(volumes: Volumes, a: int, b: int, pose: Floats) -> float:
    """Return a lower bound on the distance [m] of two bodies, from their spheres, b's link at pose (4, 4) in a's."""
    c, o = volumes.center[b], volumes.center[a]
    square, size = 0.0, volumes.radius[a] + volumes.radius[b]
    for i in range(3):
        x = pose[i, 0] * c[0] + pose[i, 1] * c[1] + pose[i, 2] * c[2] + pose[i, 3] - o[i]
        square += x * x
        size += abs(pose[i, 3]) + abs(c[i]) + abs(o[i])
    gap: float = math.sqrt(square) - volumes.radius[a] - volumes.radius[b] - _SLACK * size
    return gap


@inlined_kernel
def volumes_meet(volumes: Volumes, a: int, b: int, pose: Floats, turn: Floats, scratch: Floats) -> bool:
    """Return whether two bodies' volumes meet; errs only towards meeting.

    Args:
        volumes: all volumes.
        a, b: the bodies.
        pose: (4, 4) T_a_b of their links.
        turn: (3, 3) rotation of a's link in world, along whose axes boxes of kind AABB lie.
        scratch: (8, 4).
    """
    if volumes.kind == SPHERE:
        return spheres_meet(volumes.center[a], volumes.radius[a], volumes.center[b], volumes.radius[b], pose)
    if volumes.kind != AABB:
        return obbs_meet(
            volumes.center[a],
            volumes.half[a],
            volumes.axes[a],
            volumes.center[b],
            volumes.half[b],
            volumes.axes[b],
            pose,
        )
    # boxes along the world's axes, about a's origin: centres R c, half widths |R| w
    center_a, half_a, center_b, half_b = scratch[4, :3], scratch[5, :3], scratch[6, :3], scratch[7, :3]
    for i in range(3):
        center_a[i], half_a[i], center_b[i], half_b[i] = 0.0, 0.0, 0.0, 0.0
        for j in range(4):
            scratch[i, j] = 1.0 if i == j else 0.0
        for j in range(3):
            scratch[i, 3] += turn[i, j] * pose[j, 3]
            center_a[i] += turn[i, j] * volumes.center[a, j]
            half_a[i] += abs(turn[i, j]) * volumes.half[a, j]
            turned = turn[i, 0] * pose[0, j] + turn[i, 1] * pose[1, j] + turn[i, 2] * pose[2, j]
            center_b[i] += turned * volumes.center[b, j]
            half_b[i] += abs(turned) * volumes.half[b, j]
    return aabbs_meet(center_a, half_a, center_b, half_b, scratch[:4])


@entry(VOLUMES_TYPE, PAIR_FRAMES_TYPE, float64, int64[::1], float64[:, ::1], float64[:, ::1])
@leaf_kernel
def sieve(
    volumes: Volumes, frames: PairFrames, limit: float, counts: Integers, spreads: Floats, scratch: Floats
) -> None:
    """Fill the level of pairs in frames with 0 clear or 1 bounds, and their task with SKIP, RUN or REPEAT.

    Args:
        volumes: of all bodies.
        frames: level and task are written.
        limit: pairs farther apart than this are of no interest [m].
        counts: (COUNTS,) added to.
        spreads, scratch: (Q, 2), (8, 4) scratch.
    """
    pairs, poses, turns, level, task = frames.pairs, frames.poses, frames.turns, frames.level, frames.task
    n = level.shape[0]
    for q in range(len(poses)):
        spreads[q, 0] = -1.0  # not asked for yet
    for p in range(len(pairs)):
        a, b, q, link = pairs[p, 0], pairs[p, 1], pairs[p, 2], pairs[p, 3]
        gap, motion = sphere_gap(volumes, a, b, poses[q, n // 2]), 0.0
        if gap > limit:
            if spreads[q, 0] < 0.0:
                spreads[q, 0], spreads[q, 1] = spread(poses[q])
            c = volumes.center[b]
            motion = spreads[q, 0] + spreads[q, 1] * math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2])
        if gap - (1.0 + _SLACK) * motion > limit:
            counts[BY_BLOCK] += n
            for f in range(n):
                level[f, p], task[f, p] = 0, SKIP
            continue
        for f in range(n):
            repeats = f > 0 and same_pose(poses[q, f], poses[q, f - 1])
            if repeats and (volumes.kind != AABB or same_pose(turns[link, f], turns[link, f - 1])):
                counts[BY_REPEAT] += 1
                level[f, p], task[f, p] = level[f - 1, p], REPEAT
                continue
            level[f, p], task[f, p] = 0, SKIP
            if sphere_gap(volumes, a, b, poses[q, f]) > limit:
                counts[BY_SPHERE] += 1
            elif volumes_meet(volumes, a, b, poses[q, f], turns[link, f], scratch):
                level[f, p], task[f, p] = 1, RUN
            elif limit > 0.0:
                task[f, p] = RUN
            else:
                counts[BY_VOLUME] += 1


@entry(VOLUMES_TYPE, PAIR_FRAMES_TYPE, float64[:, ::1])
@leaf_kernel
def keep_all(volumes: Volumes, frames: PairFrames, scratch: Floats) -> None:
    """Fill level as `sieve` does, and task with RUN: no pair and frame is left out. Arguments as of `sieve`."""
    pairs, poses, turns, level, task = frames.pairs, frames.poses, frames.turns, frames.level, frames.task
    for p in range(len(pairs)):
        a, b, q, link = pairs[p, 0], pairs[p, 1], pairs[p, 2], pairs[p, 3]
        for f in range(level.shape[0]):
            level[f, p] = volumes_meet(volumes, a, b, poses[q, f], turns[link, f], scratch)
            task[f, p] = RUN


@inlined_kernel
def same_pose(a: Floats, b: Floats) -> bool:
    """Return whether two matrices are the same, element by element."""
    for i in range(a.shape[0]):
        for j in range(a.shape[1]):
            if a[i, j] != b[i, j]:
                return False
    return True
