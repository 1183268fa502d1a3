"""From the best point per frame and sensor, in the frame of the target's link, to the columns of a block."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba import float64, int32, uint8

from replay.kinematics.linkage import LinkPoses
from replay.numerics import transforms
from replay.numerics.arrays import Bytes, Floats, ShortIntegers
from replay.numerics.jit import record
from replay.sensing.distance.columns import Detection, DistanceColumns
from replay.sensing.target import Target


class Nearest(NamedTuple):
    """The best candidate of one sensor in n frames, updated target by target.

    The first target keeps the place when a later one is only as close.
    """

    distance: Floats  # (n,) [m], inf while nothing is found
    offset: Floats  # (n, 3) from the apex to the point, in the frame of the link of the target [m]
    target: ShortIntegers  # (n,), -1 while nothing is found
    triangle: ShortIntegers  # (n,)
    case: Bytes  # (n,)

    def of(self, frames: slice) -> Nearest:
        """Return the part of some frames, which shares their memory."""
        return Nearest(
            self.distance[frames], self.offset[frames], self.target[frames], self.triangle[frames], self.case[frames]
        )


NEAREST_TYPE = record(Nearest, float64[::1], float64[:, ::1], int32[::1], int32[::1], uint8[::1])


def nothing_yet(frames: int) -> Nearest:
    """Return the start of a search over targets."""
    return Nearest(
        np.full(frames, np.inf),
        np.full((frames, 3), np.nan),
        np.full(frames, -1, dtype=np.int32),
        np.full(frames, -1, dtype=np.int32),
        np.zeros(frames, dtype=np.uint8),
    )


def write_sensor(
    columns: DistanceColumns,
    column: int,
    nearest: Nearest,
    targets: Sequence[Target],
    T_target_sensor: dict[int, Floats],
    poses: LinkPoses,
    min_range: float,
) -> None:
    """Write one sensor's readings into its column.

    Args:
        columns: filled with "nothing detected" so far.
        column: which sensor.
        nearest: its best candidates.
        targets: as `nearest.target` counts them.
        T_target_sensor: by target, (n, 4, 4) pose of the sensor in the frame of the target's link.
        poses: of all links.
        min_range: nearer than this [m] is `Detection.TOO_CLOSE`.
    """
    for index in np.unique(nearest.target):
        if index < 0:
            continue
        target, pose = targets[index], T_target_sensor[int(index)]
        frames = np.flatnonzero(nearest.target == index)
        offset = nearest.offset[frames]
        T_target, T_world = pose[frames], poses.world[frames, target.link]
        corners = target.triangles[nearest.triangle[frames]]
        to_sensor = np.swapaxes(T_target[:, :3, :3], 1, 2)
        columns.point[frames, column] = transforms.apply(T_world, T_target[:, :3, 3] + offset)
        columns.point_sensor[frames, column] = _rotated(to_sensor, offset)
        normal = _unit_normals(corners, fallback=-T_target[:, :3, 2])
        columns.normal[frames, column] = _rotated(T_world[:, :3, :3], normal)
        near = nearest.distance[frames] < min_range
        columns.status[frames, column] = np.where(near, Detection.TOO_CLOSE, Detection.DETECTED)
        columns.distance[frames, column] = nearest.distance[frames]
        columns.shape[frames, column] = index
        columns.triangle[frames, column] = nearest.triangle[frames]
        columns.case[frames, column] = nearest.case[frames]


def _rotated(rotation: Floats, vectors: Floats) -> Floats:
    x, y, z = vectors[:, 0], vectors[:, 1], vectors[:, 2]
    rows = [rotation[:, r, 0] * x + rotation[:, r, 1] * y + rotation[:, r, 2] * z for r in range(3)]
    return np.stack(rows, axis=-1)


def _unit_normals(corners: Floats, fallback: Floats) -> Floats:
    """Return the triangles' outward unit normals (n, 3); `fallback` where a triangle has no area."""
    u, w = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.stack([u[:, i] * w[:, j] - u[:, j] * w[:, i] for i, j in ((1, 2), (2, 0), (0, 1))], axis=-1)
    length = np.sqrt(normal[:, 0] ** 2 + normal[:, 1] ** 2 + normal[:, 2] ** 2)
    flat = length == 0.0
    normal = normal / np.where(flat, 1.0, length)[:, None]
    return np.where(flat[:, None], fallback, normal)
