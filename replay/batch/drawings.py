"""How much of a night may be drawings: they are kept until its page is written, and are most of both."""

from __future__ import annotations

import dataclasses

from replay.batch.judged import Judged
from replay.comparison.plots import Plot

ROOM = 32 << 20
"""Bytes of all drawings of a night; those of a long scenario in which everything changed are some 10 MiB."""


class Album:
    """Takes the drawings of one scenario after another, as long as there is room."""

    def __init__(self) -> None:
        self._left = ROOM

    def keep(self, item: Judged) -> Judged:
        """Return a scenario with those of its drawings for which there is room; the first are of what decides."""
        kept: list[Plot] = []
        for plot in item.drawings:
            self._left -= plot.size
            if self._left < 0:
                return dataclasses.replace(item, drawings=tuple(kept), undrawn=True)
            kept.append(plot)
        return item
