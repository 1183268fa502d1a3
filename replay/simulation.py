"""Scenario in, stream of frame blocks out: no files, no clock, no globals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import CollisionColumns
from replay.scenario.layout import Layout
from replay.sensing.columns import CapacitiveColumns, DistanceColumns

__all__ = ["BLOCK_FRAMES", "FrameBlock", "Layout"]

Floats = NDArray[np.float64]

BLOCK_FRAMES = 256
"""Frames per block; recorded, because warm-start state resets at block starts."""


@dataclass(frozen=True, eq=False)
class FrameBlock:
    """n consecutive frames: poses, and one group of columns for each thing that the scene asks for (else None).

    Attributes:
        layout: the names behind the columns.
        first: index of the block's first frame.
        time: (n,) int64 nanoseconds from the scenario's start.
        joint_positions: (n, J) [rad or m].
        joint_velocities: (n, J) [rad/s or m/s].
        link_poses: (n, L, 4, 4), T_world_link.
    """

    layout: Layout
    first: int
    time: NDArray[np.int64]
    joint_positions: Floats
    joint_velocities: Floats
    link_poses: Floats
    collision: CollisionColumns | None
    distance: DistanceColumns | None
    capacitive: CapacitiveColumns | None
