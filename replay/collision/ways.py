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

import numpy as np
from numba import float64, int64

from replay.collision.bodies import VOLUMES_TYPE, Volumes
from replay.kinematics.linkage import POSE_ROUNDING
from replay.kinematics.timeline import FREE, PRISMATIC, TIMELINE_TYPE, Timeline
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, leaf_kernel

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
    float64[:, :, ::1],
    float64[:, ::1],
    float64[:, ::1],
)
@leaf_kernel
def fill_ways(
    line: Timeline,
    volumes: Volumes,
    links: Integers,
    local: Floats,
    travel: Floats,
    first: Integers,
    centers: Floats,
    ways: Floats,
    rounding: Floats,
) -> None:
    """Write where bodies are in frames, and how far they move in the intervals between.

    Args:
        line: of L links.
        volumes: of B bodies.
        links: (B,) the bodies' links.
        local: (n + 1, L, 4, 4) T_parent_link in all frames.
        travel: (L, n, 2), see `travel.link_travel`.
        first: (B + 1,) see `first_ways`.
        centers: (V, n + 1, 4) out [m], centre of the body's bounding sphere as seen from there, and its rounding.
        ways: (V, n) out [m].
        rounding: (V, n) out [m], rounding of the place of the body as seen from there.
    """
    frames = len(local)
    for body in range(len(links)):
        link, row = links[body], first[body + 1] - 1
        c, radius = volumes.center[body], volumes.radius[body]
        reach = math.sqrt(c[0] * c[0] + c[1] * c[1] + c[2] * c[2]) + radius
        for f in range(frames):
            centers[row, f, 0], centers[row, f, 1], centers[row, f, 2], centers[row, f, 3] = c[0], c[1], c[2], reach
        for f in range(frames - 1):
            ways[row, f] = 0.0
            rounding[row, f] = 0.0
        rests = True  # as seen from where it is so far: then one frame is as all are
        while link >= 0:
            points = centers[row]
            row -= 1
            for f in range(frames - 1):
                below, arm = ways[row + 1, f], 1.0
                moves = travel[link, f, 0] > 0.0 or travel[link, f, 1] > 0.0
                rests = rests and not moves
                if moves and line.kind[link] != PRISMATIC:
                    arm = _distance(line, link, points[f]) + radius + below
                moved = travel[link, f, 0] * arm
                if line.kind[link] == FREE:
                    moved = travel[link, f, 0] + travel[link, f, 1] * arm
                ways[row, f] = (below + moved) * ROUNDING_UP
            place = line.place[link]
            step = abs(place[0, 3]) + abs(place[1, 3]) + abs(place[2, 3])
            for f in range(frames):  # the steps are added up until they are all there
                if rests and f > 0:
                    for i in range(4):
                        centers[row, f, i] = centers[row, 0, i]
                else:
                    centers[row, f, 3] = points[f, 3] + step + _to_parent(local[f, link], points[f], centers[row, f])
            for f in range(frames):
                points[f, 3] *= POSE_ROUNDING
            for f in range(frames - 1):
                rounding[row, f] = POSE_ROUNDING * (max(centers[row, f, 3], centers[row, f + 1, 3]) + ways[row, f])
            link = line.parent[link]
        for f in range(frames):
            centers[row, f, 3] *= POSE_ROUNDING


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
