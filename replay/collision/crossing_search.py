"""Between two frames: a proof that a pair stays apart, or the moment at which it meets, by bisection in time.

The pair's links are joined by a way of joints, from link a up to the nearest common ancestor and down to link b. For
any link m on it, no point of B moves, as seen from m, farther in an interval than
    L_m = sum over joints between A and m of TV R^A + sum over joints between m and B of TV R^B,
TV the joint's travel and R^X the lever arm of body X: 1 for a joint that moves along an axis; for one that turns, the
distance of X's bounding sphere from the axis at one end, its radius, and what the joints between may add. The least
over m counts. Two bodies that are d0 and d1 apart at the ends cannot meet in between if d0 + d1 > L; their distance is
at least (d0 + d1 - L) / 2 throughout. A free joint is a translation and, on the side of its link, a rotation about the
link's origin.

Where the proof fails the interval is halved, the earlier half first, with the exact poses at the middle: `sweep`. It
ends with every part proven, with a meeting whose every earlier moment is proven clear up to a `resolution` before, or
with parts that neither is known of. The same search serves the bounding volumes, whose sphere holds their corners.
Times are whole nanoseconds, so that whoever asks for the poses at the time that is told sees what was seen here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64, int64, uint8
from numpy.typing import NDArray

from replay.collision import traversal
from replay.collision.bodies import AABB, BODIES_TYPE, OBB, VOLUMES_TYPE, Bodies, Volumes
from replay.collision.broad import sphere_gap, volumes_meet
from replay.collision.gjk_exact import SEPARATED, UNDECIDED, Workspace, workspace
from replay.collision.gjk_kernel import ROUNDING
from replay.collision.narrow import hold_each_other
from replay.collision.traversal import STACK, closest
from replay.geometry.overlap import obbs_gap
from replay.kinematics.linkage import POSE_ROUNDING
from replay.kinematics.timeline import FIXED, FREE, PRISMATIC, TIMELINE_TYPE, Timeline, compose, local_pose
from replay.kinematics.travel import HALVINGS, SHIFT, TRAVEL, TURN, free_travel, joint_travel
from replay.numerics.jit import entry, kernel, leaf_kernel, record

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
Bytes = NDArray[np.uint8]

LOOKS = 1024
"""Cap of a search: moments looked at. What is left then is undecided."""

PARTS = 8
"""The shortest part that is looked at is this part of the resolution: so a meeting stays within the resolution, even
where the parts just before it cannot be proven."""

DEPTH = 80
"""Moments waiting: each halves what is left of at most 2^63 ns."""

ROUNDING_UP = 1.0 + 2.0**-40

BODIES, VOLUMES = 0, 1
"""What is searched for: a contact of the bodies, or of their bounding volumes."""

CONTACT_DOUBT, BOUNDS_DOUBT = 1, 2
"""What an interval is searched for, bits."""

COUNTS = traversal.COUNTS + 1
MOMENTS = traversal.COUNTS
"""Counter after those of `traversal`: moments looked at."""

ALONG, ABOUT, BALL = range(3)
"""Kinds of steps of a way: along an axis or a path, about an axis, about a point."""

PROVEN, FOUND, UNPROVEN = range(3)
"""What a search ends with; as `columns.Between` has it: clear, contact, undecided."""


class Chains(NamedTuple):
    """Ways between links: the links of side s of way q, from below the common ancestor down, are `link[first[2 q + s]:
    first[2 q + s + 1]]`."""

    first: Integers
    link: Integers


CHAINS_TYPE = record(Chains, int64[::1], int64[::1])


class Questions(NamedTuple):
    """k intervals of pairs to search; rows as `ask` writes them."""

    bodies: Integers  # (k, 2) bodies a and b
    chain: Integers  # (k, 2) ways of `Chains`: over the common ancestor, and for boxes along the world's axes over it
    time: Integers  # (k, 2) [ns] begin and end
    level: Bytes  # (k, 2) level at the ends, as the columns have it
    doubt: Bytes  # (k,) bits of what is asked


QUESTIONS_TYPE = record(Questions, int64[:, ::1], int64[:, ::1], int64[:, ::1], uint8[:, ::1], uint8[::1])


class Scratch(NamedTuple):
    """What a search works in: the way of the pair at one time, and its steps from A to B."""

    frames: Floats  # (2, D + 1, 4, 4) identity, then the poses of the links of each side in their common ancestor
    pose: Floats  # (4, 4, 4): local pose, its scratch, an inverse, and T_a_b
    kind: Integers  # (E,)
    side: Integers  # (E,)
    row: Integers  # (E,) of `frames`: of the link whose joint it is
    link: Integers  # (E,)
    travel: Floats  # (E,) in an interval
    arm: Floats  # (2, E): lever arms of A and of B
    sum: Floats  # (E + 1,)
    variation: Floats  # (HALVINGS + 8, 8)
    found: Floats  # (4,)
    boxes: Floats  # (8, 4)
    turn: Floats  # (3, 3)
    center: Floats  # (2, 3) of the bodies' spheres, in the common ancestor


class Search(NamedTuple):
    """What a search asks GJK with, and the moments that it waits to deal with."""

    work: Workspace
    nodes: Integers
    gaps: Floats
    seed: Integers
    rotation: Floats
    translation: Floats
    time: Integers  # (DEPTH,) [ns]
    distance: Floats  # (DEPTH,) [m] lower bound
    meets: Bytes  # (DEPTH,)
    bracket: Integers  # (2,) [ns] earliest and latest
    counts: Integers  # (COUNTS,)


@kernel
def _scratch(links: int) -> Scratch:
    steps = 4 * links + 2
    frames = np.zeros((2, links + 1, 4, 4))
    for side in range(2):
        for i in range(4):
            frames[side, 0, i, i] = 1.0
    return Scratch(
        frames,
        np.zeros((4, 4, 4)),
        np.empty(steps, np.int64),
        np.empty(steps, np.int64),
        np.empty(steps, np.int64),
        np.empty(steps, np.int64),
        np.empty(steps),
        np.empty((2, steps)),
        np.empty(steps + 1),
        np.empty((HALVINGS + 8, 8)),
        np.empty(4),
        np.zeros((8, 4)),
        np.zeros((3, 3)),
        np.empty((2, 3)),
    )


@kernel
def _search(counts: Integers) -> Search:
    return Search(
        workspace(),
        np.empty((STACK, 2), np.int64),
        np.empty(STACK),
        np.empty((7, 2), np.int64),
        np.empty((3, 3)),
        np.empty(3),
        np.empty(DEPTH, np.int64),
        np.empty(DEPTH),
        np.empty(DEPTH, np.uint8),
        np.empty(2, np.int64),
        counts,
    )


@leaf_kernel
def place(line: Timeline, chains: Chains, way: int, t: float, s: Scratch) -> None:
    """Write the poses of a way's links at time t [s], and T_a_b, as `RelativePoses.of` computes it."""
    local, spare, inverse, relative = s.pose[0], s.pose[1], s.pose[2], s.pose[3]
    for side in range(2):
        begin, end = chains.first[2 * way + side], chains.first[2 * way + side + 1]
        for k in range(end - begin):
            local_pose(line, chains.link[begin + k], t, spare, local)
            compose(s.frames[side, k], local, s.frames[side, k + 1])
    a = s.frames[0, chains.first[2 * way + 1] - chains.first[2 * way]]
    for i in range(3):
        for j in range(3):
            inverse[i, j] = a[j, i]
        inverse[i, 3] = -(a[0, i] * a[0, 3] + a[1, i] * a[1, 3] + a[2, i] * a[2, 3])
    compose(inverse, s.frames[1, chains.first[2 * way + 2] - chains.first[2 * way + 1]], relative)


