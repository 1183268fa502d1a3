"""Values that stand side by side in messages, in one list or one mapping: they are taken together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from replay.logs.field_path import ABSENT, FieldPath, below
from replay.numerics.arrays import Floats


@dataclass(eq=False)
class Siblings:
    """Some values of one list or mapping in messages; of many plain numbers one array is made.

    Attributes:
        parent: where the list or mapping is.
        steps: from there to the values: all of them numbers of entries, or names.
        paths: of the values, as they are written.
        at: which messages have it.
        rows: its values in each of these, ABSENT where there is none.
    """

    parent: FieldPath
    steps: tuple[int | str, ...]
    paths: tuple[str, ...]
    at: list[int] = field(default_factory=list)
    rows: list[Sequence[Any]] = field(default_factory=list)

    def __post_init__(self) -> None:
        numbers = [step for step in self.steps if isinstance(step, int)]
        self._kind: Any = list if numbers else dict
        in_a_row = bool(numbers) and numbers == [*range(numbers[0], numbers[0] + len(numbers))]
        self._part = slice(numbers[0], numbers[-1] + 1) if in_a_row else None

    def take(self, k: int, message: Any) -> None:
        """Take the values of message k."""
        found = self.parent.value(message)
        if found is ABSENT:
            return
        self.at.append(k)
        if type(found) is self._kind:
            try:
                row = found[self._part] if self._part else tuple(map(found.__getitem__, self.steps))
            except (IndexError, KeyError):
                row = ()
            if len(row) == len(self.steps):
                self.rows.append(row)
                return
        self.rows.append([below(found, step, None) for step in self.steps])  # some are missing

    def table(self) -> Floats | None:
        """Return the rows as an array; None if not all are plain numbers."""
        try:
            table = np.array(self.rows)
        except ValueError:  # lists of several lengths
            return None
        return table.astype(np.float64) if table.ndim == 2 and table.dtype.kind in "bif" else None


def siblings(paths: Mapping[str, FieldPath]) -> list[Siblings]:
    """Return the paths by what their values stand in; those that end in the name of an entry are left out."""
    found: dict[tuple[FieldPath, type], dict[str, int | str]] = {}
    for path, written in paths.items():
        *above, last = written.steps
        if not isinstance(last, tuple):
            found.setdefault((FieldPath("", tuple(above)), type(last)), {})[path] = last
    return [Siblings(parent, tuple(steps.values()), tuple(steps)) for (parent, _), steps in found.items()]
