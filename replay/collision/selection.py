"""The pairs of a pipeline, listed or ruled, and which of a block's candidates are among them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.collision.pairs import Pair, PairRules
from replay.errors import InvalidValue
from replay.numerics.arrays import Flags, Integers


@dataclass(frozen=True, eq=False)
class Selected:
    """k tested pairs: their bodies (k, 2) in the pairs' order, their columns if listed, and whether they can move."""

    rows: Integers
    columns: Integers
    static: Flags

    def fixed(self) -> Selected:
        """Return those that cannot move."""
        return Selected(self.rows[self.static], self.columns[self.static], self.static[self.static])

    def moving(self) -> Selected:
        """Return those that can."""
        return Selected(self.rows[~self.static], self.columns[~self.static], self.static[~self.static])


class Listed:
    """Pairs given one by one.

    Args:
        pairs: in the columns' order.
        turning: whether no pair counts as static.

    Raises:
        InvalidValue: a pair of bodies is listed twice.
    """

    def __init__(self, pairs: Sequence[Pair], *, turning: bool) -> None:
        self.listed = tuple(pairs)
        self.count = len(self.listed)
        self._rows = np.array([[pair.a, pair.b] for pair in self.listed], dtype=np.int64).reshape(-1, 2)
        self._static = np.array([pair.static and not turning for pair in self.listed], dtype=bool)
        self.static_count = int(self._static.sum())
        self._bodies = int(self._rows.max(initial=-1)) + 1
        keys = self._keys(self._rows)
        self._order = np.argsort(keys, kind="stable")
        self._sorted = keys[self._order]
        twice = np.flatnonzero(self._sorted[1:] == self._sorted[:-1])
        if len(twice):
            raise InvalidValue("pairs", self.listed[self._order[twice[0]]].name, "each pair must be listed once")

    def all(self) -> Selected:
        """Return all pairs."""
        return Selected(self._rows, np.arange(self.count), self._static)

    def bodies(self) -> Integers:
        """Return the bodies that are in any pair."""
        return np.unique(self._rows)

    def choose(self, candidates: Integers) -> Selected:
        """Return the listed ones of pairs of bodies (k, 2)."""
        keys = self._keys(candidates)
        place = np.minimum(np.searchsorted(self._sorted, keys), self.count - 1)
        columns = np.sort(self._order[place[self._sorted[place] == keys]])
        return Selected(self._rows[columns], columns, self._static[columns])

    def _keys(self, rows: Integers) -> Integers:
        keys: Integers = rows.min(axis=1) * self._bodies + rows.max(axis=1)
        return keys


class Ruled:
    """Pairs given as rules; all of them count as moving, since a scene so large has no column for each."""

    def __init__(self, rules: PairRules) -> None:
        self._rules = rules
        self.listed: tuple[Pair, ...] = ()
        self.count = rules.count()
        self.static_count = 0

    def bodies(self) -> Integers:
        """Return all bodies."""
        return np.arange(len(self._rules.names))

    def choose(self, candidates: Integers) -> Selected:
        """Return the tested ones of pairs of bodies (k, 2)."""
        rows = self._rules.by_name(candidates[self._rules.tested(candidates[:, 0], candidates[:, 1])])
        return Selected(rows, np.zeros(len(rows), dtype=np.int64), np.zeros(len(rows), dtype=bool))
