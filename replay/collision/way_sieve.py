"""The broad phase of a block whose motion is known: a pair is not looked at before it can have come near.

What is found is what `broad.sieve` leads to, bit for bit. Let the volumes of a pair be g apart in a frame, and the
boxes at the roots of their trees r. In a later frame, after the bodies have moved by w as seen from each other (`ways`)
the volumes are at least g - w apart. Of the root boxes no corner has moved farther than k w, k the ratio of the radii
of spheres that hold the boxes and the bodies, so along the three axes on which their gap is measured they have come
nearer by k w each: r - sqrt(3) k w is left. While the first is above 0 and the second above the distance of interest,
the pair is clear and the narrow phase would end at the roots, having found nothing.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import float64, int64, uint8

from replay.collision.bodies import VOLUMES_TYPE, Bodies, Volumes
from replay.collision.broad import (
    BY_BLOCK,
    BY_REPEAT,
    BY_SPHERE,
    BY_VOLUME,
    BY_WAY,
    same_pose,
    sphere_gap,
    volumes_meet,
)
from replay.collision.gjk_kernel import ROUNDING
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, REPEAT, RUN, PairFrames
from replay.collision.traversal import box_gap
from replay.collision.volume_gap import boxes_gap
from replay.collision.ways import NEAR, STRETCH
from replay.numerics.arrays import Bytes, Floats, Integers
from replay.numerics.jit import entry, leaf_kernel, record

_SLACK = 2.0**-43
"""Of the lengths that enter a gap: above the rounding of two of them."""


class Roots(NamedTuple):
    """What is asked of B bodies here, a row each: the boxes at the roots of their trees, and how far they reach."""

    center: Floats  # (B, 3) [m]
    half: Floats  # (B, 3) [m]
    reach: Floats  # (B,) [m], as in `Bodies`


ROOTS_TYPE = record(Roots, float64[:, ::1], float64[:, ::1], float64[::1])


def roots_of(bodies: Bodies) -> Roots:
    """Return the boxes at the roots of bodies' trees."""
    first = bodies.node_first[:-1]
    return Roots(bodies.node_center[first], bodies.node_half[first], bodies.reach)


@entry(
    ROOTS_TYPE,
    VOLUMES_TYPE,
    PAIR_FRAMES_TYPE,
    uint8[:, ::1],
    int64[:, ::1],
    float64[:, ::1],
    float64[:, ::1],
    float64,
    int64[::1],
    float64[:, ::1],
    float64[:, ::1],
    float64[::1],
)
@leaf_kernel
def sieve_by_way(
    roots: Roots,
    volumes: Volumes,
    frames: PairFrames,
    kinds: Bytes,
    rows: Integers,
    steps: Floats,
    rounding: Floats,
    limit: float,
    counts: Integers,
    scratch: Floats,
    rotation: Floats,
    translation: Floats,
) -> None:
    """Fill level and task of pairs in frames as `broad.sieve` does, in stretches in which they are NEAR.

    Args:
        roots, volumes: of the scene; no boxes along the world's axes, whose way is another.
        frames: level and task are written; in other stretches they stay as they are, 0 and SKIP.
        kinds: (P, K) of `interval_proof.sort_out`.
        rows: of the pairs, as of `interval_proof.certify`.
        steps: (V, K) [m] no way in an interval of a stretch is longer.
        rounding: (V, K) [m] of places in the stretches, see `ways.fill_stretches`.
        limit: pairs farther apart than this are of no interest [m].
        counts: (COUNTS,) of `broad`, added to.
        scratch, rotation, translation: (8, 4), (3, 3), (3,) scratch.
    """
    pairs, poses, level, task = frames.pairs, frames.poses, frames.level, frames.task
    for p in range(len(pairs)):
        a, b, q = pairs[p, 0], pairs[p, 1], pairs[p, 2]
        ratio = root_ratio(roots, volumes, a, b)
        last, left = len(level) - 1, 0.0
        for f in range(last + 1):
            # before a frame and after it lie two intervals, and it is looked at for either
            before, after = max(f - 1, 0) // STRETCH, min(f, last - 1) // STRETCH
            comes = f > 0 and kinds[p, before] == NEAR
            if not comes and kinds[p, after] != NEAR:
                counts[BY_BLOCK] += 1
                continue
            k = before if comes else after
            error = 4.0 * (rounding[rows[p, 0], k] + rounding[rows[p, 1], k])
            left = left - steps[rows[p, 0], k] - steps[rows[p, 1], k] if comes else 0.0
            if left > 0.0:
                counts[BY_WAY] += 1
                continue
            pose = poses[q, f]
            if comes and same_pose(pose, poses[q, f - 1]):
                counts[BY_REPEAT] += 1
                level[f, p], task[f, p] = level[f - 1, p], REPEAT
                continue
            size = roots.reach[a] + roots.reach[b]
            size += math.sqrt(pose[0, 3] ** 2 + pose[1, 3] ** 2 + pose[2, 3] ** 2)
            margin = error + _SLACK * (size + volumes.radius[a] + volumes.radius[b])
            gap = sphere_gap(volumes, a, b, pose)
            if gap > limit:
                counts[BY_SPHERE] += 1
                left = gap - margin
                if limit > 0.0:
                    root = root_gap(roots, a, b, pose, size, rotation, translation)
                    left = min(gap, (root - limit) / ratio) - margin
            elif volumes_meet(volumes, a, b, pose, frames.turns[0, f], scratch):
                level[f, p], task[f, p] = 1, RUN
            elif limit > 0.0:
                root = root_gap(roots, a, b, pose, size, rotation, translation)
                if root > limit:
                    counts[BY_VOLUME] += 1
                    left = (
                        min(boxes_gap(volumes, a, b, pose, frames.turns[0, f], scratch), (root - limit) / ratio)
                        - margin
                    )
                else:
                    task[f, p] = RUN
            else:
                counts[BY_VOLUME] += 1
                left = boxes_gap(volumes, a, b, pose, frames.turns[0, f], scratch) - margin


@leaf_kernel
def root_ratio(roots: Roots, volumes: Volumes, a: int, b: int) -> float:
    """Return by how much a way that bodies take may shorten the gap of the boxes at their roots: sqrt(3) k."""
    return math.sqrt(3.0) * max(1.0, _ratio(roots, volumes, a), _ratio(roots, volumes, b))


@leaf_kernel
def _ratio(roots: Roots, volumes: Volumes, body: int) -> float:
    """Return how much larger a sphere about the body's centre is that holds the box at the root of its tree."""
    square, away = 0.0, 0.0
    for i in range(3):
        square += roots.half[body, i] ** 2
        away += (roots.center[body, i] - volumes.center[body, i]) ** 2
    radius: float = volumes.radius[body]
    return (math.sqrt(square) + math.sqrt(away)) * (1.0 + 2.0**-40) / radius if radius > 0.0 else math.inf


@leaf_kernel
def root_gap(roots: Roots, a: int, b: int, pose: Floats, size: float, rotation: Floats, translation: Floats) -> float:
    """Return what `traversal.closest` computes of the boxes at the roots [m]."""
    for i in range(3):
        translation[i] = pose[i, 3]
        for j in range(3):
            rotation[i, j] = pose[i, j]
    slack = 2.0 * ROUNDING * size
    return float(box_gap(roots.center, roots.half, a, b, rotation, translation, slack))
