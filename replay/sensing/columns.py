"""What the sensors say of n frames, as columns."""

from __future__ import annotations

import enum
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bytes = NDArray[np.uint8]
Integers = NDArray[np.int32]
Flags = NDArray[np.bool_]


class Detection(enum.IntEnum):
    """State of a distance sensor in one frame."""

    NOTHING = 0
    DETECTED = 1
    TOO_CLOSE = 2  # something is nearer than the sensor's minimum range


@dataclass(frozen=True, eq=False)
class DistanceColumns:
    """Readings of D distance sensors in n frames.

    Attributes:
        status: (n, D) uint8, see `Detection`.
        distance: (n, D) [m], NaN when nothing is detected.
        point: (n, D, 3) [m], closest point in world coordinates, NaN when nothing is detected.
        point_sensor: (n, D, 3) [m], the same point in the sensor's own frame (apex at the origin, axis +z).
        normal: (n, D, 3), unit normal of the triangle in world coordinates, NaN when nothing is detected.
        shape: (n, D) int32, index into `Layout.shapes`, -1 when nothing is detected.
        triangle: (n, D) int32, index into the shape's triangles, -1 when nothing is detected.
        case: (n, D) uint8, the thesis's case 1..5, 0 when nothing is detected.
    """

    status: Bytes
    distance: Floats
    point: Floats
    point_sensor: Floats
    normal: Floats
    shape: Integers
    triangle: Integers
    case: Bytes


@dataclass(frozen=True, eq=False)
class CapacitiveColumns:
    """Readings of C capacitive sensors in n frames.

    Attributes:
        capacitance: (n, C) [F], inf when saturated: the sum of per_object and the sensor's stray capacitance.
        per_object: (n, C, O) [F], what each sensed shape contributes; 0 for shapes the sensor ignores.
        output_voltage: (n, C) [V]; 0 when saturated.
        delta_output: (n, C) [V], supply minus output voltage.
        saturated: (n, C) bool, the integral is infinite, or a plate is in a sensed body, or flush and facing into it.
        touching: (n, C) bool, a sensed shape and a plate have a point in common.
    """

    capacitance: Floats
    per_object: Floats
    output_voltage: Floats
    delta_output: Floats
    saturated: Flags
    touching: Flags
