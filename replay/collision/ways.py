"""Where bodies are in the frames of a block, and how far they move between them as seen from the links above.

Let X be a body and l a link above it, or the link it is on. The joint of l moves a point of X by at most its travel
times the lever arm of X: 1 for a joint that moves along an axis; for one that turns, the largest distance of X from its
axis, for a free joint from its origin. That is the distance of the centre of X's bounding sphere at the frame that an
interval begins at, plus the sphere's radius, plus what the joints below l move X in the interval. What the joints from
X up to a link c, c's own excluded, move together is a bound for any point of X as seen from c. So what is said of an
interval depends on its two frames and what is between them alone, not on the block that it is computed in.
Two bodies that approach each other by way of c, their nearest common ancestor, cannot do so by more than the sum.

The poses themselves are rounded: what is said of them is said with `POSE_ROUNDING` of the steps between the links.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import float64, int64

from replay.collision.bodies import VOLUMES_TYPE, Volumes
from replay.kinematics.linkage import POSE_ROUNDING
from replay.kinematics.timeline import FREE, PRISMATIC, TIMELINE_TYPE, Timeline
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, leaf_kernel, record

ROUNDING_UP = 1.0 + 2.0**-40
"""Above the rounding of everything that is added up here."""

STRETCH = 16
"""Intervals of a block that are looked at together before each of them is."""

FAR, QUIET, NEAR = range(3)
"""What a stretch may hold of a pair: the largest bound in all intervals; nothing within the limit in any frame, and all
intervals proven by that; or more."""


def first_ways(links: Integers, line: Timeline) -> Integers:
    """Return (B + 1,): rows first[k] .. first[k + 1] - 1 of `fill_ways` are those of body k.

    Row first[k] + d is as seen from the link above the body that has d links on its path from the root, itself
    included: the world for d = 0, the body's own link in the last row, which is all zero.
    """
    depth = np.zeros(len(line.parent), dtype=np.int64)
    for link in range(len(line.parent)):
        above = link
        while above >= 0:
            depth[link] += 1
            above = int(line.parent[above])
    return np.concatenate([[0], np.cumsum(depth[links] + 1)]).astype(np.int64)


class Ways(NamedTuple):
    """Where bodies are in n + 1 frames, and how far they move in the n intervals between; V rows as `first_ways`."""

    centers: Floats  # (V, n + 1, 4) [m], centre of the body's bounding sphere as seen from there, and its rounding
    ways: Floats  # (V, n) [m]
    rounding: Floats  # (V, n) [m], rounding of the place of the body as seen from there


WAYS_TYPE = record(Ways, float64[:, :, ::1], float64[:, ::1], float64[:, ::1])


def no_ways(rows: int, intervals: int) -> Ways:
    """Return arrays to be filled."""
    shape = rows, intervals
    return Ways(np.empty((rows, intervals + 1, 4)), np.empty(shape), np.empty(shape))


@leaf_kernel
def fill_ways(
    line: Timeline,
    volumes: Volumes,
    links: Integers,
    local: Floats,
    travel: Floats,
    first: Integers,
    top: Integers,
    begin: int,
    end: int,
    found: Ways,
) -> None:
    """Write where bodies are in the frames begin..end, and how far they move in the intervals between.

    Args:
        line: of L links.
        volumes: of B bodies.
        links: (B,) the bodies' links.
        local: (m + 1, L, 4, 4) T_parent_link in all frames.
        travel: (L, m, 2), see `travel.link_travel`.
        first: (B + 1,) see `first_ways`.
        top: (B,) the uppermost row of each body that is asked for, first[b + 1] for none.
        begin, end: frames.
        found: out, the frame `begin` in its first column.
    """
    centers, ways, rounding = found.centers, found.ways, found.rounding
    count = end - begin
    for body in range(len(links)):
        link, row = links[body], first[body + 1] - 1
        if top[body] > row:
            continue
        c, radius = volumes.center[body], volumes.radius[body]
        reach = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + radius
        for f in range(count + 1):
            centers[row, f, 0], centers[row, f, 1], centers[row, f, 2], centers[row, f, 3] = c[0], c[1], c[2], reach
        for f in range(count):
            ways[row, f] = 0.0
            rounding[row, f] = 0.0
        rests = True  # as seen from where it is so far: then one frame is as all are
        while row > top[body]:
            points = centers[row]
            row -= 1
            for f in range(count):
                below, arm = ways[row + 1, f], 1.0
                shift, turn = travel[link, begin + f, 0], travel[link, begin + f, 1]
                moves = shift > 0.0 or turn > 0.0
                rests = rests and not moves
                if moves and line.kind[link] != PRISMATIC:
                    arm = _distance(line, link, points[f]) + radius + below
                moved = shift * arm
                if line.kind[link] == FREE:
                    moved = shift + turn * arm
                ways[row, f] = (below + moved) * ROUNDING_UP
            place = line.place[link]
            step = abs(place[0, 3]) + abs(place[1, 3]) + abs(place[2, 3])
            for f in range(count + 1):  # the steps are added up until they are all there
                if rests and f > 0:
                    for i in range(4):
                        centers[row, f, i] = centers[row, 0, i]
                else:
                    pose = local[begin + f, link]
                    centers[row, f, 3] = points[f, 3] + step + _to_parent(pose, points[f], centers[row, f])
            for f in range(count + 1):
                points[f, 3] *= POSE_ROUNDING
            for f in range(count):
                rounding[row, f] = POSE_ROUNDING * (max(centers[row, f, 3], centers[row, f + 1, 3]) + ways[row, f])
            link = line.parent[link]
        for f in range(count + 1):
            centers[row, f, 3] *= POSE_ROUNDING


@entry(
    TIMELINE_TYPE,
    VOLUMES_TYPE,
    int64[::1],
    float64[:, :, :, ::1],
    float64[:, :, ::1],
    int64[::1],
    float64[:, :, :, ::1],
    float64[:, :, ::1],
    float64[::1],
    WAYS_TYPE,
)
@leaf_kernel
def fill_stretches(
    line: Timeline,
    volumes: Volumes,
    links: Integers,
    local: Floats,
    travel: Floats,
    first: Integers,
    middle: Floats,
    swept: Floats,
    share: Floats,
    found: Ways,
) -> None:
    """Write where bodies are in the middle of each stretch of a block, and how far they move in all of it.

    To either end of the stretch the joints travel at most half of what they are said to here; an arm in any interval of
    it is at most that in the middle and the way of the joints below to there and through the interval. So half of a way
    that is found is no less than the ways of the intervals up to either end together.

    Args:
        line, volumes, links, local, travel, first: as of `fill_ways`.
        middle: (K + 1, L, 4, 4) out, T_parent_link in the middle frames of the K stretches, the last one twice.
        swept: (L, K, 2) scratch.
        share: (K,) out, the part of a way that no single interval of the stretch exceeds.
        found: out, a column a stretch.
    """
    count = len(share)
    for k in range(count):
        begin, half, end = stretch(k, travel.shape[1])
        share[k] = 0.0
        for link in range(travel.shape[0]):
            for i in range(2):
                before, after, most = 0.0, 0.0, 0.0
                for f in range(begin, end):
                    if f < half:
                        before += travel[link, f, i]
                    else:
                        after += travel[link, f, i]
                    most = max(most, travel[link, f, i])
                swept[link, k, i] = 2.0 * max(before, after)
                if most > 0.0:
                    share[k] = max(share[k], most / swept[link, k, i])
        for copy in range(2 if k == count - 1 else 1):
            for link in range(travel.shape[0]):
                for i in range(4):
                    for j in range(4):
                        middle[k + copy, link, i, j] = local[half, link, i, j]
    fill_ways(line, volumes, links, middle, swept, first, first, 0, count, found)


@leaf_kernel
def stretch(k: int, intervals: int) -> tuple[int, int, int]:
    """Return the frames at which a block's stretch k begins, is half over and ends."""
    begin, end = k * STRETCH, min((k + 1) * STRETCH, intervals)
    return begin, (begin + end) // 2, end


