"""The sensors that links carry."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from replay.scenario.fields import Glob, Name, Part, Pose, Size2, rejected
from replay.scenario.units import Aperture, Capacitance, Distance, Permittivity, Range, StrayCapacitance, Supply

VACUUM_PERMITTIVITY = 8.8541878128e-12
"""[F/m], CODATA 2018."""


class DistanceSensor(Part):
    """Reads the distance to the closest point inside a cone; the cone's apex is the pose's origin, its axis +z."""

    link: Name
    """The link that carries the sensor."""
    pose: Pose = Pose()
    """Where the sensor stands in its link's frame."""
    aperture: Aperture
    """Full opening angle of the cone [rad], at most a full turn."""
    range: Range = math.inf
    """Largest distance that is read [m]."""
    min_range: Distance = 0.0
    """Distances below this one are read as "too close" [m]."""
    ignore: tuple[Glob, ...] = ()
    """Patterns of the names of links that are not sensed; the sensor's own link never is."""

    @model_validator(mode="after")
    def _ranges_in_order(self) -> Self:
        if not self.min_range < self.range:
            raise rejected(f"must be below the range {self.range:.6g} m", at=("min_range",))
        return self


class Plate(Part):
    """A rectangular plate, in the xy plane of its pose, centred at the origin; its front faces +z."""

    pose: Pose = Pose()
    """Where the plate stands in the sensor's link's frame."""
    size: Size2
    """Edge lengths along x and y [m]."""


class CapacitiveSensor(Part):
    """Reads the capacitance between its plates and everything it senses, through a voltage divider."""

    link: Name
    """The link that carries the plates."""
    plates: Annotated[dict[Name, Plate], Field(min_length=1)]
    """Plates by name; their capacitances add up."""
    coupling: Capacitance
    """Coupling capacitance of the voltage divider [F]."""
    permittivity: Permittivity = VACUUM_PERMITTIVITY
    """[F/m]; a fitted number, see METHODS 4.3."""
    stray_capacitance: StrayCapacitance = 0.0
    """What the sensor reads while nothing is near [F]: cables and its own surroundings; added to what is sensed."""
    supply: Supply = 2.5
    """Supply voltage [V]."""
    side: Literal["front", "both"] = "front"
    """"front" counts only what lies on the plates' +z side."""
    faces: Literal["all", "facing"] = "all"
    """"facing" counts only triangles whose outside faces the plate."""
    ignore: tuple[Glob, ...] = ()
    """Patterns of the names of links that are not sensed; the sensor's own link never is."""


class Sensors(Part):
    """Sensors by name; a sensor that is not declared costs nothing."""

    distance: dict[Name, DistanceSensor] = Field(default_factory=dict)
    """Distance sensors."""
    capacitive: dict[Name, CapacitiveSensor] = Field(default_factory=dict)
    """Capacitive sensors."""
