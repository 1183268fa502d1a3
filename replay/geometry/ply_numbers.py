"""The numbers of a PLY file's body, text or binary, as columns of its elements' properties."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from replay.numerics.arrays import Column, Integers

Kind = np.dtype[Any]


class Property(NamedTuple):
    """A number of an element, or a list of numbers led by their count, whose type is `length`."""

    name: str
    item: Kind
    length: Kind | None


@dataclass
class Element:
    """A kind of entry that the header announces: how many there are, and what each holds."""

    name: str
    count: int
    properties: list[Property] = field(default_factory=list)

    @property
    def least(self) -> int:
        """The fewest bytes of one in a binary file."""
        return sum((entry.length or entry.item).itemsize for entry in self.properties)


_WIDE = 1000  # entries of a row that are read as a table; beyond, rows are read one by one


class Lists(NamedTuple):
    """A list in each of n rows: all values one after the other, and how many each row has (n,)."""

    values: Column
    lengths: Integers


_MOST = 1 << 31
_SPACE = re.compile(rb"\s")

Columns = dict[str, Column | Lists]


class Source(Protocol):
    """Numbers that are read one after the other."""

    at: int

    def rows(self, kinds: list[Kind], count: int) -> list[Column]:
        """Return the columns of a number of rows that follow, each of numbers of these kinds.

        Raises:
            ValueError: there are fewer.
        """

    def run(self, kind: Kind, count: int) -> Column:
        """Return the next numbers, (count,), all of one kind; ValueError when there are fewer."""


class TextNumbers:
    """Numbers written as words."""

    def __init__(self, body: bytes, announced: str) -> None:
        try:
            self._numbers = np.concatenate([np.array(part.split(), dtype=np.float64) for part in _parts(body)])
        except ValueError:
            raise ValueError("its text holds words that are not numbers") from None
        self._announced = announced
        self.at = 0

    def rows(self, kinds: list[Kind], count: int) -> list[Column]:
        """See `Source`."""
        end = self.at + len(kinds) * count
        if end > len(self._numbers):
            raise ValueError(f"its header announces {self._announced}; its numbers end before")
        table = self._numbers[self.at : end].reshape(count, len(kinds))
        self.at = end
        return list(table.T)

    def run(self, kind: Kind, count: int) -> Column:
        """See `Source`."""
        end = self.at + count
        if end > len(self._numbers):
            raise ValueError(f"its header announces {self._announced}; its numbers end before")
        values = self._numbers[self.at : end]
        self.at = end
        return values


def _parts(text: bytes) -> Iterator[bytes]:
    """Yield a text in parts of about a megabyte, cut between words, so that few words are in memory at once."""
    begin = 0
    while begin <= len(text):
        end = _SPACE.search(text, begin + (1 << 20))
        yield text[begin : end.start() if end else len(text)]
        begin = end.start() + 1 if end else len(text) + 1


class BinaryNumbers:
    """Numbers as bytes."""

    def __init__(self, body: bytes, announced: str) -> None:
        self._body, self._announced = body, announced
        self.at = 0

    def rows(self, kinds: list[Kind], count: int) -> list[Column]:
        """See `Source`."""
        row = np.dtype([(str(k), kind) for k, kind in enumerate(kinds)])
        if self.at + row.itemsize * count > len(self._body):
            raise ValueError(f"its header announces {self._announced}; the file ends before")
        table = np.frombuffer(self._body, row, count, self.at)
        self.at += row.itemsize * count
        return [table[name] for name in row.names or ()]

    def run(self, kind: Kind, count: int) -> Column:
        """See `Source`."""
        if self.at + kind.itemsize * count > len(self._body):
            raise ValueError(f"its header announces {self._announced}; the file ends before")
        values = np.frombuffer(self._body, kind, count, self.at)
        self.at += kind.itemsize * count
        return values


def columns_of(element: Element, source: Source) -> Columns:
    """Return the columns of an element's properties; `source` stands at its first row and moves beyond its last.

    Raises:
        ValueError: there are fewer numbers than announced, or a list of a negative number of them.
    """
    if not element.count or not element.properties:
        return {}
    if all(entry.length is None for entry in element.properties):
        found = source.rows([entry.item for entry in element.properties], element.count)
        return {entry.name: column for entry, column in zip(element.properties, found, strict=True)}
    begin = source.at
    lengths = [len(values) for values in _row(element, source)]
    source.at = begin
    try:
        return _alike(element, source, lengths)
    except ValueError:  # lists of several lengths, or too few numbers, which the rows one by one tell apart
        source.at = begin
    rows = [_row(element, source) for _ in range(element.count)]
    result: Columns = {}
    for k, entry in enumerate(element.properties):
        values = np.concatenate([row[k] for row in rows]).astype(entry.item, copy=False)
        result[entry.name] = values if entry.length is None else Lists(values, np.array([len(row[k]) for row in rows]))
    return result


def _row(element: Element, source: Source) -> list[Column]:
    """Return the values of one row's properties."""
    found = []
    for entry in element.properties:
        length = 1 if entry.length is None else source.run(entry.length, 1)[0]
        if not 0 <= length < _MOST:
            raise ValueError(f"a list of its element {element.name} announces {length} entries")
        found.append(source.run(entry.item, int(length)))
    return found


def _alike(element: Element, source: Source, lengths: list[int]) -> Columns:
    """Return the columns of rows whose lists all have these lengths; ValueError where one has not."""
    if sum(lengths) > _WIDE:
        raise ValueError("its rows are too long to be read as a table")
    kinds: list[Kind] = []
    for entry, length in zip(element.properties, lengths, strict=True):
        kinds += ([] if entry.length is None else [entry.length]) + [entry.item] * length
    found = iter(source.rows(kinds, element.count))
    result: Columns = {}
    for entry, length in zip(element.properties, lengths, strict=True):
        if entry.length is None:
            result[entry.name] = next(found)
            continue
        if (next(found) != length).any():
            raise ValueError("its lists differ in length")
        items = [next(found) for _ in range(length)]
        values = np.stack(items, axis=1).ravel() if items else np.zeros(0, entry.item)
        result[entry.name] = Lists(values, np.full(element.count, length))
    return result
