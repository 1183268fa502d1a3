"""Values that stand side by side in messages, in one list or one mapping: they are taken together."""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from replay.logs.field_path import ABSENT, FieldPath, below


class Siblings:
    """Some values of one list or mapping in messages.

    Attributes:
        paths: of the values, as they are written.
        there: (n,) whether a message has the list or mapping.
        table: (n, values) of those in which all values are numbers.
        odd: the values of the others, by message; ABSENT where there is none.
    """

    def __init__(self, parent: FieldPath, steps: Mapping[str, int | str], count: int) -> None:
        """Make room.

        Args:
            parent: where the list or mapping is.
            steps: from there to each value, by its path: all of them numbers of entries, or names.
            count: of the messages.
        """
        self.paths = tuple(steps)
        self.there = np.zeros(count, dtype=np.bool_)
        self.table = np.full((count, len(steps)), np.nan)
        self.odd: dict[int, Sequence[Any]] = {}
        self._parent = parent
        self._steps = tuple(steps.values())
        numbers = [step for step in self._steps if isinstance(step, int)]
        self._kind: Any = list if numbers else dict
        in_a_row = bool(numbers) and numbers == [*range(numbers[0], numbers[0] + len(numbers))]
        self._part = slice(numbers[0], numbers[-1] + 1) if in_a_row else None
        self._row = struct.Struct(f"{len(steps)}d")

    def take(self, k: int, message: Any) -> None:
        """Take the values of message k."""
        found = self._parent.value(message)
        if found is ABSENT:
            return
        self.there[k] = True
        if type(found) is self._kind:
            try:
                row = found[self._part] if self._part else map(found.__getitem__, self._steps)
                self._row.pack_into(self.table.data, k * self._row.size, *row)
                return
            except (IndexError, KeyError, OverflowError, struct.error):
                pass  # some are missing, or no number that is one here
        self.odd[k] = [below(found, step, None) for step in self._steps]


def siblings(paths: Mapping[str, FieldPath], count: int) -> list[Siblings]:
    """Return the paths by what their values stand in; those that end in the name of an entry are left out."""
    found: dict[tuple[FieldPath, type], dict[str, int | str]] = {}
    for path, written in paths.items():
        *above, last = written.steps
        if not isinstance(last, tuple):
            found.setdefault((FieldPath("", tuple(above)), type(last)), {})[path] = last
    return [Siblings(parent, steps, count) for (parent, _), steps in found.items()]
