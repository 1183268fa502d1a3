"""Which pairs are proven apart between their frames by what is known at the frames, and which are in doubt.

With d0 and d1 lower bounds on the distance of a pair at both ends of an interval, and L a bound on how far a point of
one body moves as seen from the other (`ways`), the pair is at least (d0 + d1 - L) / 2 apart throughout. d is what the
narrow phase found, or else the limit up to which it looked or the gap of the bounding spheres, the larger one; where
that does not do, the gap of the boxes. None of it depends on other frames.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, uint8

from replay.collision.bodies import AABB, VOLUMES_TYPE, Volumes
from replay.collision.broad import volumes_meet
from replay.collision.crossing_look import BOUNDS_DOUBT, CONTACT_DOUBT, proven_distance
from replay.collision.pair_frames import PAIR_FRAMES_TYPE, PairFrames
from replay.collision.volume_gap import boxes_gap
from replay.collision.way_sieve import ROOTS_TYPE, Roots, root_gap, root_ratio
from replay.collision.ways import FAR, NEAR, QUIET, WAYS_TYPE, Ways, center_gap, fill_ways, stretch
from replay.kinematics.linkage import POSE_ROUNDING
from replay.kinematics.timeline import TIMELINE_TYPE, Timeline
from replay.numerics.arrays import Bytes, Flags, Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, leaf_kernel, record

COUNTS = 2
BY_FRAMES, IN_DOUBT = range(COUNTS)
"""Counters of pair-intervals: proven by the frames' distances, and left to the search."""

CLEAR, CONTACT, UNDECIDED = 0, 1, 2
"""As `columns.Between`."""

_ABOVE = 1.0 + 2.0**-30
"""Above what is rounded of the ways in a stretch."""


@entry(
    ROOTS_TYPE,
    VOLUMES_TYPE,
    int64[:, ::1],
    float64[:, :, :, ::1],
    int64[:, ::1],
    WAYS_TYPE,
    int64,
    float64,
    float64,
    uint8[:, ::1],
    boolean[:, ::1],
    float64[:, ::1],
    float64[:, ::1],
    float64[::1],
)
@leaf_kernel
def sort_out(
    roots: Roots,
    volumes: Volumes,
    pairs: Integers,
    middle: Floats,
    rows: Integers,
    swept: Ways,
    intervals: int,
    limit: float,
    cap: float,
    kinds: Bytes,
    wanted: Flags,
    scratch: Floats,
    rotation: Floats,
    translation: Floats,
) -> None:
    """Find out which pairs a stretch need not be looked at for, by its middle frame and all that moves in it.

    Args:
        roots, volumes: of the scene.
        pairs: (P, 4) as `PairFrames.pairs`.
        middle: (Q, K, 4, 4) T_a_b of the links in the middle frames of the K stretches.
        rows: (P, 4) as of `certify`.
        swept: of the stretches, see `ways.fill_stretches`.
        intervals: of the block.
        limit, cap: as of `certify`; with a limit of 0 no pair is QUIET.
        kinds: (P, K) out, FAR, QUIET or NEAR.
        wanted: (Q, n) link pairs and frames, set where a pair of theirs is NEAR.
        scratch, rotation, translation: (8, 4), (3, 3), (3,) scratch.
    """
    for p in range(len(pairs)):
        a, b, q, left = pairs[p, 0], pairs[p, 1], pairs[p, 2], 0.0
        for k in range(kinds.shape[1]):
            way, wide, size = 0.0, 0.0, 0.0
            for i in range(2):
                way += 0.5 * swept.ways[rows[p, i], k]
                wide += 0.5 * swept.ways[rows[p, 2 + i], k]
                # no coordinate of the frames is larger
                size += (swept.centers[rows[p, i], k, 3] + 2.0 * swept.rounding[rows[p, i], k]) / POSE_ROUNDING
                wide += 16.0 * swept.rounding[rows[p, 2 + i], k]
            error = 32.0 * POSE_ROUNDING * size
            if center_gap(volumes, swept.centers, pairs[p], rows[p], k) - error > max(cap + way, wide) * _ABOVE:
                kinds[p, k], left = FAR, 0.0
                continue
            kinds[p, k] = NEAR
            if 0.0 < limit < np.inf and volumes.kind != AABB:
                error += 2.0**-43 * size
                left -= way + error  # from the end of the stretch before to the middle
                if not left > way + error:
                    root = root_gap(roots, a, b, middle[q, k], size, rotation, translation) - limit
                    left = root / root_ratio(roots, volumes, a, b)
                    if left > way + error:
                        left = min(left, boxes_gap(volumes, a, b, middle[q, k], rotation, scratch))
                left -= way + error
                if left > 0.0 and 2.0 * proven_distance(limit, size) > (way + error) * _ABOVE:
                    kinds[p, k] = QUIET
                    continue
            begin, _, end = stretch(k, intervals)
            for f in range(begin, end + 1):
                wanted[q, f] = True


