"""The closest triangle of a mesh in a cone: a scan, or a walk of the triangle tree that skips what cannot win.

Work is skipped only on lower bounds that hold after rounding, and among equal distances the lowest triangle index wins,
so the answer is the same bit for bit with or without the tree and whatever bound the search starts from. Meshes that
fit in one leaf are a scan as they are; from 8 triangles on the walk was measured to win.

Bounds. f(x) = |x| sin(h - theta), theta the angle of x to the axis, is positive inside the cone, and changes by no more
than the way a point moves.
Node: its box lies in the ball around its centre C with radius rho = |half widths|: no point is in the cone when
f(C) < -rho, nor, for h <= 90 deg, when theta > h + 90 deg and |C| > rho (the apex is nearest), nor nearer than the
box itself.
Triangle: a point x = sum l_i c_i of the corners has |x|^2 = sum l_i |c_i|^2 - sum_{i<j} l_i l_j |c_i - c_j|^2, so
|x|^2 >= min |c_i|^2 - L^2 / 3 with L the longest edge. Above 90 deg f is convex, hence largest on a corner. Below, f is
a linear function minus cos h times the distance to the axis, whose curvature is at most 1 / (that distance), so f
exceeds its largest corner value by at most cos h (L^2 / 3) / (2 distance), and by at most the way to the nearest
corner, L / sqrt 3.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import Tree
from replay.numerics.jit import kernel
from replay.sensing.distance.cone import EPSILON, TOUCH, Cone
from replay.sensing.distance.triangle import closest_on_triangle
from replay.sensing.distance.vectors import Vector, cross, dot, norm, subtract

Array = NDArray[np.float64]

LARGEST = float(np.finfo(np.float64).max)

COUNTS = 4
REPEATED, BOXES, LOOKED_AT, COMPUTED = range(COUNTS)
"""Rows of the counters: frames answered from the one before, tree boxes bounded, triangles looked at in leaves, and
triangles whose closest point in the cone was computed."""

SLACK = 2.0 * TOUCH
"""Rounding of any distance in a query, as part of the farthest coordinate seen from the apex."""


@kernel
def on_triangle(triangles: Array, k: int, apex: Vector, cone: Cone) -> tuple[float, Vector, int]:
    """Return distance (inf when none), point relative to the apex and case for triangle k."""
    t = triangles[k]
    a = (t[0, 0] - apex[0], t[0, 1] - apex[1], t[0, 2] - apex[2])
    b = (t[1, 0] - apex[0], t[1, 1] - apex[1], t[1, 2] - apex[2])
    c = (t[2, 0] - apex[0], t[2, 1] - apex[1], t[2, 2] - apex[2])
    return closest_on_triangle(a, b, c, cone)


@kernel
def misses_ball(centre: Vector, radius: float, cone: Cone, slack: float) -> bool:
    """Return whether a ball certainly has no point in the cone with its apex at the origin."""
    v = (cone.vx, cone.vy, cone.vz)
    along = dot(v, centre)
    across = norm(cross(v, centre))
    inside = along * cone.sin_half - across * cone.cos_half
    if inside < -radius - slack:
        return True
    if cone.cos_half >= 0.0 and along * cone.cos_half + across * cone.sin_half < 0.0:
        return norm(centre) > radius + slack
    return False


@kernel
def _node_bound(tree: Tree, node: int, apex: Vector, cone: Cone, slack: float) -> float:
    """Return a lower bound of the distance to what a node holds; inf when none of it is in the cone."""
    low, high = tree.lower[node], tree.upper[node]
    hx, hy, hz = 0.5 * (high[0] - low[0]), 0.5 * (high[1] - low[1]), 0.5 * (high[2] - low[2])
    centre = (low[0] + hx - apex[0], low[1] + hy - apex[1], low[2] + hz - apex[2])
    if misses_ball(centre, math.sqrt(hx * hx + hy * hy + hz * hz), cone, slack):
        return np.inf
    gx, gy, gz = max(abs(centre[0]) - hx, 0.0), max(abs(centre[1]) - hy, 0.0), max(abs(centre[2]) - hz, 0.0)
    return math.sqrt(gx * gx + gy * gy + gz * gz) - slack


@kernel
def _cannot_win(triangles: Array, k: int, apex: Vector, cone: Cone, limit: float, slack: float) -> bool:
    """Return whether triangle k certainly has no point in the cone within the limit; cheap, from its corners alone."""
    t = triangles[k]
    a = (t[0, 0] - apex[0], t[0, 1] - apex[1], t[0, 2] - apex[2])
    b = (t[1, 0] - apex[0], t[1, 1] - apex[1], t[1, 2] - apex[2])
    c = (t[2, 0] - apex[0], t[2, 1] - apex[1], t[2, 2] - apex[2])
    ab, bc, ca = subtract(b, a), subtract(c, b), subtract(a, c)
    aa, bb, cc = dot(a, a), dot(b, b), dot(c, c)
    sag = max(dot(ab, ab), dot(bc, bc), dot(ca, ca)) / 3.0
    allowed = limit + slack
    if min(aa, bb, cc) - sag - 16.0 * EPSILON * max(aa, bb, cc) > allowed * allowed:
        return True
    v = (cone.vx, cone.vy, cone.vz)
    along_a, along_b, along_c = dot(a, v), dot(b, v), dot(c, v)
    across_a, across_b, across_c = norm(cross(v, a)), norm(cross(v, b)), norm(cross(v, c))
    inside = max(
        along_a * cone.sin_half - across_a * cone.cos_half,
        along_b * cone.sin_half - across_b * cone.cos_half,
        along_c * cone.sin_half - across_c * cone.cos_half,
    )
    if inside >= -slack:
        return False
    if cone.cos_half <= 0.0:
        return True
    reach = math.sqrt(sag)
    nearest_axis = min(across_a, across_b, across_c) - reach
    margin = reach
    if nearest_axis > 0.0:
        margin = min(reach, 0.5 * sag * cone.cos_half / nearest_axis)
    return inside < -margin - slack


@kernel
def query_slack(tree: Tree, apex: Vector) -> float:
    """Return what rounding can change in any distance between the apex and the mesh [m]."""
    farthest = 0.0
    for axis in range(3):
        farthest += abs(apex[axis]) + max(abs(tree.lower[0, axis]), abs(tree.upper[0, axis]))
    return SLACK * farthest


@kernel
def closest_of_all(triangles: Array, apex: Vector, cone: Cone, reach: float) -> tuple[float, Vector, int, int]:
    """Return distance (inf when none is within reach), point relative to the apex, triangle (-1) and case (0)."""
    best, point, triangle, case = np.inf, (np.nan, np.nan, np.nan), -1, 0
    for k in range(len(triangles)):
        distance, x, which = on_triangle(triangles, k, apex, cone)
        if distance <= reach and distance < best:
            best, point, triangle, case = distance, x, k, which
    return best, point, triangle, case


@kernel
def closest_in_tree(
    triangles: Array,
    tree: Tree,
    apex: Vector,
    cone: Cone,
    reach: float,
    start: int,
    stack: NDArray[np.int64],
    bounds: Array,
    counts: NDArray[np.int64],
) -> tuple[float, Vector, int, int]:
    """As `closest_of_all`, through the tree.

    Args:
        reach: nothing farther than this is of interest [m].
        start: a triangle that is probably close (the last answer), or -1.
        stack, bounds: scratch of `MAX_DEPTH` entries.
        counts: (COUNTS,) added to.
    """
    best, point, triangle, case = np.inf, (np.nan, np.nan, np.nan), -1, 0
    slack = query_slack(tree, apex)
    boxes, seen, computed = 1, 0, 0
    limit = min(reach, LARGEST)  # so that an infinite bound is always above it
    if start >= 0:
        distance, x, which = on_triangle(triangles, start, apex, cone)
        computed += 1
        if distance <= limit:
            best, point, triangle, case = distance, x, start, which
            limit = best
    top = 0
    stack[0] = 0
    bounds[0] = _node_bound(tree, 0, apex, cone, slack)
    while top >= 0:
        node, bound = stack[top], bounds[top]
        top -= 1
        if bound > limit:
            continue
        while bound <= limit:
            second = tree.second[node]
            if second < 0:
                seen += tree.end[node] - tree.begin[node]
                for place in range(tree.begin[node], tree.end[node]):
                    k = tree.order[place]
                    if k == start or _cannot_win(triangles, k, apex, cone, limit, slack):
                        continue
                    computed += 1
                    distance, x, which = on_triangle(triangles, k, apex, cone)
                    if distance < limit or (distance == limit and (triangle < 0 or k < triangle)):
                        best, point, triangle, case = distance, x, k, which
                        limit = best
                break
            first = node + 1
            first_bound = _node_bound(tree, first, apex, cone, slack)
            second_bound = _node_bound(tree, second, apex, cone, slack)
            boxes += 2
            if second_bound < first_bound:
                first, second = second, first
                first_bound, second_bound = second_bound, first_bound
            if second_bound <= limit:
                top += 1
                stack[top] = second
                bounds[top] = second_bound
            node, bound = first, first_bound
    counts[BOXES] += boxes
    counts[LOOKED_AT] += seen
    counts[COMPUTED] += computed
    return best, point, triangle, case
