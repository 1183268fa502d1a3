"""Which pairs are proven apart between their frames by what is known at the frames, and which are in doubt.

With d0 and d1 lower bounds on the distance of a pair at both ends of an interval, and L a bound on how far a point of
one body moves as seen from the other (`ways`), the pair is at least (d0 + d1 - L) / 2 apart throughout. d is what the
narrow phase found, or the limit up to which it looked, or the gap of the bounding spheres, or of the boxes.
"""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64, uint8

from replay.collision.bodies import VOLUMES_TYPE, Volumes
from replay.collision.broad import sphere_gap, volumes_meet
from replay.collision.crossing_search import BOUNDS_DOUBT, CONTACT_DOUBT, boxes_gap, proven_distance
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, PairFrames
from replay.numerics.arrays import Bytes, Floats, Integers
from replay.numerics.jit import entry, leaf_kernel

COUNTS = 3
BY_BLOCK, BY_FRAMES, IN_DOUBT = range(COUNTS)
"""Counters of pair-intervals: proven for a whole block, by the frames' distances, and left to the search."""

CLEAR, CONTACT, UNDECIDED = 0, 1, 2
"""As `columns.Between`."""


@entry(
    VOLUMES_TYPE,
    float64[::1],
    PAIR_FRAMES_TYPE,
    PAIR_FRAMES_TYPE,
    int64,
    int64[:, ::1],
    float64[:, ::1],
    float64[::1],
    float64,
    float64,
    boolean,
    uint8[:, ::1],
    float64[:, ::1],
    uint8[:, ::1],
    int64[::1],
    float64[:, ::1],
)
@leaf_kernel
def certify(
    volumes: Volumes,
    reach: Floats,
    frames: PairFrames,
    head: PairFrames,
    begin: int,
    rows: Integers,
    ways: Floats,
    rounding: Floats,
    limit: float,
    cap: float,
    savings: bool,
    between: Bytes,
    bound: Floats,
    doubt: Bytes,
    counts: Integers,
    scratch: Floats,
) -> None:
    """Fill in what is known of pairs over the intervals that end at the frames from `begin` on.

    Args:
        volumes: of all bodies.
        reach: (B,) of all bodies, see `bodies.Bodies`.
        frames: of n frames, decided by the narrow phase.
        head: of the frame before the first one, read if `begin` is 0.
        begin: 0, or 1 if there is no frame before the first one.
        rows: (P, 4) rows of `ways`: of both bodies as seen from the nearest common ancestor, and from the world.
        ways, rounding: see `ways.fill_ways`; column f - begin is of the interval that ends at frame f.
        limit: up to which the narrow phase looked for distances [m].
        cap: largest bound that is told [m].
        savings: whether pairs are ruled out for the whole block.
        between, bound: (n, P) out; `bound` is NaN and `between` UNDECIDED where there is doubt of a contact.
        doubt: (n, P) out, bits of `crossing_search`.
        counts: (COUNTS,) added to.
        scratch: (8, 4).
    """
    n = frames.level.shape[0]
    for p in range(len(frames.pairs)):
        a, b, q, turn = frames.pairs[p, 0], frames.pairs[p, 1], frames.pairs[p, 2], frames.pairs[p, 3]
        way_a, way_b, wide_a, wide_b = rows[p, 0], rows[p, 1], rows[p, 2], rows[p, 3]
        error, wide_error = 2.0 * (rounding[way_a] + rounding[way_b]), 2.0 * (rounding[wide_a] + rounding[wide_b])
        total, wide_total = error, wide_error
        for f in range(begin, n):
            total += ways[way_a, f - begin] + ways[way_b, f - begin]
            wide_total += ways[wide_a, f - begin] + ways[wide_b, f - begin]
        if savings and sphere_gap(volumes, a, b, frames.poses[q, n // 2]) > max(cap + total, wide_total):
            counts[BY_BLOCK] += n - begin
            for f in range(begin, n):
                between[f, p], bound[f, p], doubt[f, p] = CLEAR, cap, 0
            continue
        gap1, near1, level1 = 0.0, 0.0, 0
        unsure1 = False
        for f in range(begin - 1, n):
            gap0, near0, level0, unsure0 = gap1, near1, level1, unsure1
            if f < 0:
                pose, level1, unsure1 = head.poses[q, 0], head.level[0, p], head.undecided[0, p]
                clearance = head.clearance[0, p]
            else:
                pose, level1, unsure1 = frames.poses[q, f], frames.level[f, p], frames.undecided[f, p]
                clearance = frames.clearance[f, p]
            gap1 = sphere_gap(volumes, a, b, pose)
            near1 = gap1
            if level1 < 2:
                size = reach[a] + reach[b] + abs(pose[0, 3]) + abs(pose[1, 3]) + abs(pose[2, 3])
                near1 = max(gap1, proven_distance(limit if math.isnan(clearance) else clearance, size), 0.0)
            if f < begin:
                continue
            way = ways[way_a, f - begin] + ways[way_b, f - begin]
            if way > 0.0:
                way += error
            between[f, p], bound[f, p], doubt[f, p] = CLEAR, 0.0, 0
            least = 0.5 * (near0 + near1 - way)
            if level0 == 2 or level1 == 2:
                proven = (level0 == 2 and not unsure0) or (level1 == 2 and not unsure1)
                between[f, p] = CONTACT if proven else UNDECIDED
                if level0 != level1 and (level0 < 2 or level1 < 2):
                    doubt[f, p] |= CONTACT_DOUBT
            elif least > 0.0 or way == 0.0:
                bound[f, p] = min(max(least, 0.0), cap)
            else:
                doubt[f, p] |= CONTACT_DOUBT
            if (level0 == 0) != (level1 == 0):
                doubt[f, p] |= BOUNDS_DOUBT
            elif level0 == 0:
                wide = ways[wide_a, f - begin] + ways[wide_b, f - begin]
                if wide > 0.0:
                    wide += wide_error
                if wide > 0.0 and not gap0 + gap1 > wide:
                    boxes = 0.0
                    for k in range(2):
                        at = head.poses[q, 0] if f + k == 0 else frames.poses[q, f + k - 1]
                        turned = head.turns[turn, 0] if f + k == 0 else frames.turns[turn, f + k - 1]
                        if volumes_meet(volumes, a, b, at, turned, scratch):
                            boxes = -np.inf
                        else:
                            boxes += max(boxes_gap(volumes, a, b, at, turned, scratch), 0.0)
                    if not boxes > wide:
                        doubt[f, p] |= BOUNDS_DOUBT
                    elif doubt[f, p] & CONTACT_DOUBT:  # where the volumes stay apart so do the bodies
                        doubt[f, p] = 0
                        bound[f, p] = min(0.5 * (boxes - way), cap)
            if doubt[f, p] & CONTACT_DOUBT and level0 < 2 and level1 < 2:
                between[f, p], bound[f, p] = UNDECIDED, np.nan
            counts[BY_FRAMES if doubt[f, p] == 0 else IN_DOUBT] += 1