@inlined_kernel
def least_apart(
    found: tuple[float, float], gaps: tuple[float, float], way: float, rounding: float, limit: float
) -> float:
    """Return the least distance [m] that a pair can have in an interval.

    Args:
        found: clearances at its ends [m], or NaN.
        gaps: of the spheres there [m], of no interest where a clearance was found.
        way, rounding: of the bodies in the interval [m].
        limit: up to which clearances were looked for [m].
    """
    nearest = -way - (2.0 * rounding if way > 0.0 else 0.0)
    size = rounding / POSE_ROUNDING  # no less than the bodies' reach and offset
    for end in range(2):
        if math.isnan(found[end]):
            nearest += max(proven_distance(limit, size), gaps[end], 0.0)
        else:
            nearest += max(proven_distance(found[end], size), 0.0)
    return 0.5 * nearest


class Answers(NamedTuple):
    """What is said of pairs over intervals, in the arrays that it is written to: rows are intervals."""

    columns: Integers  # (P,) of each pair
    between: Bytes  # (n, columns)
    bound: Floats  # (n, columns) [m]; NaN, and `between` UNDECIDED, where there is doubt of a contact
    begin: int  # row of the first interval
    doubt: Bytes  # (m, p) bits of `crossing_look`, of the pairs in `PairFrames`; zero


ANSWERS_TYPE = record(Answers, int64[::1], uint8[:, ::1], float64[:, ::1], int64, uint8[:, ::1])


@entry(
    TIMELINE_TYPE,
    VOLUMES_TYPE,
    int64[::1],
    float64[:, :, :, ::1],
    float64[:, :, ::1],
    int64[::1],
    int64[:, ::1],
    int64[:, ::1],
    uint8[:, ::1],
    int64[::1],
    PAIR_FRAMES_TYPE,
    float64,
    float64,
    ANSWERS_TYPE,
    int64[::1],
    WAYS_TYPE,
    int64[::1],
    float64[:, ::1],
)
@leaf_kernel
def certify(
    line: Timeline,
    volumes: Volumes,
    links: Integers,
    local: Floats,
    travel: Floats,
    first: Integers,
    pairs: Integers,
    rows: Integers,
    kinds: Bytes,
    place: Integers,
    frames: PairFrames,
    limit: float,
    cap: float,
    told: Answers,
    counts: Integers,
    ways: Ways,
    top: Integers,
    scratch: Floats,
) -> None:
    """Fill in what is known of pairs over the intervals of a block, but where they are FAR: there it stands already.

    Args:
        line, volumes, links, local, travel, first: see `ways.fill_ways`; of m + 1 frames.
        pairs: (P, 4) as `PairFrames.pairs`.
        rows: (P, 4) rows of `ways`: of both bodies as seen from the nearest common ancestor, and from the world.
        kinds: (P, K) of `sort_out`.
        place: (P,) which of `frames.pairs` each is, -1 if it is NEAR nowhere.
        frames: of all frames, decided by the narrow phase where pairs are NEAR.
        limit: up to which the narrow phase looked for distances [m].
        cap: largest bound that is told [m].
        told: out.
        counts: (COUNTS,) added to.
        ways, top, scratch: of STRETCH intervals, (B,), (8, 4) scratch.
    """
    nothing = (np.nan, np.nan)
    for k in range(kinds.shape[1]):
        begin, _, end = stretch(k, travel.shape[1])
        for body in range(len(links)):
            top[body] = first[body + 1]
        for p in range(len(pairs)):
            if kinds[p, k] != FAR:
                for i in range(4):
                    body = pairs[p, i % 2]
                    top[body] = min(top[body], rows[p, i])
        fill_ways(line, volumes, links, local, travel, first, top, begin, end, ways)
        for p in range(len(pairs)):
            if kinds[p, k] == NEAR:
                certify_near(volumes, frames, place[p], rows[p], begin, end, limit, cap, told, p, counts, ways, scratch)
            elif kinds[p, k] == QUIET:
                a, b = rows[p, 0], rows[p, 1]
                after = center_gap(volumes, ways.centers, pairs[p], rows[p], 0)
                for f in range(end - begin):
                    before, after = after, center_gap(volumes, ways.centers, pairs[p], rows[p], f + 1)
                    way, rounded = ways.ways[a, f] + ways.ways[b, f], ways.rounding[a, f] + ways.rounding[b, f]
                    least = least_apart(nothing, (before, after), way, rounded, limit)
                    told.bound[told.begin + begin + f, told.columns[p]] = min(least, cap)


