"""The tree that a text becomes: values that know where they are written."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from replay.errors import Problem

Scalar = str | int | float | bool | None

KeyPath = tuple[str | int, ...]
"""The keys and the places in sequences that lead from a document's root to a value."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where something is written; line and column count from 1."""

    file: str
    line: int
    column: int

    def __str__(self) -> str:
        return f"{self.file}:{self.line}:{self.column}"

    def __reduce__(self) -> tuple[type[Place], tuple[str, int, int]]:
        """Trees of thousands of these are pickled, and dataclasses with slots look up all their fields for each."""
        return Place, (self.file, self.line, self.column)

    def problem(self, message: str) -> Problem:
        """Return what is wrong here."""
        return Problem(message, file=self.file, line=self.line, column=self.column)


@dataclass(slots=True, eq=False)
class Node:
    """A value with its place; a mapping keeps the place of each key, a scalar the text it was written as.

    Attributes:
        place: where the value starts (for an alias, where its anchor's value starts).
        value: the scalar, or the mapping's or sequence's nodes.
        keys: places of the keys, for a mapping.
        text: the scalar as written, for messages.
        size: number of nodes in this tree with aliases written out.
        whole: false for the root of a document with entries that had to be left out.
    """

    place: Place
    value: Scalar | dict[str, Node] | list[Node]
    keys: dict[str, Place] = field(default_factory=dict)
    text: str = ""
    size: int = 1
    whole: bool = True

    def __reduce__(self) -> tuple[type[Node], tuple[Any, ...]]:
        """See `Place`; a tree has no cycles."""
        return Node, (self.place, self.value, self.keys, self.text, self.size, self.whole)

    @property
    def mapping(self) -> dict[str, Node]:
        """The nodes by key; empty when this is not a mapping."""
        return self.value if isinstance(self.value, dict) else {}

    @property
    def sequence(self) -> list[Node]:
        """The nodes in order; empty when this is not a sequence."""
        return self.value if isinstance(self.value, list) else []

    def child(self, key: str | int) -> Node | None:
        """Return the node under a key or index, or None."""
        if isinstance(key, str):
            return self.mapping.get(key)
        return self.sequence[key] if 0 <= key < len(self.sequence) else None

    def data(self) -> Any:
        """Return plain dicts, lists and scalars."""
        if isinstance(self.value, dict):
            return {key: node.data() for key, node in self.value.items()}
        if isinstance(self.value, list):
            return [node.data() for node in self.value]
        return self.value

    def copy(self, made: dict[int, Node]) -> Node:
        """Return a tree that can be changed by itself; what aliases share stays shared.

        Args:
            made: the copies so far, by the identity of what they are copies of; an empty dictionary at first.
        """
        if id(self) not in made:
            value = self.value
            made[id(self)] = node = Node(self.place, value, dict(self.keys), self.text, self.size, self.whole)
            if isinstance(value, dict):
                node.value = {key: child.copy(made) for key, child in value.items()}
            elif isinstance(value, list):
                node.value = [child.copy(made) for child in value]
        return made[id(self)]

    def shown(self) -> str:
        """Return the value for a message, in at most about 60 characters."""
        if isinstance(self.value, dict):
            return "a mapping"
        if isinstance(self.value, list):
            return f"a list of {len(self.value)}" if self.value else "an empty list"
        text = repr(self.value) if isinstance(self.value, str) else self.text or "null"
        return text if len(text) <= 60 else f"{text[:40]}...{text[-16:]}"