@leaf_kernel
def list_steps(line: Timeline, chains: Chains, way: int, s: Scratch) -> int:
    """Write the steps of the way from A to B; return how many."""
    n = 0
    for side in range(2):
        begin, end = chains.first[2 * way + side], chains.first[2 * way + side + 1]
        for place in range(end - begin):
            k = place if side == 1 else end - begin - 1 - place
            link = chains.link[begin + k]
            kind = line.kind[link]
            for part in range(2 if kind == FREE else 1 if kind != FIXED else 0):
                s.side[n], s.row[n], s.link[n] = side, k + 1, link
                if kind == FREE:  # the rotation is on the side of the link
                    s.kind[n] = BALL if part == side else ALONG
                else:
                    s.kind[n] = ALONG if kind == PRISMATIC else ABOUT
                n += 1
    return n


@leaf_kernel
def measure_travel(line: Timeline, n: int, t0: float, t1: float, s: Scratch) -> None:
    """Write the travel of each of n steps over [t0, t1] [s]."""
    for i in range(n):
        link = s.link[i]
        if line.kind[link] == FREE:
            free_travel(line, line.joint[link], t0, t1, s.found)
            s.travel[i] = s.found[TURN if s.kind[i] == BALL else SHIFT]
        else:
            joint_travel(line, line.joint[link], t0, t1, s.variation, s.found)
            s.travel[i] = s.found[TRAVEL]


