"""The capacitive sensor, as every other room sees it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from replay.numerics import transforms
from replay.sensing.capacitive.columns import CapacitiveColumns
from replay.sensing.capacitive.part import CapacitiveExpectation, CapacitiveMethod
from replay.sensing.capacitive.part import CapacitiveSensor as Written
from replay.sensing.kind import Drawing, Expected, Floats, Outline, SensorKind

if TYPE_CHECKING:
    from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate
    from replay.sensing.capacitive.suite import CapacitiveSuite
    from replay.sensing.target import Target

_COLOR = (216, 140, 60, 255)


class Capacitive(SensorKind):
    """Reads the capacitance between plates and what is around them, through a voltage divider."""

    name = "capacitive"
    part = Written
    method = CapacitiveMethod
    revisions: ClassVar = {"tree": 5, "exact": 4, "midpoint": 3}
    models: ClassVar = {"thesis2015": CapacitiveMethod(method="midpoint", splits=4)}
    expectation = CapacitiveExpectation
    expected = (
        Expected("output", lambda columns: columns.output_voltage, unit="V"),
        Expected("saturated", lambda columns: columns.saturated),
    )
    columns = CapacitiveColumns

    def sensor(self, name: str, part: Written, link: int, ignored_links: frozenset[int]) -> CapacitiveSensor:
        """See `SensorKind`."""
        from replay.sensing.capacitive.sensor import CapacitiveSensor, Plate

        plates = tuple(
            Plate(name=plate, T_link_plate=written.pose.transform(), half_size=0.5 * np.array(written.size))
            for plate, written in sorted(part.plates.items())
        )
        return CapacitiveSensor(
            name=name,
            link=link,
            plates=plates,
            coupling=part.coupling,
            permittivity=part.permittivity,
            supply=part.supply,
            stray_capacitance=part.stray_capacitance,
            side=part.side,
            faces=part.faces,
            ignored_links=ignored_links,
        )

    def suite(
        self, sensors: Sequence[CapacitiveSensor], targets: Sequence[Target], method: CapacitiveMethod, *, savings: bool
    ) -> CapacitiveSuite:
        """See `SensorKind`."""
        from replay.sensing.capacitive.suite import CapacitiveSuite

        return CapacitiveSuite(sensors, targets, method=method.method, **method.options(), savings=savings)

    def kernels(self, method: CapacitiveMethod, *, savings: bool) -> tuple[Any, ...]:
        """See `SensorKind`."""
        from replay.sensing.capacitive.suite import kernels

        return kernels(method=method.method, savings=savings)

    def drawing(self, sensor: CapacitiveSensor) -> Drawing:
        """See `SensorKind`: the plates, and their outlines."""
        corners = {plate.name: plate_corners(plate) for plate in sensor.plates}
        faces = [Outline(name, _COLOR, face=four) for name, four in corners.items()]
        strips = tuple(four[[0, 1, 2, 3, 0]] for four in corners.values())
        return Drawing((*faces, Outline("outline", _COLOR, strips)), np.concatenate(list(corners.values())))

    def cost(self, part: Written, triangles: int) -> float:
        """See `SensorKind`."""
        return 5.0 * len(part.plates) * math.sqrt(triangles)


def plate_corners(plate: Plate) -> Floats:
    """Return the corners (4, 3) [m] of a plate in the link's frame, in order around it."""
    x, y = plate.half_size
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return transforms.apply(plate.T_link_plate, corners)
