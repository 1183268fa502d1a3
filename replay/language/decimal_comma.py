"""Decimals written with a comma, as much of the world does, where a point belongs: what is said of them.

In YAML a comma ends an entry of `{...}` and `[...]`, so that `{arm: 1,05}` holds `arm: 1` and a key `05` without a
value, and `[0,5, 1]` has three entries.
"""

from __future__ import annotations

import itertools
import re

from replay.language.node import Node

_HEAD = re.compile(r"[-+]?[0-9]+")
_TAIL = re.compile(r"[0-9]+(?:[eE][-+]?[0-9]+)?(?:\s*[^\s,:]{1,10})?")
_WHOLE = re.compile(rf"\s*({_HEAD.pattern}),({_TAIL.pattern})\s*")


def rule(text: str) -> str:
    """Return the rule that a text breaks which is a decimal with a comma, "" when it is none."""
    found = _WHOLE.fullmatch(text)
    return f"has a decimal comma; write {found[1]}.{found[2]}" if found else ""


def parted(head: str, tail: str) -> bool:
    """Return whether two texts with nothing but a comma between them are one decimal."""
    return _HEAD.fullmatch(head) is not None and _TAIL.fullmatch(tail) is not None


def hint(items: list[Node]) -> str:
    """Return what to add where a list has too many entries: that a comma in it may be a decimal one; else ""."""
    for left, right in itertools.pairwise(items):
        follows = left.place.line == right.place.line and left.place.column + len(left.text) + 1 == right.place.column
        if follows and parted(left.text, right.text):
            return f"; if {left.text},{right.text} is one number, write {left.text}.{right.text}"
    return ""
