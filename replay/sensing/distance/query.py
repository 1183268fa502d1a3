"""The closest triangle of a mesh in a cone: a scan, or a walk of the wide tree that skips what cannot win.

Work is skipped only on lower bounds that hold after rounding (`bounds`), and among equal distances the lowest triangle
index wins, so the answer is the same bit for bit with or without the tree and whatever bound the search starts from.
Up to `_SCANNED` triangles the walk is a scan; from 3 on it was measured to win.
"""

from __future__ import annotations

import numpy as np

from replay.geometry.wide_tree import LANES, WideTree
from replay.numerics.arrays import Floats, Integers
from replay.numerics.constants import EPSILON
from replay.numerics.jit import kernel
from replay.numerics.triples import Triple
from replay.sensing.distance.bounds import box_bounds, corner_from, triangle_bounds
from replay.sensing.distance.cone import TOUCH, Cone
from replay.sensing.distance.triangle import closest_on_triangle

LARGEST = float(np.finfo(np.float64).max)

COUNTS = 4
REPEATED, BOXES, LOOKED_AT, COMPUTED = range(COUNTS)
"""Rows of the counters: frames answered from the one before, boxes bounded (eight at a time), places for triangles in
leaves that were reached, and triangles whose closest point in the cone was computed."""

SLACK = 2.0 * TOUCH
"""Rounding of any distance in a query, as part of the farthest coordinate seen from the apex."""

_SCANNED = 2


@kernel
def on_triangle(triangles: Floats, k: int, apex: Triple, cone: Cone) -> tuple[float, Triple, int]:
    """Return distance (inf when none), point relative to the apex and case for triangle k."""
    t = triangles[k]
    a = (t[0, 0] - apex[0], t[0, 1] - apex[1], t[0, 2] - apex[2])
    b = (t[1, 0] - apex[0], t[1, 1] - apex[1], t[1, 2] - apex[2])
    c = (t[2, 0] - apex[0], t[2, 1] - apex[1], t[2, 2] - apex[2])
    return closest_on_triangle(a, b, c, cone)


@kernel
def query_slack(tree: WideTree, apex: Triple, rounding: float) -> float:
    """Return what rounding, the apex's own included, can change in any distance between the apex and the mesh [m]."""
    farthest = 0.0
    for axis in range(3):
        farthest += abs(apex[axis]) + tree.farthest[axis]
    return SLACK * farthest + rounding


@kernel
def closest_of_all(triangles: Floats, apex: Triple, cone: Cone, reach: float) -> tuple[float, Triple, int, int]:
    """Return distance (inf when none is within reach), point relative to the apex, triangle (-1) and case (0)."""
    best, point, triangle, case = np.inf, (np.nan, np.nan, np.nan), -1, 0
    for k in range(len(triangles)):
        distance, x, which = on_triangle(triangles, k, apex, cone)
        if distance <= reach and distance < best:
            best, point, triangle, case = distance, x, k, which
    return best, point, triangle, case


@kernel
def _on_leaf(corners: Floats, lane: int, apex: Triple, cone: Cone) -> tuple[float, Triple, int]:
    """As `on_triangle`, for one triangle of a leaf."""
    a, b, c = (
        corner_from(apex, corners, 0, lane),
        corner_from(apex, corners, 1, lane),
        corner_from(apex, corners, 2, lane),
    )
    return closest_on_triangle(a, b, c, cone)


@kernel
def _squared_limit(limit: float, slack: float) -> float:
    """Return what a squared bound must exceed to be above the limit; finite, so that infinite bounds do."""
    return min((1.0 + 4.0 * EPSILON) * (limit + slack) * (limit + slack), LARGEST)


@kernel
def closest_in_tree(
    triangles: Floats,
    tree: WideTree,
    apex: Triple,
    cone: Cone,
    reach: float,
    start: int,
    stack: Integers,
    waiting: Floats,
    bounds: Floats,
    counts: Integers,
) -> tuple[float, Triple, int, int]:
    """As `closest_of_all`, through the tree.

    Args:
        reach: nothing farther than this is of interest [m].
        start: a triangle that is probably close (the last answer), or -1.
        stack, waiting: scratch of `MAX_WAITING` entries.
        bounds: scratch of `LANES` entries.
        counts: (COUNTS,) added to.
    """
    if len(triangles) <= _SCANNED:
        counts[LOOKED_AT] += len(triangles)
        counts[COMPUTED] += len(triangles)
        return closest_of_all(triangles, apex, cone, reach)
    best, point, triangle, case = np.inf, (np.nan, np.nan, np.nan), -1, 0
    slack = query_slack(tree, apex, cone.rounding)
    boxes, seen, computed = 0, 0, 0
    limit = min(reach, LARGEST)
    if start >= 0:
        distance, x, which = on_triangle(triangles, start, apex, cone)
        computed += 1
        if distance <= limit:
            best, point, triangle, case = distance, x, start, which
            limit = best
    squared = _squared_limit(limit, slack)
    middle = (tree.middle[0] - apex[0], tree.middle[1] - apex[1], tree.middle[2] - apex[2])
    top = 0
    stack[0] = 0
    waiting[0] = 0.0
    while top >= 0:
        node, bound = stack[top], waiting[top]
        top -= 1
        if bound > squared:
            continue
        if node >= 0:
            box_bounds(tree.boxes[node], middle, cone, slack, bounds)
            boxes += LANES
            below = top
            for lane in range(LANES):
                bound = bounds[lane]
                if bound > squared:
                    continue
                top += 1
                place = top
                while place - 1 > below and waiting[place - 1] < bound:
                    stack[place], waiting[place] = stack[place - 1], waiting[place - 1]
                    place -= 1
                stack[place], waiting[place] = tree.children[node, lane], bound
            continue
        leaf = -1 - node
        triangle_bounds(tree.corners[leaf], apex, cone, slack, bounds)
        seen += LANES
        while True:
            nearest = 0
            for lane in range(1, LANES):
                if bounds[lane] < bounds[nearest]:
                    nearest = lane
            if bounds[nearest] > squared:
                break
            bounds[nearest] = np.inf
            k = tree.indices[leaf, nearest]
            if k < 0 or k == start:
                continue
            computed += 1
            distance, x, which = _on_leaf(tree.corners[leaf], nearest, apex, cone)
            if distance < limit or (distance == limit and (triangle < 0 or k < triangle)):
                best, point, triangle, case = distance, x, k, which
                limit = best
                squared = _squared_limit(limit, slack)
    counts[BOXES] += boxes
    counts[LOOKED_AT] += seen
    counts[COMPUTED] += computed
    return best, point, triangle, case
