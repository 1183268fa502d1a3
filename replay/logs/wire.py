"""Messages of a fixed length as columns: where each protobuf field's bytes lie, found from one example message.

When all messages of a topic have the same fields with the same encoded lengths, they differ only inside the bytes of
their values. A `MessageShape` holds the bytes that stay (tags, lengths, texts), which bits they are, and a `Slot` for
each value. A block of n messages is then an (n, length) array of bytes: reading or writing one field of all messages
is one NumPy expression, and whether a block really has the shape is one comparison.

Varints are slots as well. A varint of width w holds any value below 2^(7 w): padded with continuation bytes, which
every protobuf decoder accepts, a time stamp has the same length in all messages.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from google.protobuf.descriptor import FieldDescriptor

from replay.errors import InvalidValue
from replay.numerics.arrays import Bytes, Column

_FIXED = {
    FieldDescriptor.TYPE_DOUBLE: "<f8",
    FieldDescriptor.TYPE_FLOAT: "<f4",
    FieldDescriptor.TYPE_FIXED64: "<u8",
    FieldDescriptor.TYPE_FIXED32: "<u4",
    FieldDescriptor.TYPE_SFIXED64: "<i8",
    FieldDescriptor.TYPE_SFIXED32: "<i4",
}
_VARINT = {
    FieldDescriptor.TYPE_INT64: np.int64,
    FieldDescriptor.TYPE_UINT64: np.uint64,
    FieldDescriptor.TYPE_INT32: np.int32,
    FieldDescriptor.TYPE_UINT32: np.uint32,
    FieldDescriptor.TYPE_BOOL: np.bool_,
    FieldDescriptor.TYPE_ENUM: np.int32,
    FieldDescriptor.TYPE_SINT32: np.int32,
    FieldDescriptor.TYPE_SINT64: np.int64,
}
_ZIGZAG = (FieldDescriptor.TYPE_SINT32, FieldDescriptor.TYPE_SINT64)
_MAX_DEPTH = 32
_MAX_SLOTS = 1_000_000  # beyond, a message is a mesh and not a row of readings
_VARINT_BYTES = 10
_WIRE_VARINT, _WIRE_64, _WIRE_LENGTH, _WIRE_32 = 0, 1, 2, 5


class _Irregular(Exception):
    """The example message cannot be laid out as slots."""


@dataclass(frozen=True)
class Slot:
    """The bytes of one field in every message: `count` values of `width` bytes from `offset` on.

    Attributes:
        field_type: the field's protobuf type, a `FieldDescriptor.TYPE_*` number.
        is_array: a packed repeated field; its column is (n, count), otherwise (n,).
    """

    field_type: int
    offset: int
    width: int
    count: int
    is_array: bool

    @property
    def end(self) -> int:
        """Offset of the first byte after the slot."""
        return self.offset + self.width * self.count

    def read(self, rows: Bytes) -> Column:
        """Return the field's values in n messages, a view where the encoding allows it."""
        data = rows[:, self.offset : self.end]
        if self.field_type in _FIXED:
            values: Column = data.view(_FIXED[self.field_type])
        else:
            values = self._read_varints(data)
        return values if self.is_array else values[:, 0]

    def write(self, rows: Bytes, values: Column) -> None:
        """Set the field in n messages; `values` is (n, count) for an array and (n,) for a scalar."""
        values = values if self.is_array else values[:, None]
        data = rows[:, self.offset : self.end]
        if self.field_type in _FIXED:
            data.view(_FIXED[self.field_type])[:] = values
            return
        if values.size and (int(values.max()) >= 1 << 7 * self.width or int(values.min()) < 0):
            raise InvalidValue("field value", int(values.max()), f"must be 0 to {(1 << 7 * self.width) - 1}")
        if self.width == 1:
            data[:] = values
            return
        remaining = values.astype(np.uint64)
        for place in range(self.width):
            more = 0x80 if place < self.width - 1 else 0
            data[:, place :: self.width] = (remaining & np.uint64(0x7F)).astype(np.uint8) | np.uint8(more)
            remaining = remaining >> np.uint64(7)

    def is_like(self, other: Slot) -> bool:
        """Return whether the same values have the same bytes in both."""
        mine, theirs = ((slot.field_type, slot.width, slot.count) for slot in (self, other))
        return mine == theirs

    def copy(self, rows: Bytes, other: Slot) -> None:
        """Set the field in n messages to the values of another one that is like it."""
        rows[:, self.offset : self.end] = rows[:, other.offset : other.end]

    def _read_varints(self, data: Bytes) -> Column:
        if self.width == 1 and self.field_type not in _ZIGZAG:
            narrow: Column = data.astype(_VARINT[self.field_type])
            return narrow
        value = np.zeros((len(data), self.count), dtype=np.uint64)
        for place in range(self.width):
            part = (data[:, place :: self.width] & np.uint8(0x7F)).astype(np.uint64)
            value |= part << np.uint64(7 * place)
        if self.field_type in _ZIGZAG:
            value = (value >> np.uint64(1)) ^ (np.uint64(0) - (value & np.uint64(1)))
        if self.field_type == FieldDescriptor.TYPE_BOOL:
            truth: Column = value != 0
            return truth
        if _VARINT[self.field_type] in (np.int32, np.uint32):
            value = (value & np.uint64(0xFFFFFFFF)).astype(np.uint32)
        return value.view(_VARINT[self.field_type])