@inlined_kernel
def center_gap(volumes: Volumes, centers: Floats, pair: Integers, rows: Integers, f: int) -> float:
    """Return a lower bound on the distance [m] of two bodies in frame f by their spheres.

    Args:
        volumes: of all bodies.
        centers: of `fill_ways`.
        pair: bodies a, b.
        rows: theirs of `centers`, as seen from the nearest common ancestor.
        f: frame.
    """
    a, b = centers[rows[0], f], centers[rows[1], f]
    square = (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2
    gap: float = math.sqrt(square) - volumes.radius[pair[0]] - volumes.radius[pair[1]] - 2.0 * (a[3] + b[3])
    return gap


@leaf_kernel
def _distance(line: Timeline, link: int, p: Floats) -> float:
    """Return the distance [m] of a point in a link's frame from its joint's axis, or origin if it is free."""
    x, y, z = line.axis[link, 0], line.axis[link, 1], line.axis[link, 2]
    if line.kind[link] == FREE:
        x, y, z = 0.0, 0.0, 0.0
    along = p[0] * x + p[1] * y + p[2] * z
    return math.sqrt((p[0] - along * x) ** 2 + (p[1] - along * y) ** 2 + (p[2] - along * z) ** 2)


@leaf_kernel
def _to_parent(pose: Floats, point: Floats, mapped: Floats) -> float:
    """Map a point of a link to its parent; return the sum of the link's |coordinates| there."""
    x, y, z = point[0], point[1], point[2]
    for i in range(3):
        mapped[i] = pose[i, 0] * x + pose[i, 1] * y + pose[i, 2] * z + pose[i, 3]
    return float(abs(pose[0, 3]) + abs(pose[1, 3]) + abs(pose[2, 3]))
