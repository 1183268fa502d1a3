"""Globs: patterns of names, in which `*`, `?` and `[...]` stand for characters; upper and lower case are different."""

from __future__ import annotations

import re
from collections.abc import Sequence
from fnmatch import fnmatchcase, translate


def fits(name: str, glob: str) -> bool:
    """Return whether a name fits a glob."""
    return fnmatchcase(name, glob)


def any_of(globs: Sequence[str]) -> re.Pattern[str]:
    """Return what matches the names that fit one of the globs."""
    return re.compile("|".join(translate(glob) for glob in globs))


def literal_glob(name: str) -> str:
    """Return the glob that this name fits and no other."""
    return re.sub(r"([*?[])", r"[\1]", name)


class Globs:
    """Names that many globs are asked about: each is looked for once, and one without wildcards is looked up.

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
        """Return the places of the names that fit a glob, in order."""
        if pattern not in self._found:
            self._found[pattern] = tuple(self._search(pattern))
        return self._found[pattern]

    def _search(self, pattern: str) -> list[int]:
        if not any(mark in pattern for mark in "*?["):
            return self._places.get(pattern, [])
        match = any_of([pattern]).match
        return [place for place, name in enumerate(self._names) if match(name)]
