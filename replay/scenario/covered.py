"""Distance sensors that one shape touches in every frame: most likely a part that they stand on and should ignore."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.scenario.layout import Layout
from replay.sensing.columns import DistanceColumns

TOUCHING = 1e-9
"""Readings up to this one [m] count as touching: what rounding leaves of a sensor that stands on a face."""


class CoveredSensors:
    """Follows which shape touches which distance sensor, block by block.

    Args:
        layout: names behind the columns.
    """

    def __init__(self, layout: Layout) -> None:
        self._layout = layout
        self._shape: NDArray[np.int32] | None = None

    def update(self, distance: DistanceColumns | None) -> None:
        """Take the results of the next n frames."""
        if distance is not None:
            touching = np.where(distance.distance <= TOUCHING, distance.shape, -1)
            first = touching[0] if self._shape is None else self._shape
            self._shape = np.where((touching == first).all(axis=0), first, -1)

    def notes(self) -> tuple[str, ...]:
        """Return a line for each sensor that the same shape has touched in every frame."""
        names, shapes = self._layout.distance_sensors, self._layout.shapes
        found = zip(names, self._shape if self._shape is not None else (), strict=False)
        return tuple(
            f"distance sensor {name!r} touches {shapes[k]} in every frame; let it ignore that link, or move it out"
            for name, k in found
            if k >= 0
        )
