"""The capacitive sensor, as every other room sees it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from replay.language.node import KeyPath
from replay.language.units import VOLTAGE
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.capacitive.part import (
    ELECTROSTATIC,
    CapacitiveCondition,
    CapacitiveExpectation,
    CapacitiveMethod,
    CapacitiveSensorPart,
)
from replay.sensing.kind import Drawing, Expected, Method, Output, SensorKind, Suite

if TYPE_CHECKING:
    from replay.sensing.capacitive.sensor import CapacitiveSensor
    from replay.sensing.target import Target

_COLOR = (216, 140, 60, 255)
_CORNERS = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])


class Capacitive(SensorKind):
    """Reads the capacitance between plates and what is around them, through a voltage divider."""

    name = "capacitive"
    part = CapacitiveSensorPart
    method = CapacitiveMethod
    revisions: ClassVar = {"tree": 6, "exact": 4, "midpoint": 3, "field": 2, "bem": 2}
    slow = ELECTROSTATIC
    models: ClassVar = {"thesis2015": CapacitiveMethod(method="midpoint", splits=4)}
    expectation = CapacitiveExpectation
    expected = (
        Expected("output", lambda columns: columns.output_voltage, unit="V"),
        Expected("saturated", lambda columns: columns.saturated),
        Expected("measured", lambda columns: columns.measured, unit="V"),
    )
    output = Output(
        reading=lambda columns: columns.output_voltage,
        beyond=lambda columns: columns.saturated,
        substitute=lambda part: part.supply,
        condition=CapacitiveCondition,
        threshold=lambda condition: condition.output.below,
        dimension=VOLTAGE,
    )
    columns = CapacitiveColumns

    def module(self) -> Any:
        """See `SensorKind`."""
        from replay.sensing.capacitive import suite

        return suite

    def sensor(
        self, name: str, part: CapacitiveSensorPart, link: int, ignored_links: frozenset[int]
    ) -> CapacitiveSensor:
        """See `SensorKind`."""
        from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate

        plates = tuple(
            Plate(name=plate, T_link_plate=written.pose.transform(), half_size=0.5 * np.array(written.size))
            for plate, written in sorted(part.plates.items())
        )
        same = part.model_dump(exclude={"link", "plates", "back", "ignore", "signal"})
        return CapacitiveSensor(name=name, link=link, plates=plates, **same, ignored_links=ignored_links)

    def own_shapes(self, part: CapacitiveSensorPart) -> Mapping[KeyPath, str]:
        """See `SensorKind`: what is behind the plates."""
        return {("back", index): name for index, name in enumerate(part.back)}

    def with_shapes(
        self, sensor: CapacitiveSensor, part: CapacitiveSensorPart, shapes: Mapping[str, Floats]
    ) -> CapacitiveSensor:
        """See `SensorKind`: what is behind the plates."""
        return replace(sensor, back=tuple((name, shapes[name]) for name in part.back))

    def suite(
        self,
        sensors: Sequence[Any],
        targets: Sequence[Target],
        method: Method,
        *,
        savings: bool,
        watched: frozenset[str] = frozenset(),
    ) -> Suite:
        """See `SensorKind`."""
        if method.method not in ELECTROSTATIC:
            return super().suite(sensors, targets, method, savings=savings)
        from replay.sensing.electrostatics.suite import ElectrostaticSuite

        options = {"method": method.method, "savings": savings, "watched": watched, **method.options()}
        return ElectrostaticSuite(sensors, targets, **options)

    def kernels(self, method: Method, *, savings: bool) -> tuple[Any, ...]:
        """See `SensorKind`."""
        if method.method not in ELECTROSTATIC:
            return super().kernels(method, savings=savings)
        from replay.sensing.electrostatics import suite

        return suite.kernels(method=method.method, savings=savings)

    def faults(
        self, parts: Mapping[str, CapacitiveSensorPart], felt: Callable[[], Mapping[str, Sequence[str]]], method: Any
    ) -> Iterator[tuple[tuple[str, ...], str]]:
        """See `SensorKind`: sensors that cannot be one unit."""
        if method.method in ELECTROSTATIC:
            from replay.sensing.electrostatics.notes import faults

            yield from faults(parts, felt(), method.method)

    def notes(
        self,
        parts: Mapping[str, CapacitiveSensorPart],
        felt: Mapping[str, Sequence[str]],
        earth: Mapping[str, float],
        method: Any,
    ) -> Iterator[tuple[tuple[str, ...], str]]:
        """See `SensorKind`: units and bodies."""
        if method.method in ELECTROSTATIC:
            from replay.sensing.electrostatics.notes import notes

            yield from notes(parts, felt, earth, method.method)

    def drawing(self, sensor: CapacitiveSensor) -> Drawing:
        """See `SensorKind`: the plates, and their outlines."""
        corners = {
            plate.name: transforms.apply(plate.T_link_plate, _CORNERS * np.append(plate.half_size, 0.0))
            for plate in sensor.plates
        }
        outlines = [four[[0, 1, 2, 3, 0]] for four in corners.values()]
        return Drawing(_COLOR, 1.0, outlines, np.concatenate(list(corners.values())), corners)

    def cost(self, part: CapacitiveSensorPart, triangles: int) -> float:
        """See `SensorKind`."""
        return 5.0 * len(part.plates) * math.sqrt(triangles)
