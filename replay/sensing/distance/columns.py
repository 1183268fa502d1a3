"""What distance sensors say of n frames."""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Annotated

from replay.numerics.arrays import Bytes, Floats, ShortIntegers
from replay.numerics.columns import Columns, Field


class Detection(enum.IntEnum):
    """State of a distance sensor in one frame."""

    NOTHING = 0
    DETECTED = 1
    TOO_CLOSE = 2  # something is nearer than the sensor's minimum range


@dataclass(frozen=True, eq=False)
class DistanceColumns(Columns):
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
        measured: (n, D) [m], what the sensors' signal chains make of the distance; NaN while there is no sample, or it
            is of nothing, and of sensors that have no chain. None where no sensor has one.
    """

    status: Annotated[Bytes, Field(states=Detection, open=(1, 2), events={"detection": 2, "too close": 3})]
    distance: Annotated[Floats, Field(unit="m", gate="status", chart="Distance to the closest point [m]")]
    point: Annotated[Floats, Field(unit="m", gate="status", label="point in world", letters="xyz", beam=True)]
    point_sensor: Annotated[Floats, Field(unit="m", gate="status", label="point in sensor", letters="xyz")]
    normal: Annotated[Floats, Field(gate="status", label="normal in world", letters="xyz")]
    shape: Annotated[ShortIntegers, Field(gate="status", names="shapes")]
    triangle: Annotated[ShortIntegers, Field(gate="status")]
    case: Annotated[Bytes, Field(gate="status", most=5)]
    measured: Annotated[Floats | None, Field(unit="m", signal=True, since=2, chart="Distance as measured [m]")] = None
