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

from typing import NamedTuple

import numpy as np
from numba import float64, int64, uint8

from replay.collision import traversal
from replay.collision.bodies import AABB, BODIES_TYPE, OBB, VOLUMES_TYPE, Bodies, Volumes
from replay.collision.broad import volumes_meet
from replay.collision.directed import Lines, lines, measure_changes, write_lines
from replay.collision.gjk_exact import SEPARATED, UNDECIDED, Workspace, precise_points, workspace
from replay.collision.gjk_kernel import ROUNDING
from replay.collision.narrow import hold_each_other
from replay.collision.piece_proof import Ends, apart_by_pieces, apart_in_world, ends, sets_apart, write_end
from replay.collision.support import SETS_TYPE, Sets
from replay.collision.traversal import STACK, closest
from replay.collision.volume_gap import boxes_gap
from replay.collision.way_steps import (
    BALL,
    CHAINS_TYPE,
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
from replay.numerics.jit import kernel, leaf_kernel, rare_entry, record

LOOKS = 1024
"""Cap of a search: moments looked at. What is left then is undecided."""

MOST_QUERIES = 1 << 15
"""Another: pairs of convex sets decided, of bodies that have many near each other."""

PARTS = 8
"""The shortest part that is looked at is this part of the resolution: so a meeting stays within the resolution, even
where the parts just before it cannot be proven."""

PROVEN_SHARE, PROVEN_ROUNDING = 1.0 - 2.0**-38, 8.0 * ROUNDING
"""Of a distance, and of all lengths: GJK accepts one whose proven lower bound is within 1e-12 and its rounding."""

DEPTH = 80
"""Moments waiting: each halves what is left of at most 2^63 ns."""

_MEETING = 2.0**-43
"""Of all lengths: more than what tests of volumes give in favour of meeting."""

BODIES, VOLUMES = 0, 1
"""What is searched for: a contact of the bodies, or of their bounding volumes."""

CONTACT_DOUBT, BOUNDS_DOUBT = 1, 2
"""What an interval is searched for, bits."""

COUNTS = traversal.COUNTS + 1
MOMENTS = traversal.COUNTS
"""Counter after those of `traversal`: moments looked at."""

PROVEN, FOUND, UNPROVEN = range(3)
"""What a search ends with; as `columns.Between` has it: clear, contact, undecided."""


class Questions(NamedTuple):
    """k intervals of pairs to search; what `Intervals` is in doubt of."""

    bodies: Integers  # (k, 2) bodies a and b
    chain: Integers  # (k, 2) ways of `Chains`: over the common ancestor, and for boxes along the world's axes over it
    time: Integers  # (k, 2) [ns] begin and end
    level: Bytes  # (k, 2) level at the ends, as the columns have it
    doubt: Bytes  # (k,) bits of what is asked


QUESTIONS_TYPE = record(Questions, int64[:, ::1], int64[:, ::1], int64[:, ::1], uint8[:, ::1], uint8[::1])


class Search(NamedTuple):
    """What a search asks GJK with, and the moments that it waits to deal with."""

    work: Workspace
    precise: Floats  # (4, 3, 2)
    nodes: Integers
    gaps: Floats
    seed: Integers
    rotation: Floats
    translation: Floats
    time: Integers  # (DEPTH,) [ns]
    distance: Floats  # (DEPTH,) [m] lower bound
    meets: Bytes  # (DEPTH,)
    bracket: Integers  # (2,) [ns] earliest and latest
    lines: Lines
    ends: Ends
    corners: Sets  # row k: of volume k, the centre alone of a sphere
    counts: Integers  # (COUNTS,)


@kernel
def _search(links: int, corners: Sets, counts: Integers) -> Search:
    return Search(
        workspace(),
        precise_points(),
        np.empty((STACK, 2), np.int64),
        np.empty(STACK),
        np.empty((7, 2), np.int64),
        np.empty((3, 3)),
        np.empty(3),
        np.empty(DEPTH, np.int64),
        np.empty(DEPTH),
        np.empty(DEPTH, np.uint8),
        np.empty(2, np.int64),
        lines(links),
        ends(),
        corners,
        counts,
    )


@leaf_kernel
def look(
    bodies: Bodies,
    volumes: Volumes,
    line: Timeline,
    chains: Chains,
    q: Questions,
    k: int,
    what: int,
    t: int,
    limit: float,
    s: Scratch,
    wide: Scratch,
    r: Search,
) -> tuple[bool, float]:
    """Return whether the pair of question k meets at time t [ns], and a lower bound on its distance [m]."""
    a, b = q.bodies[k, 0], q.bodies[k, 1]
    seconds = t / 1e9
    place(line, chains, q.chain[k, 0], seconds, s)
    if volumes.kind == AABB:
        place(line, chains, q.chain[k, 1], seconds, wide)
        pose = wide.frames[0, chains.first[2 * q.chain[k, 1] + 1] - chains.first[2 * q.chain[k, 1]]]
        for i in range(3):
            for j in range(3):
                s.turn[i, j] = pose[i, j]
    pose = s.pose[3]
    r.counts[MOMENTS] += 1
    if what == VOLUMES:
        if volumes_meet(volumes, a, b, pose, s.turn, s.boxes):
            return True, 0.0
        return False, max(boxes_gap(volumes, a, b, pose, s.turn, s.boxes), 0.0)
    size = bodies.reach[a] + bodies.reach[b]
    for i in range(3):
        r.translation[i] = pose[i, 3]
        size += abs(pose[i, 3])
        for j in range(3):
            r.rotation[i, j] = pose[i, j]
    status, distance = closest(
        bodies, a, b, r.rotation, r.translation, limit, r.seed, r.work, r.precise, r.nodes, r.gaps, r.counts
    )
    # surfaces that are apart may still hold each other, where their volumes meet
    held = status == SEPARATED and (bodies.surface[a] or bodies.surface[b])
    held = held and volumes_meet(volumes, a, b, pose, s.turn, s.boxes)
    if held and hold_each_other(bodies, a, b, r.rotation, r.translation):
        return True, 0.0
    if status != SEPARATED:
        return status != UNDECIDED, 0.0
    return False, max(proven_distance(min(distance, limit), size), 0.0)


@leaf_kernel
def proven_distance(distance: float, size: float) -> float:
    """Return a lower bound on the distance [m] of two bodies that are `distance` apart by GJK, or farther."""
    return distance * PROVEN_SHARE - PROVEN_ROUNDING * size


@leaf_kernel
def _by_pieces(
    bodies: Bodies,
    volumes: Volumes,
    line: Timeline,
    chains: Chains,
    q: Questions,
    k: int,
    what: int,
    t0: int,
    t1: int,
    way: float,
    split: int,
    n: int,
    rounding: float,
    s: Scratch,
    r: Search,
) -> float:
    """Return what `piece_proof` proves of a part whose travel is written; `s` is of the way that is searched."""
    a, b = q.bodies[k, 0], q.bodies[k, 1]
    in_world = what == VOLUMES and volumes.kind == AABB
    path = q.chain[k, 1 if in_world else 0]
    measure_changes(line, n, t0 / 1e9, t1 / 1e9, s, r.lines)
    size = bodies.reach[a] + bodies.reach[b] + way
    for end in range(2):
        place(line, chains, path, (t0 if end == 0 else t1) / 1e9, s)
        write_lines(line, chains, path, end, n, s, r.lines)
        write_end(end, s.pose[3], r.ends)
    for i in range(3):
        size += max(abs(r.ends.translation[0, i]), abs(r.ends.translation[1, i]))
    slack = (8.0 + n) * rounding
    if what == VOLUMES:
        size += volumes.radius[a] + volumes.radius[b]
        slack += _MEETING * size
        if in_world:
            return float(apart_in_world(r.corners, a, b, n, slack, s, r.lines))
        pad = 0.0 if volumes.kind == OBB else volumes.radius[a] + volumes.radius[b]
        bound = sets_apart(
            r.corners, a, b, pad, way, split, n, size, slack, s, r.lines, r.ends, r.work, r.precise, r.counts
        )
        return float(bound)
    return float(
        apart_by_pieces(bodies, a, b, way, split, n, size, slack, s, r.lines, r.ends, r.work, r.precise, r.counts)
    )


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
                apart = _by_pieces(
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


@rare_entry(
    BODIES_TYPE,
    VOLUMES_TYPE,
    SETS_TYPE,
    TIMELINE_TYPE,
    CHAINS_TYPE,
    QUESTIONS_TYPE,
    float64,
    int64,
    uint8[::1],
    float64[::1],
    int64[:, ::1],
    int64[::1],
)
@kernel
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
        counts: (COUNTS,) added to.
    """
    longest = 0
    for row in range(len(chains.first) - 1):
        longest = max(longest, chains.first[row + 1] - chains.first[row])
    s, wide, r = way_scratch(longest), way_scratch(longest), _search(longest, corners, counts)
    return int(_answer(bodies, volumes, line, chains, q, cap, resolution, between, bound, events, s, wide, r))


@leaf_kernel
def _answer(
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
        r.seed[0, 0], r.seed[0, 1] = -1, -1
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
