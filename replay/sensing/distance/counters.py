"""What a suite of exact distance sensors counts while it works."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from replay.sensing.distance import query


@dataclass
class DistanceCounters:
    """What a suite did since it was made; with other methods than "exact" only the first two are counted.

    Attributes:
        readings: asked for: a sensor, a target and a frame each.
        triangles: of the targets, over all readings.
        repeated: readings answered from the frame before, the pose being the same.
        boxes: tree boxes bounded.
        looked_at: triangles in leaves of the tree that were reached.
        computed: triangles whose closest point in the cone was computed.
    """

    readings: int = 0
    triangles: int = 0
    repeated: int = 0
    boxes: int = 0
    looked_at: int = 0
    computed: int = 0

    def add(self, counted: Sequence[int]) -> None:
        """Add the counts of a kernel."""
        self.repeated += counted[query.REPEATED]
        self.boxes += counted[query.BOXES]
        self.looked_at += counted[query.LOOKED_AT]
        self.computed += counted[query.COMPUTED]
