"""Scenario in, stream of frame blocks out: no files, no clock, no globals."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import CollisionColumns
from replay.sensing.columns import CapacitiveColumns, DistanceColumns

Floats = NDArray[np.float64]

BLOCK_FRAMES = 256
"""Frames per block; recorded, because warm-start state resets at block starts."""


@dataclass(frozen=True)
class Layout:
    """The names behind the columns, each listed once and sorted.

    Attributes:
        links: L link names.
        joints: J names of scalar joints; `joint_units` their units, "rad" or "m".
        shapes: names "link/shape" of all shapes, for the distance sensor's `shape` column.
        pairs: P names "link/shape|link/shape" of the pairs that are tested.
        distance_sensors: D names.
        capacitive_sensors: C names.
        objects: O names of the shapes that capacitive sensors sense.
    """

    links: tuple[str, ...]
    joints: tuple[str, ...]
    joint_units: tuple[str, ...]
    shapes: tuple[str, ...]
    pairs: tuple[str, ...]
    distance_sensors: tuple[str, ...]
    capacitive_sensors: tuple[str, ...]
    objects: tuple[str, ...]


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
