"""Which pairs are proven apart between their frames by what is known at the frames, and which are in doubt.

With d0 and d1 lower bounds on the distance of a pair at both ends of an interval, and L a bound on how far a point of
one body moves as seen from the other (`ways`), the pair is at least (d0 + d1 - L) / 2 apart throughout. d is what the
narrow phase found, or else the limit up to which it looked or the gap of the bounding spheres, the larger one; where
that does not do, the gap of the boxes. None of it depends on other frames.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64, uint8

from replay.collision.bodies import AABB, BODIES_TYPE, VOLUMES_TYPE, Bodies, Volumes
from replay.collision.broad import volumes_meet
from replay.collision.crossing_look import BOUNDS_DOUBT, CONTACT_DOUBT, proven_distance
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, PairFrames
from replay.collision.volume_gap import boxes_gap
from replay.collision.way_sieve import root_gap, root_ratio
from replay.collision.ways import center_gap
from replay.kinematics.linkage import POSE_ROUNDING
from replay.numerics.arrays import Bytes, Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, leaf_kernel

COUNTS = 2
BY_FRAMES, IN_DOUBT = range(COUNTS)
"""Counters of pair-intervals: proven by the frames' distances, and left to the search."""

CLEAR, CONTACT, UNDECIDED = 0, 1, 2
"""As `columns.Between`."""

FAR, QUIET, NEAR = range(3)
"""What a block may hold of a pair: the largest bound in all intervals; nothing within the limit in any frame, and all
intervals proven by that; or more."""


@entry(
    BODIES_TYPE,
    VOLUMES_TYPE,
    float64[:, :, ::1],
    int64[:, ::1],
    float64[:, :, :, ::1],
    int64[:, ::1],
    float64[::1],
    float64[::1],
    float64[::1],
    float64[::1],
    float64,
    float64,
    uint8[::1],
    float64[:, ::1],
    float64[:, ::1],
    float64[::1],
)
@leaf_kernel
def sort_out(
    bodies: Bodies,
    volumes: Volumes,
    centers: Floats,
    pairs: Integers,
    middle: Floats,
    rows: Integers,
    half: Floats,
    longest: Floats,
    rounding: Floats,
    blur: Floats,
    limit: float,
    cap: float,
    kinds: Bytes,
    scratch: Floats,
    rotation: Floats,
    translation: Floats,
) -> None:
    """Find out which pairs a block need not be looked at for, by its middle frame and the ways of its bodies.

    Args:
        bodies, volumes: of the scene.
        centers: as of `certify`.
        pairs: (P, 4) as `PairFrames.pairs`.
        middle: (Q, 1, 4, 4) T_a_b of the links in the middle frame.
        rows: (P, 4) as of `certify`.
        half: (V,) sum of each way from the middle frame to either end of the block, the larger one [m].
        longest: (V,) each way in the interval in which it is longest [m].
        rounding, blur: (V,) the largest of each row of `ways.fill_ways`, and the largest rounding of its centres [m].
        limit, cap: as of `certify`.
        kinds: (P,) out, FAR, QUIET or NEAR.
        scratch, rotation, translation: (8, 4), (3, 3), (3,) scratch.
    """
    m = centers.shape[1] // 2
    for p in range(len(pairs)):
        a, b, pose = pairs[p, 0], pairs[p, 1], middle[pairs[p, 2], 0]
        way, wide, step = 0.0, 0.0, 0.0
        for k in range(2):
            way += half[rows[p, k]] + 2.0 * rounding[rows[p, k]]
            wide += half[rows[p, 2 + k]] + 2.0 * rounding[rows[p, 2 + k]]
            step += longest[rows[p, k]] + 2.0 * rounding[rows[p, k]]
        kinds[p] = NEAR
        # the gap is rounded here and in each frame
        gap = center_gap(volumes, centers, pairs[p], rows[p], m) - 4.0 * (blur[rows[p, 0]] + blur[rows[p, 1]])
        if gap > max(cap + way, wide) * (1.0 + 2.0**-40):
            kinds[p] = FAR
        elif 0.0 < limit < np.inf and volumes.kind != AABB:
            size = (rounding[rows[p, 0]] + rounding[rows[p, 1]]) / POSE_ROUNDING
            margin = 2.0**-43 * size
            root = root_gap(bodies, a, b, pose, size, rotation, translation)
            quiet = root - limit - margin > root_ratio(bodies, volumes, a, b) * way
            quiet = quiet and 2.0 * proven_distance(limit, size) > step * (1.0 + 2.0**-40)
            if quiet and boxes_gap(volumes, a, b, pose, rotation, scratch) > way + margin:
                kinds[p] = QUIET


@inlined_kernel
def least_apart(
    volumes: Volumes,
    centers: Floats,
    pair: Integers,
    rows: Integers,
    interval: int,
    found: tuple[float, float],
    way: float,
    rounding: float,
    limit: float,
) -> float:
    """Return the least distance [m] that a pair can have in an interval, by the clearances found at its ends or NaN."""
    nearest = -way - (2.0 * rounding if way > 0.0 else 0.0)
    size = rounding / POSE_ROUNDING  # no less than the bodies' reach and offset
    for end in range(2):
        if math.isnan(found[end]):
            gap = center_gap(volumes, centers, pair, rows, interval + end)
            nearest += max(proven_distance(limit, size), gap, 0.0)
        else:
            nearest += max(proven_distance(found[end], size), 0.0)
    return 0.5 * nearest


