"""What capacitive sensors say of n frames."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from replay.numerics.arrays import Flags, Floats
from replay.numerics.columns import Columns, Field

_MEASURED = "Capacitive sensors: output voltage as measured [V]"
_CHART = "Capacitive sensors: output voltage [V]"


@dataclass(frozen=True, eq=False)
class CapacitiveColumns(Columns):
    """Readings of C capacitive sensors in n frames.

    Attributes:
        capacitance: (n, C) [F], inf when saturated: the sum of per_object and the sensor's stray capacitance.
        output_voltage: (n, C) [V]; 0 when saturated.
        delta_output: (n, C) [V], supply minus output voltage.
        saturated: (n, C) bool, the integral is infinite, or a plate is in a sensed body, or flush and facing into it.
        touching: (n, C) bool, a sensed shape and a plate have a point in common.
        per_object: (n, C, O) [F], what each sensed shape contributes; 0 for shapes the sensor ignores.
        increase: (n, C) [F], what bodies add to the capacitance, inf when saturated; None, as the next two, with
            methods that are no electrostatics, whose capacitance is that and the stray one.
        error: (n, C) [F], how far off the increase is estimated to be; NaN when saturated or unresolved.
        unresolved: (n, C) bool, a body is nearer than the method resolves: read at a larger gap.
        measured: (n, C) [V], what the sensors' signal chains make of the output voltage; NaN while there is no sample,
            and of sensors that have no chain. None where no sensor has one.
    """

    capacitance: Annotated[Floats, Field(unit="F", gate="saturated")]
    output_voltage: Annotated[Floats, Field(unit="V", gate="saturated", chart=_CHART, spoken="output")]
    delta_output: Annotated[Floats, Field(unit="V", gate="saturated", spoken="output drop")]
    saturated: Annotated[Flags, Field(open=(0,), events={"saturation": 3})]
    touching: Annotated[Flags, Field(begins=("touch",))]
    per_object: Annotated[
        Floats, Field(unit="F", gate="saturated", label="capacitance", spoken="share", each="objects")
    ]
    increase: Annotated[Floats | None, Field(unit="F", gate="saturated", since=2)] = None
    error: Annotated[Floats | None, Field(unit="F", gate="unresolved", since=2)] = None
    unresolved: Annotated[Flags | None, Field(open=(0,), events={"unresolved": 3}, since=2)] = None
    measured: Annotated[Floats | None, Field(unit="V", signal=True, since=2, chart=_MEASURED)] = None
