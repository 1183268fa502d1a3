"""The bundle of rays that other simulators offer instead of a cone, as a model version to compare with.

Pattern. Ray i of N leaves at the angle theta_i to the axis and turns by the golden angle:
  sin^2(theta_i / 2) = sin^2(h / 2) i / (N - 1),   azimuth_i = i pi (3 - sqrt 5),
so that every ray stands for the same solid angle of the cap, the first is the axis and the last lies on the border.
The reading is the nearest hit of any ray: never too near, too far by about 1 / sqrt(N) of the opening on edges, and
blind between the rays.
Source: R. Swinbank and R. J. Purser, Fibonacci grids, Q. J. R. Meteorol. Soc. 132 (2006), on a cap.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.geometry.tree import MAX_DEPTH, TREE_TYPE, Tree
from replay.numerics.arrays import Floats, Integers
from replay.numerics.constants import EPSILON
from replay.numerics.jit import entry, kernel
from replay.numerics.triples import Triple, cross, dot, minus, norm
from replay.sensing.distance.exact import same_pose
from replay.sensing.distance.products import accurate_cross
from replay.sensing.distance.query import SLACK
from replay.sensing.distance.readings import NEAREST_TYPE, Nearest

_IN_PLANE = 16.0 * EPSILON
"""Rounding of what d · ((b - a) × (c - a)) is made of, as part of the farthest corner times the longest edge at a."""


def cap_directions(aperture: float, count: int) -> Floats:
    """Return the unit directions (count, 3) of the rays in the sensor's frame, axis +z.

    Args:
        aperture: full opening angle [rad].
        count: number of rays, 1 or more.
    """
    directions = np.empty((count, 3))
    half_sine = math.sin(0.25 * aperture)
    for i in range(count):
        sine = half_sine * math.sqrt(i / max(count - 1, 1))
        across = 2.0 * sine * math.sqrt((1.0 - sine) * (1.0 + sine))
        azimuth = i * math.pi * (3.0 - math.sqrt(5.0))
        directions[i] = across * math.cos(azimuth), across * math.sin(azimuth), 1.0 - 2.0 * sine * sine
    return directions


@kernel
def _box_entry(tree: Tree, node: int, origin: Triple, d: Triple, slack: float) -> float:
    """Return where the ray enters a node's box, grown by the slack; inf when it does not."""
    entry, leave = 0.0, np.inf
    for axis in range(3):
        low, high = tree.lower[node, axis] - origin[axis] - slack, tree.upper[node, axis] - origin[axis] + slack
        if d[axis] == 0.0:
            if low > 0.0 or high < 0.0:
                return np.inf
        else:
            near, far = low / d[axis], high / d[axis]
            entry, leave = max(entry, min(near, far)), min(leave, max(near, far))
    return entry if entry <= leave else np.inf


@kernel
def ray_hit(a: Triple, b: Triple, c: Triple, d: Triple, rounding: float) -> float:
    """Return how far along the unit direction d from the origin the triangle is hit, from either side; inf when not.

    The ray passes each edge on the side that the sign of d · (a × b) tells, so it cannot slip between two triangles.
    One in the triangle's plane, to rounding, hits nothing: where it meets the plane is noise. A hit no farther than the
    rounding of the origin [m], before or behind it, is on it.
    """
    ab, ac = minus(b, a), minus(c, a)
    normal = cross(ab, ac)
    turn = dot(d, normal)
    extent = max(norm(a), norm(b), norm(c))
    if abs(turn) <= _IN_PLANE * extent * max(norm(ab), norm(ac)):
        return np.inf
    sign = 1.0 if turn > 0.0 else -1.0
    slack = 4.0 * EPSILON
    la, lb, lc = norm(a), norm(b), norm(c)
    if sign * dot(d, accurate_cross(a, b)) < -slack * la * lb:
        return np.inf
    if sign * dot(d, accurate_cross(b, c)) < -slack * lb * lc:
        return np.inf
    if sign * dot(d, accurate_cross(c, a)) < -slack * lc * la:
        return np.inf
    # divided first: the axis meets a wall across it exactly where the wall is
    along = dot(a, (normal[0] / turn, normal[1] / turn, normal[2] / turn))
    along = min(max(along, min(dot(d, a), dot(d, b), dot(d, c))), max(dot(d, a), dot(d, b), dot(d, c)))
    if abs(along) <= rounding:
        return 0.0
    return along if along > 0.0 else np.inf