@entry(
    VOLUMES_TYPE,
    float64[:, :, ::1],
    int64[:, ::1],
    int64[:, ::1],
    float64[:, ::1],
    float64[:, ::1],
    float64,
    float64,
    float64[:, ::1],
)
@leaf_kernel
def fill_quiet(
    volumes: Volumes,
    centers: Floats,
    pairs: Integers,
    rows: Integers,
    ways: Floats,
    rounding: Floats,
    limit: float,
    cap: float,
    bound: Floats,
) -> None:
    """Write the bounds (m, P) of QUIET pairs over the m intervals of a block; arguments as of `certify`."""
    nothing = (np.nan, np.nan)
    for p in range(len(pairs)):
        a, b = rows[p, 0], rows[p, 1]
        for f in range(len(bound)):
            way, rounded = ways[a, f] + ways[b, f], rounding[a, f] + rounding[b, f]
            bound[f, p] = min(least_apart(volumes, centers, pairs[p], rows[p], f, nothing, way, rounded, limit), cap)


@entry(
    VOLUMES_TYPE,
    PAIR_FRAMES_TYPE,
    PAIR_FRAMES_TYPE,
    int64,
    int64[:, ::1],
    float64[:, :, ::1],
    float64[:, ::1],
    float64[:, ::1],
    float64,
    float64,
    uint8[:, ::1],
    float64[:, ::1],
    uint8[:, ::1],
    int64[::1],
    float64[:, ::1],
)
@leaf_kernel
def certify(
    volumes: Volumes,
    frames: PairFrames,
    head: PairFrames,
    begin: int,
    rows: Integers,
    centers: Floats,
    ways: Floats,
    rounding: Floats,
    limit: float,
    cap: float,
    between: Bytes,
    bound: Floats,
    doubt: Bytes,
    counts: Integers,
    scratch: Floats,
) -> None:
    """Fill in what is known of pairs over the intervals that end at the frames from `begin` on.

    Args:
        volumes: of all bodies.
        frames: of n frames, decided by the narrow phase.
        head: of the frame before the first one, read if `begin` is 0.
        begin: 0, or 1 if there is no frame before the first one.
        rows: (P, 4) rows of `ways`: of both bodies as seen from the nearest common ancestor, and from the world.
        centers, ways, rounding: see `ways.fill_ways`; column f - begin is of the interval that ends at frame f.
        limit: up to which the narrow phase looked for distances [m].
        cap: largest bound that is told [m].
        between, bound: (n, P) out; `bound` is NaN and `between` UNDECIDED where there is doubt of a contact.
        doubt: (n, P) out, bits of `crossing_look`.
        counts: (COUNTS,) added to.
        scratch: (8, 4).
    """
    n = frames.level.shape[0]
    for p in range(len(frames.pairs)):
        a, b, q, turn = frames.pairs[p, 0], frames.pairs[p, 1], frames.pairs[p, 2], frames.pairs[p, 3]
        way_a, way_b, wide_a, wide_b = rows[p, 0], rows[p, 1], rows[p, 2], rows[p, 3]
        found1, level1, unsure1, left = 0.0, 0, False, 0.0
        for f in range(begin - 1, n):
            found0, level0, unsure0 = found1, level1, unsure1
            if f < 0:
                found1, level1, unsure1 = head.clearance[0, p], head.level[0, p], head.undecided[0, p]
            else:
                found1, level1, unsure1 = frames.clearance[f, p], frames.level[f, p], frames.undecided[f, p]
            if f < begin:
                continue
            rounded, rounded_wide = 0.0, 0.0
            for k in range(2):
                rounded += rounding[rows[p, k], f - begin]
                rounded_wide += rounding[rows[p, 2 + k], f - begin]
            way = ways[way_a, f - begin] + ways[way_b, f - begin]
            between[f, p], bound[f, p], doubt[f, p] = CLEAR, 0.0, 0
            # the bodies
            if level0 == 2 or level1 == 2:
                proven = (level0 == 2 and not unsure0) or (level1 == 2 and not unsure1)
                between[f, p] = CONTACT if proven else UNDECIDED
                if level0 != level1 and (level0 < 2 or level1 < 2):
                    doubt[f, p] |= CONTACT_DOUBT
            else:
                found = (found0, found1)
                least = least_apart(volumes, centers, frames.pairs[p], rows[p], f - begin, found, way, rounded, limit)
                if not least > 0.0 and way > 0.0:
                    doubt[f, p] |= CONTACT_DOUBT
                bound[f, p] = min(max(least, 0.0), cap)
            # their volumes
            wide = ways[wide_a, f - begin] + ways[wide_b, f - begin]
            if wide > 0.0:
                wide += 2.0 * rounded_wide
            left -= wide
            if (level0 == 0) != (level1 == 0):
                doubt[f, p] |= BOUNDS_DOUBT
            elif level0 == 0 and wide > 0.0 and (left <= 0.0 or doubt[f, p] & CONTACT_DOUBT):
                boxes = 0.0
                for k in range(2):
                    at = head.poses[q, 0] if f + k == 0 else frames.poses[q, f + k - 1]
                    turned = head.turns[turn, 0] if f + k == 0 else frames.turns[turn, f + k - 1]
                    left = 0.0
                    if not volumes_meet(volumes, a, b, at, turned, scratch):
                        left = max(boxes_gap(volumes, a, b, at, turned, scratch), 0.0)
                    boxes += left
                if not boxes > wide:
                    doubt[f, p] |= BOUNDS_DOUBT
                elif doubt[f, p] & CONTACT_DOUBT:  # where the volumes stay apart so do the bodies
                    doubt[f, p] = 0
                    bound[f, p] = min(0.5 * (boxes - way) - rounded, cap)
            if level1 > 0:
                left = 0.0
            if doubt[f, p] & CONTACT_DOUBT and level0 < 2 and level1 < 2:
                between[f, p], bound[f, p] = UNDECIDED, np.nan
            counts[BY_FRAMES if doubt[f, p] == 0 else IN_DOUBT] += 1
