"""Scenario in, stream of frame blocks out: no files, no clock, no globals."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Integers = NDArray[np.int32]
Flags = NDArray[np.bool_]

BLOCK_FRAMES = 256
"""Frames per block; recorded, because warm-start state resets at block starts."""


class Level(enum.IntEnum):
    """State of a pair of shapes in one frame, as the thesis shows it."""

    CLEAR = 0
    BOUNDS = 1  # only the bounding volumes meet
    CONTACT = 2  # the shapes meet


class Detection(enum.IntEnum):
    """State of a distance sensor in one frame."""

    NOTHING = 0
    DETECTED = 1
    TOO_CLOSE = 2  # something is nearer than the sensor's minimum range


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
class CollisionColumns:
    """Collision results of n frames and P pairs.

    Attributes:
        level: (n, P) uint8, see `Level`.
        clearance: (n, P) [m], distance between the shapes; 0 in contact, NaN where not evaluated.
        evaluated: (n, P) bool, whether `clearance` is a distance.
        undecided: (n, P) bool, whether GJK reached its accuracy limit; the level is then contact, for safety.
    """

    level: Bytes
    clearance: Floats
    evaluated: Flags
    undecided: Flags


@dataclass(frozen=True, eq=False)
class DistanceColumns:
    """Readings of D distance sensors in n frames.

    Attributes:
        status: (n, D) uint8, see `Detection`.
        distance: (n, D) [m], NaN when nothing is detected.
        point: (n, D, 3) [m], closest point in world coordinates, NaN when nothing is detected.
        normal: (n, D, 3), unit normal of the triangle in world coordinates, NaN when nothing is detected.
        shape: (n, D) int32, index into `Layout.shapes`, -1 when nothing is detected.
        triangle: (n, D) int32, index into the shape's triangles, -1 when nothing is detected.
        case: (n, D) uint8, the thesis's case 1..5, 0 when nothing is detected.
    """

    status: Bytes
    distance: Floats
    point: Floats
    normal: Floats
    shape: Integers
    triangle: Integers
    case: Bytes


@dataclass(frozen=True, eq=False)
class CapacitiveColumns:
    """Readings of C capacitive sensors in n frames.

    Attributes:
        capacitance: (n, C) [F], inf when saturated.
        per_object: (n, C, O) [F], what each sensed shape contributes; 0 for shapes the sensor ignores.
        output_voltage: (n, C) [V]; 0 when saturated.
        delta_output: (n, C) [V], supply minus output voltage.
        saturated: (n, C) bool, the integral is infinite.
        touching: (n, C) bool, a sensed shape and a plate have a point in common.
    """

    capacitance: Floats
    per_object: Floats
    output_voltage: Floats
    delta_output: Floats
    saturated: Flags
    touching: Flags


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