@kernel
def _nearest_hit(
    triangles: Floats,
    tree: Tree,
    origin: Triple,
    d: Triple,
    rounding: float,
    limit: float,
    stack: Integers,
    slack: float,
) -> tuple[float, int]:
    """Return distance and triangle of the first hit nearer than the limit; inf and -1 when there is none."""
    best, triangle = np.inf, -1
    stack[0] = 0
    top = 0
    while top >= 0:
        node = stack[top]
        top -= 1
        if _box_entry(tree, node, origin, d, slack) > limit:
            continue
        second = tree.second[node]
        if second >= 0:
            stack[top + 1] = second
            stack[top + 2] = node + 1
            top += 2
            continue
        for place in range(tree.begin[node], tree.end[node]):
            k = tree.order[place]
            t = triangles[k]
            a = (t[0, 0] - origin[0], t[0, 1] - origin[1], t[0, 2] - origin[2])
            b = (t[1, 0] - origin[0], t[1, 1] - origin[1], t[1, 2] - origin[2])
            c = (t[2, 0] - origin[0], t[2, 1] - origin[1], t[2, 2] - origin[2])
            distance = ray_hit(a, b, c, d, rounding)
            if distance <= limit and (distance < best or (distance == best and k < triangle)):
                best, triangle, limit = distance, k, distance
    return best, triangle


@entry(float64[:, :, ::1], TREE_TYPE, float64[:, :, ::1], float64[:, ::1], float64[::1], float64, int64, NEAREST_TYPE)
@kernel
def sweep_rays(
    triangles: Floats,
    tree: Tree,
    T_target_sensor: Floats,
    directions: Floats,
    rounding: Floats,
    reach: float,
    target: int,
    nearest: Nearest,
) -> None:
    """As `replay.sensing.distance.exact.sweep_exact`, with rays along `directions` (N, 3) of the sensor's frame."""
    stack = np.empty(MAX_DEPTH + 1, dtype=np.int64)
    largest = np.finfo(np.float64).max
    for i in range(len(T_target_sensor)):
        repeated = i > 0 and rounding[i] == rounding[i - 1] and same_pose(T_target_sensor, i, i - 1)
        if repeated and nearest.target[i - 1] == target and nearest.distance[i - 1] < nearest.distance[i]:
            nearest.distance[i] = nearest.distance[i - 1]
            nearest.offset[i] = nearest.offset[i - 1]
            nearest.target[i] = target
            nearest.triangle[i] = nearest.triangle[i - 1]
            continue
        pose = T_target_sensor[i]
        origin = (pose[0, 3], pose[1, 3], pose[2, 3])
        farthest = 0.0
        for axis in range(3):
            farthest += abs(origin[axis]) + max(abs(tree.lower[0, axis]), abs(tree.upper[0, axis]))
        slack = SLACK * farthest + rounding[i]
        limit = min(reach, nearest.distance[i], largest)
        for ray in range(len(directions)):
            x, y, z = directions[ray, 0], directions[ray, 1], directions[ray, 2]
            d = (
                pose[0, 0] * x + pose[0, 1] * y + pose[0, 2] * z,
                pose[1, 0] * x + pose[1, 1] * y + pose[1, 2] * z,
                pose[2, 0] * x + pose[2, 1] * y + pose[2, 2] * z,
            )
            distance, triangle = _nearest_hit(triangles, tree, origin, d, rounding[i], limit, stack, slack)
            if triangle >= 0 and distance < nearest.distance[i]:
                limit = distance
                nearest.distance[i] = distance
                for k in range(3):
                    nearest.offset[i, k] = distance * d[k]
                nearest.target[i] = target
                nearest.triangle[i] = triangle
                nearest.case[i] = 0
