"""One look between two frames: whether a pair meets at a moment and how far apart it is, and what its pieces prove.

A look takes the exact poses at whole nanoseconds. The same serves the bodies and their bounding volumes, whose sphere
holds their corners.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float64, int64, uint8

from replay.collision import traversal
from replay.collision.bodies import AABB, OBB, Bodies, Volumes
from replay.collision.broad import volumes_meet
from replay.collision.directed import LINES_TYPE, Lines, lines, measure_changes, write_lines
from replay.collision.gjk_exact import SEPARATED, UNDECIDED, WORKSPACE_TYPE, Workspace, precise_points, workspace
from replay.collision.gjk_kernel import ROUNDING
from replay.collision.narrow import hold_each_other
from replay.collision.piece_proof import ENDS_TYPE, Ends, apart_by_pieces, apart_in_world, ends, sets_apart, write_end
from replay.collision.support import SETS_TYPE, Sets
from replay.collision.traversal import STACK, closest
from replay.collision.volume_gap import boxes_gap
from replay.collision.way_steps import Chains, Scratch, place
from replay.kinematics.timeline import Timeline
from replay.numerics.arrays import Bytes, Floats, Integers
from replay.numerics.jit import leaf_kernel, record

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


SEARCH_TYPE = record(
    Search,
    WORKSPACE_TYPE,
    float64[:, :, ::1],
    int64[:, ::1],
    float64[::1],
    int64[::1],
    float64[:, ::1],
    float64[::1],
    int64[::1],
    float64[::1],
    uint8[::1],
    int64[::1],
    LINES_TYPE,
    ENDS_TYPE,
    SETS_TYPE,
    int64[::1],
)


def search_scratch(links: int, corners: Sets, counts: Integers) -> Search:
    """Return scratch for ways of at most so many links; `corners` and `counts` as `crossing_search.search` has them."""
    return Search(
        workspace(),
        precise_points(),
        np.empty((STACK, 2), np.int64),
        np.empty(STACK),
        np.empty(2, np.int64),
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
def apart_in_pieces(
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