@dataclass(frozen=True, eq=False)
class MessageShape:
    """What all messages of a fixed-length topic have in common.

    Attributes:
        skeleton: (length,) the bytes that are the same in every message, 0 where values lie.
        mask: (length,) the bits of `skeleton` that count; of a varint, the bits that say where it ends.
        slots: the values, by path, such as "joints[2].position".
        texts: the texts and byte strings, by path; they are the same in every message.
    """

    skeleton: Bytes
    mask: Bytes
    slots: Mapping[str, Slot]
    texts: Mapping[str, str | bytes]

    @property
    def length(self) -> int:
        """Bytes in one message."""
        return len(self.skeleton)

    def fill(self, rows: Bytes) -> None:
        """Write what all messages have in common into (n, length) bytes; the values follow by `Slot.write`."""
        rows[:] = self.skeleton

    def fits(self, rows: Bytes) -> bool:
        """Return whether all of n messages (n, length) have this shape."""
        return rows.shape[1] == self.length and bool(((rows & self.mask) == self.skeleton).all())


def shape_of(descriptor: Any, example: bytes) -> MessageShape | None:
    """Return the shape of a message (`descriptor`: its protobuf type), or None when it cannot be laid out as slots.

    None: unknown, repeated singular, map or group fields, a field without presence that is left out because it is
    zero, varints of different widths in one array, very many fields, and bytes that are not such a message at all.
    """
    walk = _Walk(example)
    try:
        walk.message(descriptor, 0, len(example), "", 0)
    except (_Irregular, IndexError, UnicodeDecodeError):
        return None
    return MessageShape(walk.skeleton, walk.mask, walk.slots, walk.texts)


class _Walk:
    def __init__(self, data: bytes) -> None:
        self.data = data
        self.skeleton = np.frombuffer(data, dtype=np.uint8).copy()
        self.mask = np.full(len(data), 0xFF, dtype=np.uint8)
        self.slots: dict[str, Slot] = {}
        self.texts: dict[str, str | bytes] = {}
        self._needed: dict[str, frozenset[int]] = {}

    def message(self, descriptor: Any, begin: int, end: int, prefix: str, depth: int) -> None:
        if depth > _MAX_DEPTH:
            raise _Irregular
        seen: dict[int, int] = {}
        at = begin
        while at < end:
            tag, at = self.varint(at)
            field = descriptor.fields_by_number.get(tag >> 3)
            if field is None:
                raise _Irregular
            index = seen.get(field.number, 0)
            if index and not field.is_repeated:
                raise _Irregular
            seen[field.number] = index + 1
            at = self.field(field, tag & 7, at, prefix + field.name, index, depth)
        if at != end:
            raise _Irregular
        if not self.needed(descriptor) <= seen.keys():
            raise _Irregular

    def needed(self, descriptor: Any) -> frozenset[int]:
        """Return the fields of a message type that are left out only where they are zero."""
        found = self._needed.get(descriptor.full_name)
        if found is None:
            plain = (field for field in descriptor.fields if not field.is_repeated and not field.has_presence)
            self._needed[descriptor.full_name] = found = frozenset(field.number for field in plain)
        return found

    def field(self, field: FieldDescriptor, wire: int, at: int, path: str, index: int, depth: int) -> int:
        if wire == _WIRE_LENGTH:
            length, at = self.varint(at)
            end = at + length
            if end > len(self.data):
                raise _Irregular
            if field.type == FieldDescriptor.TYPE_MESSAGE:
                assert field.message_type is not None
                if field.message_type.GetOptions().map_entry:
                    raise _Irregular
                inner = f"{path}[{index}]." if field.is_repeated else f"{path}."
                self.message(field.message_type, at, end, inner, depth + 1)
            elif field.type in (FieldDescriptor.TYPE_STRING, FieldDescriptor.TYPE_BYTES):
                data = self.data[at:end]
                text = data.decode() if field.type == FieldDescriptor.TYPE_STRING else data
                self.texts[f"{path}[{index}]" if field.is_repeated else path] = text
            else:
                self.packed(field, at, end, path, index)
            return end
        width = self.width(field, wire, at)
        self.add(f"{path}[{index}]" if field.is_repeated else path, Slot(field.type, at, width, 1, False))
        return at + width

    def packed(self, field: FieldDescriptor, at: int, end: int, path: str, index: int) -> None:
        if not field.is_repeated or index or at == end:
            raise _Irregular
        if field.type in _FIXED:
            width = np.dtype(_FIXED[field.type]).itemsize
        else:
            last = np.flatnonzero(np.frombuffer(self.data, dtype=np.uint8)[at:end] < 0x80)  # bytes of the varints
            width = int(last[0]) + 1 if len(last) else 0
            if not 0 < width <= _VARINT_BYTES or not np.array_equal(np.diff(last), np.full(len(last) - 1, width)):
                raise _Irregular
        if (field.type not in _VARINT and field.type not in _FIXED) or (end - at) % width:
            raise _Irregular
        self.add(path, Slot(field.type, at, width, (end - at) // width, True))

    def width(self, field: FieldDescriptor, wire: int, at: int) -> int:
        if wire == _WIRE_VARINT and field.type in _VARINT:
            return self.varint(at)[1] - at
        if wire in (_WIRE_64, _WIRE_32) and field.type in _FIXED:
            width = np.dtype(_FIXED[field.type]).itemsize
            if width == (8 if wire == _WIRE_64 else 4) and at + width <= len(self.data):
                return width
        raise _Irregular

    def varint(self, at: int) -> tuple[int, int]:
        value = 0
        for place in range(_VARINT_BYTES):
            byte = self.data[at + place]
            value |= (byte & 0x7F) << 7 * place
            if byte < 0x80:
                return value, at + place + 1
        raise _Irregular

    def add(self, path: str, slot: Slot) -> None:
        if len(self.slots) >= _MAX_SLOTS:
            raise _Irregular
        self.slots[path] = slot
        keep = 0x80 if slot.field_type in _VARINT else 0
        self.mask[slot.offset : slot.end] = keep
        self.skeleton[slot.offset : slot.end] &= np.uint8(keep)
