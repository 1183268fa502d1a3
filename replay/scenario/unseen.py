"""What a run found between its frames, for people: contacts that no frame shows, and intervals that are not proven."""

from __future__ import annotations

import numpy as np

from replay.collision.columns import Between, CollisionColumns
from replay.collision.passages import passages
from replay.errors import count
from replay.scenario.layout import Layout
from replay.scenario.meetings import shown

TOLD = 20
"""Contacts of a run that are told one by one; all are counted."""


class Unseen:
    """Follows the results of all frames, block by block."""

    def __init__(self, layout: Layout) -> None:
        self._pairs = layout.pairs
        self._lines: list[str] = []
        self._contacts = 0
        self._undecided = 0
        self._first = ""
        self._frames = 0

    def update(self, collision: CollisionColumns | None) -> None:
        """Take the results of the next frames."""
        if collision is None:
            return
        found = passages(collision.crossings)
        rows = zip(found.pair.tolist(), found.frame.tolist(), found.begin.tolist(), found.end.tolist(), strict=True)
        for pair, frame, begin, end in list(rows)[: TOLD - len(self._lines)]:
            when = f"from {shown(tuple(begin))} until {shown(tuple(end))}"
            self._lines.append(f"contact between frames {frame - 1} and {frame}, {when}: {self._name(pair)}")
        self._contacts += len(found.pair)
        if collision.between is not None:
            undecided = np.argwhere(collision.between == Between.UNDECIDED)
            if len(undecided) and not self._undecided:
                row, pair = undecided[0].tolist()
                last = self._frames + row
                self._first = f"between frames {last - 1} and {last}: {self._name(pair)}"
            self._undecided += len(undecided)
        self._frames += len(collision.level)

    def lines(self) -> tuple[str, ...]:
        """Return what there is to say, a line each."""
        lines = list(self._lines)
        if self._contacts > len(lines):
            lines.append(f"{count(self._contacts - len(lines), 'more contact')} between frames")
        if self._undecided:
            lines.append(f"not proven in {count(self._undecided, 'interval')} of a pair, first {self._first}")
        return tuple(lines)

    def _name(self, pair: int) -> str:
        return self._pairs[pair].replace("|", " | ")
