"""The distance sensor, as every other room sees it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from replay.language.units import LENGTH
from replay.numerics import transforms
from replay.sensing.distance.columns import Detection, DistanceColumns
from replay.sensing.distance.part import DistanceCondition, DistanceExpectation, DistanceMethod, DistanceSensorPart
from replay.sensing.kind import Drawing, Expected, Output, SensorKind

if TYPE_CHECKING:
    from replay.sensing.distance.suite import DistanceSensor

_COLOR = (110, 190, 255, 140)
_SEGMENTS = 24
_ENDLESS = 2.0
"""Length [m] that a cone without a range is drawn with."""


class Distance(SensorKind):
    """Reads the distance to the closest point in a cone."""

    name = "distance"
    part = DistanceSensorPart
    method = DistanceMethod
    revisions: ClassVar = {"exact": 3, "rays": 2, "thesis": 2}
    models: ClassVar = {"thesis2015": DistanceMethod(method="thesis")}
    expectation = DistanceExpectation
    expected = (
        Expected("distance", lambda columns: columns.distance, unit="m", inside=False),
        Expected("detected", lambda columns: columns.status != Detection.NOTHING),
        Expected("measured", lambda columns: columns.measured, unit="m"),
    )
    output = Output(
        reading=lambda columns: columns.distance,
        beyond=lambda columns: columns.status == Detection.TOO_CLOSE,
        substitute=lambda part: part.range,
        condition=DistanceCondition,
        threshold=lambda condition: condition.below,
        dimension=LENGTH,
    )
    columns = DistanceColumns

    def module(self) -> Any:
        """See `SensorKind`."""
        from replay.sensing.distance import suite

        return suite

    def sensor(self, name: str, part: DistanceSensorPart, link: int, ignored_links: frozenset[int]) -> DistanceSensor:
        """See `SensorKind`."""
        from replay.sensing.distance.suite import DistanceSensor

        same = part.model_dump(include={"aperture", "range", "min_range"})
        return DistanceSensor(name, link, part.pose.transform(), **same, ignored_links=ignored_links)

    def drawing(self, sensor: DistanceSensor) -> Drawing:
        """See `SensorKind`: the outline of the cone and, unless it is endless, of the end of its range."""
        length = sensor.range if np.isfinite(sensor.range) else _ENDLESS
        half = min(0.5 * sensor.aperture, 0.49 * np.pi)
        turn = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
        ring = np.stack([np.sin(half) * np.cos(turn), np.sin(half) * np.sin(turn), np.full(len(turn), np.cos(half))])
        corners = transforms.apply(sensor.T_link_sensor, np.concatenate([np.zeros((1, 3)), length * ring.T]))
        apex, rim = corners[0], corners[1:]
        sides = [np.stack([apex, rim[k]]) for k in range(0, _SEGMENTS, _SEGMENTS // 8)]
        return Drawing(_COLOR, 0.8, [*sides, rim] if np.isfinite(sensor.range) else sides, apex[None], {})

    def cost(self, part: DistanceSensorPart, triangles: int) -> float:
        """See `SensorKind`: the nearest triangles are found at once, however many there are."""
        return 20.0