@leaf_kernel
def measure_arms(
    line: Timeline, chains: Chains, volumes: Volumes, way: int, a: int, b: int, n: int, s: Scratch
) -> float:
    """Write the lever arms of A and B over an interval whose travel is written, from the poses at one end of it.

    Returns the rounding of a pose [m], of either body as seen from the other.
    """
    size = volumes.radius[a] + volumes.radius[b]
    for side in range(2):
        begin, end = chains.first[2 * way + side], chains.first[2 * way + side + 1]
        pose, c = s.frames[side, end - begin], volumes.center[a if side == 0 else b]
        for i in range(3):
            s.center[side, i] = pose[i, 0] * c[0] + pose[i, 1] * c[1] + pose[i, 2] * c[2] + pose[i, 3]
            size += abs(c[i])
        for k in range(end - begin):
            joint = line.place[chains.link[begin + k]]
            for i in range(3):
                # a step's length is at most the way from the step before
                size += abs(joint[i, 3]) + abs(s.frames[side, k + 1, i, 3] - s.frames[side, k, i, 3])
    for body in range(2):
        moved, radius = 0.0, volumes.radius[a if body == 0 else b]
        for step in range(n):
            i = step if body == 0 else n - 1 - step
            arm = 1.0
            if s.kind[i] != ALONG:
                pose, axis = s.frames[s.side[i], s.row[i]], line.axis[s.link[i]]
                x, y, z = (
                    s.center[body, 0] - pose[0, 3],
                    s.center[body, 1] - pose[1, 3],
                    s.center[body, 2] - pose[2, 3],
                )
                square = x * x + y * y + z * z
                if s.kind[i] == ABOUT:
                    u = pose[0, 0] * axis[0] + pose[0, 1] * axis[1] + pose[0, 2] * axis[2]
                    v = pose[1, 0] * axis[0] + pose[1, 1] * axis[1] + pose[1, 2] * axis[2]
                    w = pose[2, 0] * axis[0] + pose[2, 1] * axis[1] + pose[2, 2] * axis[2]
                    square = (y * w - z * v) ** 2 + (z * u - x * w) ** 2 + (x * v - y * u) ** 2
                arm = (math.sqrt(square) + radius + moved) * ROUNDING_UP + POSE_ROUNDING * size
            s.arm[body, i] = arm
            moved += arm * s.travel[i]
        size += moved
    return float(POSE_ROUNDING * size)


