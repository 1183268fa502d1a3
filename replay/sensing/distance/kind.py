"""The distance sensor, as every other room sees it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from replay.numerics import transforms
from replay.sensing.distance.columns import Detection, DistanceColumns
from replay.sensing.distance.part import DistanceExpectation, DistanceMethod
from replay.sensing.distance.part import DistanceSensor as Written
from replay.sensing.kind import Drawing, Expected, Floats, Outline, SensorKind

if TYPE_CHECKING:
    from replay.sensing.distance.suite import DistanceSensor, DistanceSuite
    from replay.sensing.target import Target

_COLOR = (110, 190, 255, 140)
_SEGMENTS = 24
_ENDLESS = 2.0
"""Length [m] that a cone without a range is drawn with."""


class Distance(SensorKind):
    """Reads the distance to the closest point in a cone."""

    name = "distance"
    part = Written
    method = DistanceMethod
    revisions: ClassVar = {"exact": 3, "rays": 2, "thesis": 2}
    models: ClassVar = {"thesis2015": DistanceMethod(method="thesis")}
    expectation = DistanceExpectation
    expected = (
        Expected("distance", lambda columns: columns.distance, unit="m", inside=False),
        Expected("detected", lambda columns: columns.status != Detection.NOTHING),
    )
    columns = DistanceColumns

    def sensor(self, name: str, part: Written, link: int, ignored_links: frozenset[int]) -> DistanceSensor:
        """See `SensorKind`."""
        from replay.sensing.distance.suite import DistanceSensor

        return DistanceSensor(
            name=name,
            link=link,
            T_link_sensor=part.pose.transform(),
            aperture=part.aperture,
            range=part.range,
            min_range=part.min_range,
            ignored_links=ignored_links,
        )

    def suite(
        self, sensors: Sequence[DistanceSensor], targets: Sequence[Target], method: DistanceMethod, *, savings: bool
    ) -> DistanceSuite:
        """See `SensorKind`."""
        from replay.sensing.distance.suite import DistanceSuite

        return DistanceSuite(sensors, targets, method=method.method, **method.options(), savings=savings)

    def kernels(self, method: DistanceMethod, *, savings: bool) -> tuple[Any, ...]:
        """See `SensorKind`."""
        from replay.sensing.distance.suite import kernels

        return kernels(method=method.method, engine=method.engine or "own", savings=savings)

    def drawing(self, sensor: DistanceSensor) -> Drawing:
        """See `SensorKind`: the outline of the cone and, unless it is endless, of the end of its range."""
        apex = sensor.T_link_sensor[None, :3, 3]
        return Drawing((Outline("", _COLOR, tuple(cone_strips(sensor)), width=0.8),), apex)

    def cost(self, part: Written, triangles: int) -> float:
        """See `SensorKind`: the nearest triangles are found at once, however many there are."""
        return 20.0


def cone_strips(sensor: DistanceSensor) -> list[Floats]:
    """Return the line strips (k, 3) [m], in the link's frame, that outline a sensing cone and the end of its range."""
    length = sensor.range if np.isfinite(sensor.range) else _ENDLESS
    half = min(0.5 * sensor.aperture, 0.49 * np.pi)
    turn = np.linspace(0.0, 2.0 * np.pi, _SEGMENTS + 1)
    ring = np.stack(
        [np.sin(half) * np.cos(turn), np.sin(half) * np.sin(turn), np.full(len(turn), np.cos(half))], axis=1
    )
    corners = transforms.apply(sensor.T_link_sensor, np.concatenate([np.zeros((1, 3)), length * ring]))
    apex, rim = corners[0], corners[1:]
    sides = [np.stack([apex, rim[k]]) for k in range(0, _SEGMENTS, _SEGMENTS // 8)]
    return [*sides, rim] if np.isfinite(sensor.range) else sides
