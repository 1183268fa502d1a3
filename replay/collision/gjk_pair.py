"""GJK on two vertex sets anywhere in the world: about a common origin, at size 1, and back.

With origin o halfway between the poses' origins, a is mapped to R_a a + h and b to R_b b - h, h = (p_a - p_b)/2: the
world position cancels before anything is rounded, and swapping the arguments swaps the numbers bit by bit. An origin
far from the vertices is subtracted only along axes on which that is exact (Sterbenz). Coordinates are then scaled by a
power of two below 1.
"""

from __future__ import annotations

import math

import numpy as np

from replay.collision.gjk_exact import (
    CONTACT,
    DIRECTION,
    DISTANCE,
    LOWER,
    POINT_A,
    POINT_B,
    SEPARATED,
    Workspace,
    precise_points,
    workspace,
)
from replay.collision.gjk_kernel import query
from replay.collision.support import Sets
from replay.numerics.arrays import Bytes, Floats
from replay.numerics.jit import kernel, leaf_kernel

RIGID_TOLERANCE = 1e-6
"""Largest accepted |R^T R - I|. The vertices are mapped by the matrix as given, so a pose that is rigid to this
tolerance costs no accuracy; a larger error is a scaled, sheared or mistyped matrix."""

LARGEST_COORDINATE = 1e100
"""Coordinates beyond this [m] are refused: their squares would overflow."""

FAULT_A, FAULT_B, FAULT_POSE_A, FAULT_POSE_B = -1, -2, -3, -4
"""Refusals of `ask`: vertices or a pose that are not finite, or a pose that is not rigid."""

MIDDLE = 13
"""Beside what `gjk_exact` writes: the point halfway between the witness points, 3 numbers."""


_workspace, _precise_points = kernel(workspace), kernel(precise_points)


@kernel
def ask(a: Floats, b: Floats, pose_a: Floats, pose_b: Floats, cutoff: float, answer: Floats) -> int:
    """Return SEPARATED, CONTACT, UNDECIDED or a FAULT_*, and the outcome in world coordinates.

    Args:
        a, b: (n, 3), (m, 3) vertices [m].
        pose_a, pose_b: (4, 4) to world.
        cutoff: as `gjk_kernel.query`, 0 or inf.
        answer: (16,) out, as `Workspace.result`, and MIDDLE; the direction is a unit vector.
    """
    if not _bounded(a):
        return FAULT_A
    if not _bounded(b):
        return FAULT_B
    if not is_rigid(pose_a):
        return FAULT_POSE_A
    if not is_rigid(pose_b):
        return FAULT_POSE_B
    half, origin, shift = np.empty(3), np.empty(3), np.empty(3)
    for k in range(3):
        half[k] = 0.5 * (pose_a[k, 3] - pose_b[k, 3])
        origin[k] = pose_a[k, 3] - half[k]
    placed_a, placed_b = np.empty((len(a), 3)), np.empty((len(b), 3))
    _place(a, pose_a, half, 1.0, placed_a)
    _place(b, pose_b, half, -1.0, placed_b)
    largest = _center(placed_a, placed_b, shift)
    scale = 2.0 ** math.frexp(largest)[1] if largest > 0.0 else 1.0
    work, precise = _workspace(), _precise_points()
    size = 2.0 * math.sqrt(3.0)  # every coordinate is below 1
    one, other = _single(placed_a, scale), _single(placed_b, scale)
    status = query(one, 0, other, 0, np.identity(3), np.zeros(3), size, cutoff, 0.0, work, precise)
    _to_world(work, status, cutoff, scale, origin, shift, answer)
    return status


@leaf_kernel
def is_rigid(pose: Floats) -> bool:
    """Return whether (4, 4) is finite and a rigid transform to within RIGID_TOLERANCE."""
    if pose[3, 0] != 0.0 or pose[3, 1] != 0.0 or pose[3, 2] != 0.0 or pose[3, 3] != 1.0:
        return False
    for i in range(3):
        if not abs(pose[i, 3]) <= LARGEST_COORDINATE:
            return False
        for j in range(3):
            x = pose[0, i] * pose[0, j] + pose[1, i] * pose[1, j] + pose[2, i] * pose[2, j] - (1.0 if i == j else 0.0)
            if not abs(x) <= RIGID_TOLERANCE:
                return False
    x = pose[1, 0] * pose[2, 1] - pose[2, 0] * pose[1, 1]
    y = pose[2, 0] * pose[0, 1] - pose[0, 0] * pose[2, 1]
    z = pose[0, 0] * pose[1, 1] - pose[1, 0] * pose[0, 1]
    return bool(x * pose[0, 2] + y * pose[1, 2] + z * pose[2, 2] > 0.0)


