"""Which of many names fit a glob: each glob is looked for once, and one without wildcards is looked up."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import translate


class Globs:
    """Names that globs are asked about.

    Args:
        names: in the order of answers; they may repeat.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self._names = names
        self._places: dict[str, list[int]] = {}
        for place, name in enumerate(names):
            self._places.setdefault(name, []).append(place)
        self._found: dict[str, tuple[int, ...]] = {}

    def fitting(self, pattern: str) -> tuple[int, ...]:
        """Return the places of the names that a glob fits, as `fnmatch.fnmatchcase` says, in order."""
        if pattern not in self._found:
            self._found[pattern] = tuple(self._search(pattern))
        return self._found[pattern]

    def _search(self, pattern: str) -> list[int]:
        if not any(mark in pattern for mark in "*?["):
            return self._places.get(pattern, [])
        fits = re.compile(translate(pattern)).match
        return [place for place, name in enumerate(self._names) if fits(name)]
