"""Distance sensors that one shape touches in every frame: most likely a part that they stand on and should ignore."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from replay.sensing.distance.columns import DistanceColumns

TOUCHING = 1e-9
"""Readings up to this one [m] count as touching: what rounding leaves of a sensor that stands on a face."""


class CoveredSensors:
    """Follows which shape touches which distance sensor, block by block.

    Args:
        sensors: D names.
        shapes: names behind `DistanceColumns.shape`.
    """

    def __init__(self, sensors: Sequence[str], shapes: Sequence[str]) -> None:
        self._sensors, self._shapes = sensors, shapes
        self._touching: NDArray[np.int32] | None = None

    def update(self, distance: DistanceColumns) -> None:
        """Take the results of the next n frames."""
        touching = np.where(distance.distance <= TOUCHING, distance.shape, -1)
        first = touching[0] if self._touching is None else self._touching
        self._touching = np.where((touching == first).all(axis=0), first, -1)

    def notes(self) -> tuple[str, ...]:
        """Return a line for each sensor that the same shape has touched in every frame."""
        found = zip(self._sensors, self._touching if self._touching is not None else (), strict=False)
        return tuple(
            f"distance sensor {name!r} touches {self._shapes[k]} in every frame; "
            "let it ignore that link, or move it out"
            for name, k in found
            if k >= 0
        )
