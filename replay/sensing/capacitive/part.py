"""Capacitive sensors as they are written: the sensor, its methods, what can be expected of it."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictInt, model_validator

from replay.language.fields import Flag, Glob, Name, Part, Pose, Size2, When, in_order, needs_one
from replay.language.units import (
    NUMBER,
    Accuracy,
    Capacitance,
    Permittivity,
    Quantity,
    StrayCapacitance,
    Supply,
    Voltage,
)
from replay.sensing.kind import Method
from replay.sensing.signal.part import VoltageSignal

Tolerance = Annotated[float, Quantity("Tolerance", NUMBER, at_least=1e-12, below=1.0)]

VACUUM_PERMITTIVITY = 8.8541878128e-12
"""[F/m], CODATA 2018."""

SUPPLY = 2.5
"""Supply voltage [V] of a sensor of which none is stated."""

ELECTROSTATIC = ("field", "bem")
"""The methods that compute charges on conductors."""


class PlatePart(Part):
    """A rectangular plate, in the xy plane of its pose, centred at the origin; its front faces +z."""

    pose: Pose = Pose()
    """Where the plate stands in the sensor's link's frame."""
    size: Size2
    """Edge lengths along x and y [m]."""


class CapacitiveSensorPart(Part):
    """Reads the capacitance between its plates and everything it senses, through a voltage divider."""

    link: Name
    """The link that carries the plates."""
    plates: Annotated[dict[Name, PlatePart], Field(min_length=1)]
    """Plates by name; their capacitances add up."""
    coupling: Capacitance
    """Coupling capacitance of the voltage divider [F]."""
    permittivity: Permittivity = VACUUM_PERMITTIVITY
    """[F/m]; a fitted number, see METHODS 4.3."""
    stray_capacitance: StrayCapacitance = 0.0
    """What the sensor reads while nothing is near [F]: cables and its own surroundings; added to what is sensed."""
    supply: Supply = SUPPLY
    """Supply voltage [V]."""
    side: Literal["front", "both"] = "front"
    """"front" counts only what lies on the plates' +z side."""
    faces: Literal["all", "facing"] = "all"
    """"facing" counts only triangles whose outside faces the plate."""
    back: tuple[Name, ...] = ()
    """Shapes of the sensor's link that are a conductor behind the plates; only for the methods field and
    bem."""
    driven: Flag = False
    """Whether what is behind the plates has their voltage, as a guard electrode, and not 0 V."""
    ignore: tuple[Glob, ...] = ()
    """Patterns of the names of links that are not sensed; the sensor's own link never is."""
    signal: VoltageSignal | None = None
    """What electronics make of the output voltage."""


class CapacitiveMethod(Method):
    """How capacitive sensors are computed."""

    method: Literal["tree", "exact", "midpoint", "field", "bem"] = "tree"
    """A tree that meets a tolerance, every triangle in closed form, or the thesis's midpoint splitting: the thesis's
    model. Or the electrostatics of conductors: field, fast and with an error that is told, or bem, the reference."""
    rtol: Tolerance | None = None
    """Relative tolerance of the sum; only for method tree, 1e-6 when left out."""
    splits: Annotated[StrictInt, Field(ge=0, le=8)] | None = None
    """Each triangle is split into 4^splits; only for method midpoint, 4 when left out."""
    drive: Literal["alone", "together"] | None = None
    """Whether output voltages are those of one sensor of a link driven at a time, or of all of them at once; only for
    methods field and bem, alone when left out."""
    accuracy: Accuracy | None = None
    """Share of a reading that its error may be before more unknowns are taken, and thrice what splines between frames
    may miss; only for method field, 3 % when left out."""

    @model_validator(mode="after")
    def _options_belong(self) -> Self:
        self._belongs("tree", "rtol")
        self._belongs("midpoint", "splits")
        self._belongs("field", "accuracy")
        if self.method not in ELECTROSTATIC:
            self._belongs("field or bem", "drive")
        return self

    def options(self) -> dict[str, Any]:
        """See `Method`."""
        if self.method == "tree":
            return {"rtol": 1e-6 if self.rtol is None else self.rtol}
        if self.method == "midpoint":
            return {"splits": 4 if self.splits is None else self.splits}
        if self.method in ELECTROSTATIC:
            return {"drive": self.drive or "alone"} | (
                {"accuracy": 0.03 if self.accuracy is None else self.accuracy} if self.method == "field" else {}
            )
        return {}


class OutputBelow(Part):
    """A threshold of an output voltage."""

    below: Voltage
    """The threshold [V]; a saturated sensor is below it."""


class CapacitiveCondition(Part):
    """A capacitive sensor tells less than a threshold."""

    capacitive: Name
    """Name of the capacitive sensor."""
    output: OutputBelow
    """The threshold of its output voltage."""


class OutputBounds(Part):
    """Bounds of an output voltage."""

    min: Voltage | None = None
    """No output is below this one [V]."""
    max: Voltage | None = None
    """No output is above this one [V]."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        needs_one(self, "min", "max")
        in_order(self.min, self.max, "V")
        return self


class CapacitiveExpectation(Part):
    """What a capacitive sensor reads."""

    capacitive: Name
    """Name of the capacitive sensor."""
    output: OutputBounds | None = None
    """Bounds of the output voltage."""
    saturated: When | None = None
    """Whether the capacitance is infinite."""
    measured: OutputBounds | None = None
    """Bounds of what the sensor's signal chain tells."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        needs_one(self, "output", "saturated", "measured")
        return self
