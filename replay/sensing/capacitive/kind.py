"""The capacitive sensor, as every other room sees it."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from replay.numerics import transforms
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.capacitive.part import CapacitiveExpectation, CapacitiveMethod, CapacitiveSensorPart
from replay.sensing.kind import Drawing, Expected, SensorKind

if TYPE_CHECKING:
    from replay.sensing.capacitive.sensor import CapacitiveSensor

_COLOR = (216, 140, 60, 255)
_CORNERS = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])


class Capacitive(SensorKind):
    """Reads the capacitance between plates and what is around them, through a voltage divider."""

    name = "capacitive"
    part = CapacitiveSensorPart
    method = CapacitiveMethod
    revisions: ClassVar = {"tree": 6, "exact": 4, "midpoint": 3}
    models: ClassVar = {"thesis2015": CapacitiveMethod(method="midpoint", splits=4)}
    expectation = CapacitiveExpectation
    expected = (
        Expected("output", lambda columns: columns.output_voltage, unit="V"),
        Expected("saturated", lambda columns: columns.saturated),
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
        same = part.model_dump(exclude={"link", "plates", "ignore"})
        return CapacitiveSensor(name=name, link=link, plates=plates, **same, ignored_links=ignored_links)

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
