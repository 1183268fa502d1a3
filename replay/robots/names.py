"""Names of a description as names of the language, which become parts of topics and of pairs."""

from __future__ import annotations

import re
from collections.abc import Iterable

from replay.robots.description import RobotChange

_LONGEST = 100


class RobotNames:
    """What the links, or the joints, or the bodies of one link are called in the part.

    Args:
        prefix: goes before every name.
    """

    def __init__(self, prefix: str = "") -> None:
        self._prefix = prefix
        self._called: dict[str, str] = {}
        self._taken: set[str] = set()
        self._number: dict[str, int] = {}  # of the last one that was called so

    def take(self, name: str) -> str:
        """Return what something of a name is called; a name that is taken already gets a number."""
        plain = re.sub(r"[^A-Za-z0-9_.\-]", "_", self._prefix + name)
        plain = re.sub(r"^[.\-]", "_", plain)[: _LONGEST - 8] or "_"
        called, number = plain, self._number.get(plain, 1)
        while called in self._taken:
            number += 1
            called = f"{plain}_{number}"
        self._number[plain] = number
        self._taken.add(called)
        self._called.setdefault(name, called)
        return called

    def __getitem__(self, name: str) -> str:
        return self._called[name]

    def __contains__(self, name: str) -> bool:
        return name in self._called

    def changes(self, kind: str) -> Iterable[RobotChange]:
        """Yield which names had to be changed beyond their prefix."""
        for name, called in self._called.items():
            if called != self._prefix + name:
                yield RobotChange(f"{kind} {name}", f"is called {called}")
