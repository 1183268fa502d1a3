"""How much of a night may be drawings: they are most of what its pages take on the disk."""

from __future__ import annotations

from collections.abc import Sequence

from replay.comparison.plots import Plot

ROOM = 512 << 20
"""Bytes of all drawings of a night."""
ROOM_OF_ONE = 4 << 20
"""Bytes of the drawings of one scenario; those of a long one in which everything changed would be some 10 MiB."""


class Album:
    """Takes the drawings of one scenario after another, as long as there is room."""

    def __init__(self) -> None:
        self._left = ROOM

    def keep(self, drawn: Sequence[Plot]) -> tuple[tuple[Plot, ...], bool]:
        """Return those drawings of a scenario for which there is room, the first ones, and whether these are all."""
        kept: list[Plot] = []
        room = min(self._left, ROOM_OF_ONE)
        for plot in drawn:
            room -= plot.size
            if room < 0:
                return tuple(kept), False
            self._left -= plot.size
            kept.append(plot)
        return tuple(kept), True
