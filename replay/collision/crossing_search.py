"""Between two frames: a proof that a pair stays apart, or the moment at which it meets, by bisection in time.

Two bodies that are d0 and d1 apart at the ends of an interval in which no point of one moves farther than L, as seen
from the other (`way_steps`), cannot meet in between if d0 + d1 > L: then they are at least (d0 + d1 - L) / 2 apart.
Where that does not hold, their pieces may be apart by bounds along directions (`piece_proof`).

Where the proof fails the interval is halved, the earlier half first, with the exact poses at the middle: `sweep`. It
ends with every part proven, with a meeting whose every earlier moment is proven clear up to a `resolution` before, or
with parts that neither is known of. The same search serves the bounding volumes, whose sphere holds their corners.
Times are whole nanoseconds, so that whoever asks for the poses at the time that is told sees what was seen here.
"""

from __future__ import annotations

import numpy as np
from numba import float64, int64, uint8

from replay.collision import traversal
from replay.collision.bodies import AABB, BODIES_TYPE, VOLUMES_TYPE, Bodies, Volumes
from replay.collision.crossing_look import (
    BODIES,
    BOUNDS_DOUBT,
    CONTACT_DOUBT,
    DEPTH,
    QUESTIONS_TYPE,
    SEARCH_TYPE,
    VOLUMES,
    Questions,
    Search,
    apart_in_pieces,
    look,
    search_scratch,
)
from replay.collision.support import Sets
from replay.collision.way_steps import (
    BALL,
    CHAINS_TYPE,
    SCRATCH_TYPE,
    Chains,
    Scratch,
    least_way,
    list_steps,
    measure_arms,
    measure_travel,
    place,
    way_scratch,
)
from replay.kinematics.timeline import TIMELINE_TYPE, Timeline, last_at_or_before
from replay.numerics.arrays import Bytes, Floats, Integers
from replay.numerics.jit import leaf_kernel, rare_entry

LOOKS = 1024
"""Cap of a search: moments looked at. What is left then is undecided."""

MOST_QUERIES = 1 << 15
"""Another: pairs of convex sets decided, of bodies that have many near each other."""

PARTS = 8
"""The shortest part that is looked at is this part of the resolution: so a meeting stays within the resolution, even
where the parts just before it cannot be proven."""

PROVEN, FOUND, UNPROVEN = range(3)
"""What a search ends with; as `columns.Between` has it: clear, contact, undecided."""