@leaf_kernel
def least_way(n: int, s: Scratch) -> float:
    """Return the least L_m [m] over the links of the way, of an interval whose travel is written."""
    s.sum[n] = 0.0
    for i in range(n - 1, -1, -1):
        s.sum[i] = s.sum[i + 1] + s.travel[i] * s.arm[1, i]
    before, least = 0.0, s.sum[0]
    for i in range(n):
        before += s.travel[i] * s.arm[0, i]
        least = min(least, before + s.sum[i + 1])
    return float(least * ROUNDING_UP)


@leaf_kernel
def boxes_gap(volumes: Volumes, a: int, b: int, pose: Floats, turn: Floats, scratch: Floats) -> float:
    """Return a lower bound on the distance [m] of two bodies' volumes that do not meet; arguments of `volumes_meet`."""
    gap = sphere_gap(volumes, a, b, pose)
    if volumes.kind == OBB:
        box = obbs_gap(
            volumes.center[a],
            volumes.half[a],
            volumes.axes[a],
            volumes.center[b],
            volumes.half[b],
            volumes.axes[b],
            pose,
        )
        gap = max(gap, box)
    elif volumes.kind == AABB:  # `volumes_meet` left both boxes in the scratch
        for i in range(3):
            reach = scratch[5, i] + scratch[7, i]
            size = reach + abs(scratch[i, 3]) + abs(scratch[4, i]) + abs(scratch[6, i])
            gap = max(gap, abs(scratch[i, 3] + scratch[6, i] - scratch[4, i]) - reach - 2.0**-44 * size)
    return gap


@kernel
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
        bodies, a, b, r.rotation, r.translation, limit, r.seed, r.work, r.nodes, r.gaps, r.counts
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
    """Return a lower bound on the distance [m] of two bodies that GJK says are `distance` apart, or farther than that.

    GJK accepts a distance whose proven lower bound is within 1e-12 of it and its rounding, see `gjk_kernel`.
    """
    return distance * (1.0 - 2.0**-38) - 8.0 * ROUNDING * size


@kernel
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
    looks = 0
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
            apart = 0.5 * (distance + d - least_way(n, steps) - 2.0 * rounding)
            if apart > 0.0:
                bound, frontier, distance = min(bound, apart), t, d
                waiting -= 1
                continue
        start = unproven if any_unproven else frontier
        if meets and (abs(t - start) <= resolution or length <= shortest or looks >= LOOKS):
            r.bracket[0], r.bracket[1] = start, t
            return FOUND, 0.0
        if length <= shortest or looks >= LOOKS or waiting >= DEPTH:
            if not any_unproven:
                any_unproven, unproven = True, frontier
            frontier, distance = t, d
            waiting -= 1
            continue
        middle = frontier + (t - frontier) // 2
        looks += 1
        found, apart = look(bodies, volumes, line, chains, q, k, what, middle, limit, s, wide, r)
        r.time[waiting], r.distance[waiting], r.meets[waiting] = middle, apart, 1 if found else 0
        waiting += 1
    if any_unproven:
        return UNPROVEN, 0.0
    return PROVEN, bound


