"""How far bodies move between the frames of a block, as seen from the links above them.

Let X be a body and l a link above it, or the link it is on. The joint of l moves a point of X by at most its travel
times the lever arm of X: 1 for a joint that moves along an axis; for one that turns, the largest distance of X from its
axis, for a free joint from its origin. That is the distance of the centre of X's bounding sphere, the largest in all
frames, plus the sphere's radius, plus what the joints below l may move X between a frame and the next. What the joints
from X up to a link c, c's own excluded, move together is a bound for any point of X as seen from c, in each interval.
Two bodies that approach each other by way of c, their nearest common ancestor, cannot do so by more than the sum.

The poses themselves are rounded: what is said of them is said with `POSE_ROUNDING` of the steps between the links.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.collision.bodies import VOLUMES_TYPE, Volumes
from replay.kinematics.linkage import POSE_ROUNDING
from replay.kinematics.timeline import FREE, PRISMATIC, TIMELINE_TYPE, Timeline
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, leaf_kernel

ROUNDING_UP = 1.0 + 2.0**-40
"""Above the rounding of everything that is added up here."""


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


@entry(
    TIMELINE_TYPE,
    VOLUMES_TYPE,
    int64[::1],
    float64[:, :, :, ::1],
    float64[:, :, ::1],
    int64[::1],
    float64[:, ::1],
    float64[:, ::1],
    float64[::1],
)
@leaf_kernel
def fill_ways(
    line: Timeline,
    volumes: Volumes,
    links: Integers,
    local: Floats,
    travel: Floats,
    first: Integers,
    points: Floats,
    ways: Floats,
    rounding: Floats,
) -> None:
    """Write how far bodies move in the intervals between frames.

    Args:
        line: of L links.
        volumes: of B bodies.
        links: (B,) the bodies' links.
        local: (n + 1, L, 4, 4) T_parent_link in all frames.
        travel: (L, n, 2), see `travel.link_travel`.
        first: (B + 1,) see `first_ways`.
        points: (n + 1, 3) scratch.
        ways: (V, n) out [m].
        rounding: (V,) out [m], rounding of the place of the body as seen from there.
    """
    frames = len(local)
    for body in range(len(links)):
        link, row = links[body], first[body + 1] - 1
        c = volumes.center[body]
        for f in range(frames):
            for i in range(3):
                points[f, i] = c[i]
        for f in range(frames - 1):
            ways[row, f] = 0.0
        steps = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + volumes.radius[body]
        rounding[row] = 0.0
        below = 0.0  # the most that the joints below move the body within an interval
        while link >= 0:
            row -= 1
            arm = 1.0
            if line.kind[link] != PRISMATIC and line.joint[link] >= 0:
                arm = _largest_distance(line, link, points) + volumes.radius[body] + below
            for f in range(frames - 1):
                moved = travel[link, f, 0] * arm
                if line.kind[link] == FREE:
                    moved = travel[link, f, 0] + travel[link, f, 1] * arm
                ways[row, f] = (ways[row + 1, f] + moved) * ROUNDING_UP
                below = max(below, ways[row, f])
            longest = 0.0
            for f in range(frames):
                longest = max(longest, _to_parent(local[f, link], points[f]))
            place = line.place[link]
            steps += longest + abs(place[0, 3]) + abs(place[1, 3]) + abs(place[2, 3])
            rounding[row] = POSE_ROUNDING * (steps + below)
            link = line.parent[link]


@leaf_kernel
def _largest_distance(line: Timeline, link: int, points: Floats) -> float:
    """Return the largest distance [m] of points in a link's frame from its joint's axis, or origin if it is free."""
    square = 0.0
    x, y, z = line.axis[link, 0], line.axis[link, 1], line.axis[link, 2]
    if line.kind[link] == FREE:
        x, y, z = 0.0, 0.0, 0.0
    for f in range(len(points)):
        p = points[f]
        along = p[0] * x + p[1] * y + p[2] * z
        square = max(square, (p[0] - along * x) ** 2 + (p[1] - along * y) ** 2 + (p[2] - along * z) ** 2)
    return math.sqrt(square)


@leaf_kernel
def _to_parent(pose: Floats, point: Floats) -> float:
    """Map a point (3,) of a link to its parent, in place; return the sum of the link's |coordinates| there."""
    x, y, z = point[0], point[1], point[2]
    for i in range(3):
        point[i] = pose[i, 0] * x + pose[i, 1] * y + pose[i, 2] * z + pose[i, 3]
    return float(abs(pose[0, 3]) + abs(pose[1, 3]) + abs(pose[2, 3]))