@leaf_kernel
def certify_near(
    volumes: Volumes,
    frames: PairFrames,
    p: int,
    rows: Integers,
    begin: int,
    end: int,
    limit: float,
    cap: float,
    told: Answers,
    pair: int,
    counts: Integers,
    ways: Ways,
    scratch: Floats,
) -> None:
    """Do what `certify` does for one pair, p of `frames` and `pair` of `told`, in a stretch in which it is NEAR."""
    a, b, q, turn = frames.pairs[p, 0], frames.pairs[p, 1], frames.pairs[p, 2], frames.pairs[p, 3]
    column, left = told.columns[pair], 0.0
    for f in range(begin, end):
        level0, level1 = frames.level[f, p], frames.level[f + 1, p]
        rounded, rounded_wide, way, wide = 0.0, 0.0, 0.0, 0.0
        for i in range(2):
            rounded += ways.rounding[rows[i], f - begin]
            rounded_wide += ways.rounding[rows[2 + i], f - begin]
            way += ways.ways[rows[i], f - begin]
            wide += ways.ways[rows[2 + i], f - begin]
        between, bound, doubt = CLEAR, 0.0, 0
        # the bodies
        if level0 == 2 or level1 == 2:
            proven = (level0 == 2 and not frames.undecided[f, p]) or (level1 == 2 and not frames.undecided[f + 1, p])
            between = CONTACT if proven else UNDECIDED
            if level0 != level1 and (level0 < 2 or level1 < 2):
                doubt |= CONTACT_DOUBT
        else:
            found = (frames.clearance[f, p], frames.clearance[f + 1, p])
            gaps = (
                center_gap(volumes, ways.centers, frames.pairs[p], rows, f - begin),
                center_gap(volumes, ways.centers, frames.pairs[p], rows, f + 1 - begin),
            )
            least = least_apart(found, gaps, way, rounded, limit)
            if not least > 0.0 and way > 0.0:
                doubt |= CONTACT_DOUBT
            bound = min(max(least, 0.0), cap)
        # their volumes
        if wide > 0.0:
            wide += 2.0 * rounded_wide
        left -= wide
        if (level0 == 0) != (level1 == 0):
            doubt |= BOUNDS_DOUBT
        elif level0 == 0 and wide > 0.0 and (left <= 0.0 or doubt & CONTACT_DOUBT):
            boxes = 0.0
            for i in range(2):
                pose, turned = frames.poses[q, f + i], frames.turns[turn, f + i]
                left = 0.0
                if not volumes_meet(volumes, a, b, pose, turned, scratch):
                    left = max(boxes_gap(volumes, a, b, pose, turned, scratch), 0.0)
                boxes += left
            if not boxes > wide:
                doubt |= BOUNDS_DOUBT
            elif doubt & CONTACT_DOUBT:  # where the volumes stay apart so do the bodies
                doubt = 0
                bound = min(0.5 * (boxes - way) - rounded, cap)
        if level1 > 0:
            left = 0.0
        if doubt & CONTACT_DOUBT and level0 < 2 and level1 < 2:
            between, bound = UNDECIDED, np.nan
        told.between[told.begin + f, column], told.bound[told.begin + f, column] = between, bound
        told.doubt[f, p] = doubt
        counts[BY_FRAMES if doubt == 0 else IN_DOUBT] += 1