@entry(
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
    int64[::1],
)
@kernel
def search(
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
    counts: Integers,
) -> int:
    """Answer questions; return how many events were written.

    Args:
        bodies, volumes, line, chains: of the scene.
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
    s, wide, r = _scratch(longest), _scratch(longest), _search(counts)
    written = 0
    for k in range(len(q.doubt)):
        a, b, t0, t1 = q.bodies[k, 0], q.bodies[k, 1], q.time[k, 0], q.time[k, 1]
        way = q.chain[k, 0]
        place(line, chains, way, t0 / 1e9, s)
        n = list_steps(line, chains, way, s)
        measure_travel(line, n, t0 / 1e9, t1 / 1e9, s)
        rounding = measure_arms(line, chains, volumes, way, a, b, n, s)
        limit = cap + least_way(n, s)
        first, last, apart = -1, -1, -1  # the bodies meet first, meet last, and are apart again, where that was found
        before, after = q.level[k, 0] == 2, q.level[k, 1] == 2
        r.seed[0, 0], r.seed[0, 1] = -1, -1
        if q.doubt[k] & CONTACT_DOUBT:
            d0, d1 = 0.0, 0.0
            if not before:
                d0 = look(bodies, volumes, line, chains, q, k, BODIES, t0, limit, s, wide, r)[1]
            if not after:
                d1 = look(bodies, volumes, line, chains, q, k, BODIES, t1, limit, s, wide, r)[1]
            if not before:
                r.time[0], r.distance[0], r.meets[0] = t1, d1, 1 if after else 0
                outcome, proven = sweep(
                    bodies, volumes, line, chains, q, k, BODIES, t0, d0, 1, limit, resolution, n, rounding, s, wide, r
                )
                if outcome == FOUND:
                    written = _write(events, written, k, 2, 1, r.bracket[0], r.bracket[1])
                    first = r.bracket[1]
                if not after:
                    between[k] = outcome
                    bound[k] = min(proven, cap) if outcome == PROVEN else 0.0
            if not after and (before or first >= 0):
                r.time[0], r.distance[0], r.meets[0] = t0 if before else first, 0.0, 1
                sweep(
                    bodies, volumes, line, chains, q, k, BODIES, t1, d1, 1, limit, resolution, n, rounding, s, wide, r
                )
                written = _write(events, written, k, 2, 0, r.bracket[1], r.bracket[0])
                last, apart = r.bracket[1], r.bracket[0]
        before, after = q.level[k, 0] >= 1, q.level[k, 1] >= 1
        if (before and after) or not (q.doubt[k] & BOUNDS_DOUBT or first >= 0):
            continue
        if volumes.kind == AABB:
            way = q.chain[k, 1]
            place(line, chains, way, t0 / 1e9, wide)
            n = list_steps(line, chains, way, wide)
            measure_travel(line, n, t0 / 1e9, t1 / 1e9, wide)
            rounding = measure_arms(line, chains, volumes, way, a, b, n, wide)
        if not before:
            distance = look(bodies, volumes, line, chains, q, k, VOLUMES, t0, limit, s, wide, r)[1]
            r.time[0], r.distance[0], r.meets[0] = t1, 0.0, 1 if after else 0
            if first >= 0:
                r.time[0], r.meets[0] = first, 1
            elif not after:
                r.distance[0] = look(bodies, volumes, line, chains, q, k, VOLUMES, t1, limit, s, wide, r)[1]
            outcome, _ = sweep(
                bodies,
                volumes,
                line,
                chains,
                q,
                k,
                VOLUMES,
                t0,
                distance,
                1,
                limit,
                resolution,
                n,
                rounding,
                s,
                wide,
                r,
            )
            if outcome != FOUND:
                continue
            written = _write(events, written, k, 1, 1, r.bracket[0], r.bracket[1])
            last = max(last, r.bracket[1])
        if not after:
            distance = look(bodies, volumes, line, chains, q, k, VOLUMES, t1, limit, s, wide, r)[1]
            r.time[0], r.distance[0], r.meets[0] = max(last, t0), 0.0, 1
            sweep(
                bodies,
                volumes,
                line,
                chains,
                q,
                k,
                VOLUMES,
                t1,
                distance,
                1,
                limit,
                resolution,
                n,
                rounding,
                s,
                wide,
                r,
            )
            written = _write(events, written, k, 1, 0, r.bracket[1], max(r.bracket[0], apart))
    return written


@leaf_kernel
def _write(events: Integers, row: int, k: int, level: int, begins: int, earliest: int, latest: int) -> int:
    events[row, 0], events[row, 1], events[row, 2] = k, level, begins
    events[row, 3], events[row, 4] = earliest, latest
    return row + 1
