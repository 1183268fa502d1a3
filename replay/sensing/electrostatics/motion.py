"""What bodies change at a unit over many frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.numerics.arrays import Flags, Floats, Integers
from replay.sensing.electrostatics.bem import BemReading
from replay.sensing.electrostatics.contacts import Stand


@dataclass(frozen=True, eq=False)
class PoseTrack:
    """The poses that occur in n frames.

    Attributes:
        poses: (m, bodies, 4, 4), in the order in which they first occur.
        pose_of: (n,) the pose of each frame.
    """

    poses: Floats
    pose_of: Integers

    @staticmethod
    def every(T: Floats) -> PoseTrack:
        """Return the poses (n, bodies, 4, 4) of n frames as they are."""
        return PoseTrack(T, np.arange(len(T)))

    @staticmethod
    def of(T: Floats) -> PoseTrack:
        """Return the poses (n, bodies, 4, 4) of n frames, those that are equal bit for bit once."""
        seen: dict[bytes, int] = {}
        pose_of = np.array([seen.setdefault(pose.tobytes(), len(seen)) for pose in T], dtype=np.intp)
        return PoseTrack(T[np.unique(pose_of, return_index=True)[1]], pose_of)


@dataclass(frozen=True, eq=False)
class Solved:
    """What bodies change in n frames, in units of 4 pi eps0.

    Attributes:
        increase: (n, k, k) [m], NaN where there is no answer.
        error: (n, k, k) [m].
        shares: (n, shapes, k, k) [m].
        touching: (n, sensors, shapes).
        unresolved: (n,).
    """

    increase: Floats
    error: Floats
    shares: Floats
    touching: Flags
    unresolved: Flags

    @staticmethod
    def nothing(frames: int, electrodes: int, sensors: int) -> Solved:
        """Return what no body changes."""
        zero = np.zeros((frames, electrodes, electrodes))
        shares = np.zeros((frames, 0, electrodes, electrodes))
        return Solved(zero, zero, shares, np.zeros((frames, sensors, 0), np.bool_), np.zeros(frames, np.bool_))

    @staticmethod
    def of(stand: Stand, readings: Sequence[BemReading | None], electrodes: int) -> Solved:
        """Return readings of poses side by side."""
        n, shapes = len(readings), stand.touching.shape[2]
        increase = np.full((n, electrodes, electrodes), np.nan)
        error, shares = increase.copy(), np.full((n, shapes, electrodes, electrodes), np.nan)
        for i, reading in enumerate(readings):
            if reading is not None:
                increase[i], error[i], shares[i] = reading.increase, reading.error, reading.shares
        none = np.array([reading is None for reading in readings], dtype=np.bool_)
        return Solved(increase, error, shares, stand.touching, stand.unresolved | none)

    def __getitem__(self, index: Integers) -> Solved:
        """Return the frames of an index."""
        return Solved(
            self.increase[index], self.error[index], self.shares[index], self.touching[index], self.unresolved[index]
        )