@leaf_kernel
def _key_frame(line: Timeline, n: int, t0: int, t1: int, s: Scratch) -> int:
    """Return a moment [ns] within (t0, t1) at which a free joint on the way passes a key frame, -1 if there is none.

    Parts between key frames have bounds along directions that those across one have not.
    """
    for i in range(n):
        link = s.link[i]
        if s.kind[i] == BALL:
            free = line.joint[link]
            begin, end = line.key_first[free], line.key_first[free + 1]
            first = last_at_or_before(line.key_time, begin, end, t0 / 1e9)
            last = last_at_or_before(line.key_time, begin, end, t1 / 1e9)
            if last > first:
                moment = round(line.key_time[(first + last + 1) // 2] * 1e9)
                if t0 < moment < t1:
                    return int(moment)
    return -1


@leaf_kernel
def sweep(
    bodies: Bodies,
    volumes: Volumes,
    line: Timeline,
    chains: Chains,
    q: Questions,
    k: int,
    what: int,
    begin: int,
    distance: float,
    waiting: int,
    limit: float,
    resolution: int,
    n: int,
    rounding: float,
    s: Scratch,
    wide: Scratch,
    r: Search,
) -> tuple[int, float]:
    """Search from a moment at which a pair is apart towards others, forwards or backwards in time.

    Args:
        bodies, volumes, line, chains, q, k, s, wide, r: as `look`.
        what: BODIES or VOLUMES.
        begin, distance: the moment [ns], and how far apart the pair is then [m].
        waiting: how many moments are in `r.time`, `r.distance`, `r.meets`: the nearest last.
        limit: distances above it are of no interest [m].
        resolution: [ns].
        n, rounding: steps of the way, and the rounding of a pose [m]; their lever arms are written in `s`, or `wide`.

    Returns:
        PROVEN, FOUND (then `r.bracket` holds when it met, all before `earliest` proven clear) or UNPROVEN, and the
        proven lower bound of the distance over what was searched [m].
    """
    frontier, bound = begin, np.inf
    unproven, any_unproven = begin, False
    looks, asked = 0, r.counts[traversal.QUERIES]
    steps = wide if what == VOLUMES and volumes.kind == AABB else s
    shortest = max(resolution // PARTS, 1)
    while waiting > 0:
        top = waiting - 1
        t, d, meets = r.time[top], r.distance[top], r.meets[top] == 1
        length = abs(t - frontier)
        if not meets:
            if length == 0:
                waiting -= 1
                continue
            measure_travel(line, n, min(t, frontier) / 1e9, max(t, frontier) / 1e9, steps)
            way, split = least_way(n, steps)
            way += 2.0 * rounding
            apart = 0.5 * (distance + d - way)
            if not apart > 0.0:
                low, high = min(t, frontier), max(t, frontier)
                apart = apart_in_pieces(
                    bodies, volumes, line, chains, q, k, what, low, high, way, split, n, rounding, steps, r
                )
            if apart > 0.0:
                bound, frontier, distance = min(bound, apart), t, d
                waiting -= 1
                continue
        start = unproven if any_unproven else frontier
        spent = looks >= LOOKS or r.counts[traversal.QUERIES] - asked >= MOST_QUERIES
        if meets and (abs(t - start) <= resolution or length <= shortest or spent):
            r.bracket[0], r.bracket[1] = start, t
            return FOUND, 0.0
        if length <= shortest or spent or waiting >= DEPTH:
            if not any_unproven:
                any_unproven, unproven = True, frontier
            frontier, distance = t, d
            waiting -= 1
            continue
        middle = _key_frame(line, n, min(t, frontier), max(t, frontier), steps)
        if middle < 0:
            middle = frontier + (t - frontier) // 2
        looks += 1
        found, apart = look(bodies, volumes, line, chains, q, k, what, middle, limit, s, wide, r)
        r.time[waiting], r.distance[waiting], r.meets[waiting] = middle, apart, 1 if found else 0
        waiting += 1
    if any_unproven:
        return UNPROVEN, 0.0
    return PROVEN, bound


def search(
    bodies: Bodies,
    volumes: Volumes,
    corners: Sets,
    line: Timeline,
    chains: Chains,
    q: Questions,
    cap: float,
    resolution: int,
    between: Bytes,
    bound: Floats,
    events: Integers,
    counts: Integers,
) -> int:
    """Answer questions; return how many events were written.

    Args:
        bodies, volumes, line, chains: of the scene.
        corners: of the volumes, row k of volume k; the centre alone of a sphere.
        q: k questions.
        cap: distances above it are of no interest [m].
        resolution: longest bracket [ns] that is aimed at.
        between, bound: (k,) written where both ends are apart: CLEAR, CONTACT or UNDECIDED as 0, 1, 2, and the proven
            lower bound of the distance [m], at most `cap`.
        events: (4 k, 5) out: question, level 1 or 2, whether it begins, earliest and latest [ns].
        counts: (COUNTS,) of `crossing_look`, added to.
    """
    longest = int(np.diff(chains.first).max(initial=0))
    s, wide, r = way_scratch(longest), way_scratch(longest), search_scratch(longest, corners, counts)
    return answer(bodies, volumes, line, chains, q, cap, resolution, between, bound, events, s, wide, r)


@rare_entry(
    BODIES_TYPE,
    VOLUMES_TYPE,
    TIMELINE_TYPE,
    CHAINS_TYPE,
    QUESTIONS_TYPE,
    float64,
    int64,
    uint8[::1],
    float64[::1],
    int64[:, ::1],
    SCRATCH_TYPE,
    SCRATCH_TYPE,
    SEARCH_TYPE,
)
@leaf_kernel
def answer(
    bodies: Bodies,
    volumes: Volumes,
    line: Timeline,
    chains: Chains,
    q: Questions,
    cap: float,
    resolution: int,
    between: Bytes,
    bound: Floats,
    events: Integers,
    s: Scratch,
    wide: Scratch,
    r: Search,
) -> int:
    """Do what `search` does, in arrays that it has made."""
    written = 0
    for k in range(len(q.doubt)):
        a, b, t0, t1 = q.bodies[k, 0], q.bodies[k, 1], q.time[k, 0], q.time[k, 1]
        way = q.chain[k, 0]
        place(line, chains, way, t0 / 1e9, s)
        n = list_steps(line, chains, way, s)
        measure_travel(line, n, t0 / 1e9, t1 / 1e9, s)
        rounding = measure_arms(line, chains, volumes, way, a, b, n, s)
        limit = cap + least_way(n, s)[0]
        r.seed[:] = -1
        first, last, apart = -1, -1, -1  # the bodies meet first, meet last, and are apart again, where that was found
        for what in range(2):
            level = 2 - what
            before, after = q.level[k, 0] >= level, q.level[k, 1] >= level
            doubted = q.doubt[k] & (CONTACT_DOUBT if what == BODIES else BOUNDS_DOUBT) != 0
            if (before and after) or not (doubted or first >= 0):
                continue
            if what == VOLUMES and volumes.kind == AABB:
                way = q.chain[k, 1]
                place(line, chains, way, t0 / 1e9, wide)
                n = list_steps(line, chains, way, wide)
                measure_travel(line, n, t0 / 1e9, t1 / 1e9, wide)
                rounding = measure_arms(line, chains, volumes, way, a, b, n, wide)
            d0 = 0.0 if before else look(bodies, volumes, line, chains, q, k, what, t0, limit, s, wide, r)[1]
            d1 = 0.0 if after else look(bodies, volumes, line, chains, q, k, what, t1, limit, s, wide, r)[1]
            met = t0 if before else first  # where bodies meet so do their volumes
            if not before:
                r.time[0], r.distance[0], r.meets[0] = t1, d1, 1 if after else 0
                if met >= 0:
                    r.time[0], r.distance[0], r.meets[0] = met, 0.0, 1
                outcome, proven = sweep(
                    bodies, volumes, line, chains, q, k, what, t0, d0, 1, limit, resolution, n, rounding, s, wide, r
                )
                if outcome == FOUND:
                    met = r.bracket[1]
                    written = _write(events, written, k, level, 1, r.bracket[0], met)
                if what == BODIES:
                    first = met
                    if not after:
                        between[k] = outcome
                        bound[k] = min(proven, cap) if outcome == PROVEN else 0.0
            if not after and met >= 0:
                r.time[0], r.distance[0], r.meets[0] = max(met, last), 0.0, 1
                sweep(bodies, volumes, line, chains, q, k, what, t1, d1, 1, limit, resolution, n, rounding, s, wide, r)
                last, apart = r.bracket[1], max(r.bracket[0], apart)
                written = _write(events, written, k, level, 0, last, apart)
    return written


@leaf_kernel
def _write(events: Integers, row: int, k: int, level: int, begins: int, earliest: int, latest: int) -> int:
    events[row, 0], events[row, 1], events[row, 2] = k, level, begins
    events[row, 3], events[row, 4] = earliest, latest
    return row + 1
