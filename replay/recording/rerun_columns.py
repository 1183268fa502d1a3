"""Columns of rerun components made straight from arrays, and chunks of them.

The library's own classes convert whatever they are given, at 20 to 60 us a column, and check what they are given, at
10 us a chunk. Here a column is one or two buffers around the array that is there; what a component is called and how
it is laid out is asked of the library, once.
"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from replay.numerics.arrays import Integers, ShortIntegers
from replay.recording.blueprint import TIMELINE
from replay.recording.rerun_inside import made

Lengths = int | Integers
"""How many elements each list has: one number for all lists, or (n,) numbers."""

Column = tuple[Any, Any]
"""A component: its descriptor, and its values as an arrow array with a list a row."""

Index = dict[str, Any]
"""The times of rows as arrow arrays, by timeline; without any, a row holds at all times."""


def column(archetype: str, field: str, values: Any, *lengths: Lengths) -> Column:
    """Return the column of a component.

    Args:
        archetype, field: as the library calls them, "Points3D" and "positions".
        values: all elements of all rows, one after another: an array, or a list of texts.
        lengths: elements a row; of a component that is itself a list (line strips), elements a row, and points an
            element.
    """
    component = _component(archetype, field)
    return component.descriptor, component.listed(component.elements(values, lengths[1:]), lengths[0])


def row(archetype: str, field: str, values: Any) -> Column:
    """Return the column of a component that has one row, which holds all values."""
    component = _component(archetype, field)
    elements = component.elements(values, ())
    return component.descriptor, _cut(component.lists, elements, _ends(len(elements)))


def constants(archetype: Any) -> tuple[Column, ...]:
    """Return the components of one of the library's archetypes as columns of one row."""
    found = archetype.as_component_batches()
    return tuple((batch.component_descriptor(), _one(batch.as_arrow_array())) for batch in found)


def packed(colors: ArrayLike) -> NDArray[np.uint32]:
    """Return colours (n, 4), 0 to 255, as the library keeps them: 0xRRGGBBAA."""
    return np.ascontiguousarray(colors, dtype=np.uint8).view(">u4")[:, 0].astype(np.uint32)


def index_of(time: Integers, frames: Integers) -> Index:
    """Return rows' times [ns] and frames as the two timelines of a recording."""
    import pyarrow as pa

    return {TIMELINE: _flat(pa.duration("ns"), time), "frame": _flat(pa.int64(), frames)}


class Chunks:
    """Takes chunks and sends them together: each sending wakes a thread of the library, which costs several chunks."""

    def __init__(self) -> None:
        self._chunks: list[Any] = []

    def add(self, path: str, index: Index, columns: Iterable[Column]) -> None:
        """Take columns of an entity, as of `rerun_inside.made`."""
        self._chunks.append(made(path, index, columns))

    def send(self, stream: Any) -> None:
        """Send all that was taken to a rerun.RecordingStream."""
        stream.send_chunks(self._chunks)
        self._chunks = []


def entity(*parts: str) -> str:
    """Return the path of an entity from the names of its parts."""
    import rerun as rr

    return rr.new_entity_path(list(parts))


class _Kind:
    """What the values of a component, or of what they are made of, are to arrow.

    Attributes:
        kind: the arrow type.
        lists: the type of lists of them.
    """

    def __init__(self, kind: Any) -> None:
        import pyarrow as pa

        self._array, self.kind, self.lists = pa.array, kind, pa.list_(kind)
        self._new, self._buffer = pa.Array.from_buffers, pa.py_buffer
        self._size = kind.list_size if pa.types.is_fixed_size_list(kind) else 1
        self._text = pa.types.is_string(kind)
        self._inner = _Kind(kind.value_type) if pa.types.is_list(kind) else None
        self._part = kind.value_type if self._size > 1 else kind
        self._dtype = None if self._text or self._inner else self._part.to_pandas_dtype()

    def elements(self, values: Any, lengths: Sequence[Lengths]) -> Any:
        """Return values as an arrow array; `lengths` of those that are lists themselves."""
        if self._inner is not None:
            return self._inner.listed(self._inner.elements(values, lengths[1:]), lengths[0], self.kind)
        if self._text:
            return self._array(values, self.kind)
        flat = np.ascontiguousarray(values, dtype=self._dtype).reshape(-1)
        parts = self._new(self._part, len(flat), [None, self._buffer(flat)])
        if self._size == 1:
            return parts
        return self._new(self.kind, len(flat) // self._size, [None], children=[parts])

    def listed(self, elements: Any, lengths: Lengths, lists: Any = None) -> Any:
        """Return elements as lists of given lengths."""
        return _cut(lists or self.lists, elements, _ends(len(elements), lengths))


class _Component(_Kind):
    def __init__(self, descriptor: Any, kind: Any) -> None:
        super().__init__(kind)
        self.descriptor = descriptor


@functools.cache
def _component(archetype: str, field: str) -> _Component:
    """Return the kind and the descriptor of a component, as the library says them."""
    import rerun as rr

    (batch,) = getattr(rr, archetype).from_fields(**{field: []}).as_component_batches()
    return _Component(batch.component_descriptor(), batch.as_arrow_array().type)


def _ends(count: int, lengths: Lengths | None = None) -> ShortIntegers:
    """Return where lists end, and 0 before: all `count` elements in one list when there are no lengths."""
    if lengths is None:
        return np.array([0, count], dtype=np.int32)
    if isinstance(lengths, int):
        return np.arange(0, count + 1, lengths, dtype=np.int32)
    ends = np.zeros(len(lengths) + 1, dtype=np.int32)
    np.cumsum(lengths, out=ends[1:])
    return ends


def _one(elements: Any) -> Any:
    import pyarrow as pa

    return _cut(pa.list_(elements.type), elements, _ends(len(elements)))


def _cut(lists: Any, elements: Any, ends: ShortIntegers) -> Any:
    import pyarrow as pa

    assert ends[-1] == len(elements), "lengths must add up to the number of elements"
    return pa.Array.from_buffers(lists, len(ends) - 1, [None, pa.py_buffer(ends)], children=[elements])


def _flat(kind: Any, values: Integers) -> Any:
    import pyarrow as pa

    return pa.Array.from_buffers(kind, len(values), [None, pa.py_buffer(np.ascontiguousarray(values))])