@leaf_kernel
def first_not_rigid(poses: Floats) -> int:
    """Return the first of (n, 4, 4) that is no rigid transform, -1 if all are."""
    for k in range(len(poses)):
        if not is_rigid(poses[k]):
            return k
    return -1


@leaf_kernel
def _bounded(points: Floats) -> bool:
    for i in range(len(points)):
        for k in range(3):
            if not abs(points[i, k]) <= LARGEST_COORDINATE:
                return False
    return True


@leaf_kernel
def _place(points: Floats, pose: Floats, half: Floats, sign: float, placed: Floats) -> None:
    for i in range(len(points)):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        for k in range(3):
            placed[i, k] = (x * pose[k, 0] + y * pose[k, 1] + z * pose[k, 2]) + sign * half[k]


@leaf_kernel
def _center(a: Floats, b: Floats, shift: Floats) -> float:
    """Subtract an origin in place, per axis one for which nothing rounds, else 0; return the largest that is left."""
    largest = 0.0
    for k in range(3):
        low, high = a[0, k], a[0, k]
        for i in range(len(a)):
            low, high = min(low, a[i, k]), max(high, a[i, k])
        for i in range(len(b)):
            low, high = min(low, b[i, k]), max(high, b[i, k])
        near, far = min(abs(low), abs(high)), max(abs(low), abs(high))
        # x/2 <= y <= 2x: x - y is exact
        shift[k] = low if (low > 0.0 or high < 0.0) and far <= 2.0 * near else 0.0
        for i in range(len(a)):
            a[i, k] -= shift[k]
        for i in range(len(b)):
            b[i, k] -= shift[k]
        largest = max(largest, abs(low - shift[k]), abs(high - shift[k]))
    return largest


@kernel
def _single(points: Floats, scale: float) -> Sets:
    """Return one set without a table, of points divided by a power of two in place."""
    center = np.zeros((1, 3))
    for i in range(len(points)):
        for k in range(3):
            points[i, k] /= scale
            center[0, k] += points[i, k]
    for k in range(3):
        center[0, k] /= len(points)
    first = np.array([0, len(points)])
    zero, none = np.zeros(1, dtype=np.int64), np.zeros(0, dtype=np.int64)
    return Sets(points, points.reshape(-1), first, center, zero, zero, np.zeros(1), none, none)


@leaf_kernel
def _to_world(
    work: Workspace, status: int, cutoff: float, scale: float, origin: Floats, shift: Floats, answer: Floats
) -> None:
    result = work.result
    for k in range(len(result)):
        answer[k] = result[k]
    answer[DISTANCE] *= scale
    answer[LOWER] *= scale
    square = 0.0
    for k in range(3):
        square += result[DIRECTION + k] * result[DIRECTION + k]
    for k in range(3):
        if square > 0.0:
            answer[DIRECTION + k] /= math.sqrt(square)
        place = origin[k] + shift[k]
        if status == CONTACT or cutoff > 0.0:
            x, y = result[POINT_A + k], result[POINT_B + k]
            answer[POINT_A + k], answer[POINT_B + k] = x * scale + place, y * scale + place
            answer[MIDDLE + k] = 0.5 * (x + y) * scale + place


@kernel
def ask_all(
    a: Sets,
    b: Sets,
    T_a_b: Floats,
    reach: float,
    cutoff: float,
    work: Workspace,
    precise: Floats,
    status: Bytes,
    distance: Floats,
) -> None:
    """Write status and distance of set 0 of a and set 0 of b at each of T_a_b (n, 4, 4).

    Args:
        a, b: the bodies.
        T_a_b: rigid.
        reach: max|a| + max|b| [m].
        cutoff: as `gjk_kernel.query`.
        work, precise: overwritten.
        status: (n,) out.
        distance: (n,) out [m]: 0 unless SEPARATED, a lower bound above a finite cutoff.
    """
    rotation, translation = np.empty((3, 3)), np.empty(3)
    for k in range(len(T_a_b)):
        square = 0.0
        for i in range(3):
            translation[i] = T_a_b[k, i, 3]
            square += translation[i] * translation[i]
            for j in range(3):
                rotation[i, j] = T_a_b[k, i, j]
        status[k] = query(a, 0, b, 0, rotation, translation, reach + math.sqrt(square), cutoff, 0.0, work, precise)
        distance[k] = work.result[DISTANCE] if status[k] == SEPARATED else 0.0
