"""The exact sensor over a block of frames, one sensor and one target at a time, in compiled code."""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.geometry.wide_tree import LANES, MAX_WAITING, WIDE_TREE_TYPE, WideTree
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel
from replay.sensing.distance.cone import Cone
from replay.sensing.distance.query import COMPUTED, LOOKED_AT, REPEATED, closest_in_tree, closest_of_all
from replay.sensing.distance.readings import NEAREST_TYPE, Nearest


@kernel
def same_pose(poses: Floats, a: int, b: int) -> bool:
    """Return whether frames a and b hold the same pose, bit for bit."""
    for row in range(3):
        for column in range(4):
            if poses[a, row, column] != poses[b, row, column]:
                return False
    return True


@kernel
def axis_of(pose: Floats) -> tuple[float, float, float]:
    """Return the unit z axis of a pose."""
    x, y, z = pose[0, 2], pose[1, 2], pose[2, 2]
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


@entry(
    float64[:, :, ::1],
    WIDE_TREE_TYPE,
    float64[:, :, ::1],
    float64,
    float64,
    float64[::1],
    float64,
    int64,
    NEAREST_TYPE,
    int64[::1],
)
@kernel
def sweep_exact(
    triangles: Floats,
    tree: WideTree,
    T_target_sensor: Floats,
    cos_half: float,
    sin_half: float,
    rounding: Floats,
    reach: float,
    target: int,
    nearest: Nearest,
    counts: Integers,
) -> None:
    """Update `nearest` in every frame with the target's closest point in the sensor's cone.

    The last frame's triangle is the starting bound, and a frame with the pose of the one before reuses its answer;
    neither changes any bit of the result.

    Args:
        triangles, tree: of the target, in its link's frame.
        T_target_sensor: (n, 4, 4) sensor in the frame of the target's link.
        cos_half, sin_half: of the cone's half angle.
        rounding: (n,) how far the apex may be from where it was meant to be [m]: what is no farther than this reads 0.
        reach: the sensor's range [m].
        target: what to write as `nearest.target`.
        nearest: best candidates of the targets before.
        counts: (COUNTS,) added to, see `query`.
    """
    stack, waiting, bounds = np.empty(MAX_WAITING, dtype=np.int64), np.empty(MAX_WAITING), np.empty(LANES)
    distance, offset, triangle, case = np.inf, (np.nan, np.nan, np.nan), -1, 0
    searched_to, start = -1.0, -1
    for i in range(len(T_target_sensor)):
        limit = min(reach, nearest.distance[i])
        same = i > 0 and rounding[i] == rounding[i - 1] and same_pose(T_target_sensor, i, i - 1)
        known = same and (triangle >= 0 or limit <= searched_to)
        if known:
            counts[REPEATED] += 1
        else:
            pose = T_target_sensor[i]
            v = axis_of(pose)
            cone = Cone(v[0], v[1], v[2], cos_half, sin_half, rounding[i])
            apex = (pose[0, 3], pose[1, 3], pose[2, 3])
            distance, offset, triangle, case = closest_in_tree(
                triangles, tree, apex, cone, limit, start, stack, waiting, bounds, counts
            )
            searched_to = limit
            if triangle >= 0:
                start = triangle
        if triangle >= 0 and distance <= limit and distance < nearest.distance[i]:
            nearest.distance[i] = distance
            for k in range(3):
                nearest.offset[i, k] = offset[k]
            nearest.target[i] = target
            nearest.triangle[i] = triangle
            nearest.case[i] = case


@entry(
    float64[:, :, ::1],
    float64[:, :, ::1],
    float64,
    float64,
    float64[::1],
    float64,
    int64,
    NEAREST_TYPE,
    int64[::1],
)
@kernel
def sweep_scan(
    triangles: Floats,
    T_target_sensor: Floats,
    cos_half: float,
    sin_half: float,
    rounding: Floats,
    reach: float,
    target: int,
    nearest: Nearest,
    counts: Integers,
) -> None:
    """As `sweep_exact`, by every triangle in every frame."""
    for i in range(len(T_target_sensor)):
        pose = T_target_sensor[i]
        v = axis_of(pose)
        cone = Cone(v[0], v[1], v[2], cos_half, sin_half, rounding[i])
        apex = (pose[0, 3], pose[1, 3], pose[2, 3])
        distance, offset, triangle, case = closest_of_all(triangles, apex, cone, reach)
        counts[LOOKED_AT] += len(triangles)
        counts[COMPUTED] += len(triangles)
        if triangle >= 0 and distance < nearest.distance[i]:
            nearest.distance[i] = distance
            for k in range(3):
                nearest.offset[i, k] = offset[k]
            nearest.target[i] = target
            nearest.triangle[i] = triangle
            nearest.case[i] = case
