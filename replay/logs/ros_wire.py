"""ROS messages from bytes: ROS 1, CDR in either byte order, and XCDR2 as newer DDS write it.

Every value is read within the bytes that are there, and a message must be used up by its definition: one that is not
is no message of that type, whatever its channel says.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

from replay import limits
from replay.logs.ros_schema import RosField, Types

_CODES = {
    "bool": ("?", 1),
    "byte": ("B", 1),
    "char": ("B", 1),
    "int8": ("b", 1),
    "uint8": ("B", 1),
    "octet": ("B", 1),
    "int16": ("h", 2),
    "uint16": ("H", 2),
    "int32": ("i", 4),
    "uint32": ("I", 4),
    "int64": ("q", 8),
    "uint64": ("Q", 8),
    "float32": ("f", 4),
    "float64": ("d", 8),
}
"""Code in `struct` and size [bytes] of the base types."""
_ROS1_TIMES = {"builtin_interfaces/msg/Time": "II", "builtin_interfaces/msg/Duration": "ii"}
_MAX_DEPTH = 16
_PADDING = 3
"""Bytes that may follow the last value: CDR pads to 4."""


@dataclass(frozen=True)
class Encoding:
    """How values stand one after another.

    Attributes:
        order: "<" or ">".
        align: largest alignment [bytes]; 1 for none.
        terminated: whether texts end in a zero byte that their length counts.
        struct_size, sequence_size: whether a size stands before each struct, before each sequence of what is no number.
    """

    order: str
    align: int
    terminated: bool
    struct_size: bool = False
    sequence_size: bool = False


ROS1 = Encoding("<", 1, terminated=False)
_XCDR2 = {6: (">", False), 7: ("<", False), 8: (">", True), 9: ("<", True)} | {
    16: (">", False),
    17: ("<", False),
    20: (">", True),
    21: ("<", True),
}
"""Byte order, and whether structs have sizes, by representation; those of XTypes 1.3 and of 1.2."""


Memo = dict[tuple[str, int, Encoding], tuple[bytes, list[str]]]
"""Sequences of texts as they stood in the message before, by field, alignment and encoding: they hardly ever change."""


def decode_ros1(types: Types, name: str, data: bytes, memo: Memo | None = None) -> dict[str, Any]:
    """Return a ROS 1 message's values by field; ValueError when it is none of that type."""
    return _whole(types, name, data, 0, ROS1, 0, memo)


def decode_cdr(types: Types, name: str, data: bytes, memo: Memo | None = None) -> dict[str, Any]:
    """Return a ROS 2 message's values by field; ValueError when it is none of that type, or of another encoding."""
    if len(data) < 4:
        raise ValueError(f"it has {len(data)} bytes, less than CDR begins with")
    kind = int.from_bytes(data[:2], "big")
    if kind in (0, 1):
        return _whole(types, name, data, 4, Encoding("<" if kind else ">", 8, terminated=True), _PADDING, memo)
    if kind not in _XCDR2:
        raise ValueError(f"its encoding 0x{kind:04x} is neither CDR nor plain or delimited XCDR2")
    order, sized = _XCDR2[kind]
    try:
        return _whole(types, name, data, 4, Encoding(order, 4, True, sized, sequence_size=True), _PADDING, memo)
    except ValueError:  # some writers leave out the size before a sequence of texts, which the standard asks for
        return _whole(types, name, data, 4, Encoding(order, 4, True, sized, sequence_size=False), _PADDING, memo)


def _whole(
    types: Types, name: str, data: bytes, begin: int, encoding: Encoding, padding: int, memo: Memo | None
) -> dict[str, Any]:
    reader = _WireReader(types, data, begin, encoding, {} if memo is None else memo)
    try:
        message = reader.struct(name, 0)
    except struct.error:
        raise ValueError("it ends inside a value") from None
    except UnicodeDecodeError:
        raise ValueError("it holds a text that is not UTF-8") from None
    if len(data) - reader.at > padding:
        raise ValueError(f"it has {len(data) - reader.at} bytes more than its definition")
    return message


class _WireReader:
    """Reads values one after another; alignment counts from the first one."""

    def __init__(self, types: Types, data: bytes, begin: int, encoding: Encoding, memo: Memo) -> None:
        self.at = begin
        self._types = types
        self._data = data
        self._begin = begin
        self._encoding = encoding
        self._memo = memo
        # a struct without fields takes no byte, and one may hold many of many
        self._left = min(len(data) + 1000, limits.MESSAGE_VALUES)
        self._unsigned = struct.Struct(f"{encoding.order}I").unpack_from
        self._step = min(4, encoding.align) - 1

    def struct(self, name: str, depth: int) -> dict[str, Any]:
        """Return the values of the message type `name`."""
        self._left -= 1
        if depth > _MAX_DEPTH or self._left < 0:
            raise ValueError("its definition is nested too deeply, or holds too much of nothing")
        if self._encoding.align == 1 and name in _ROS1_TIMES:
            return dict(zip(("sec", "nanosec"), self._numbers(_ROS1_TIMES[name], 4), strict=True))
        if name not in self._types:
            raise ValueError(f"its definition does not describe {name}")
        end = self._size() if self._encoding.struct_size else None
        values = {field.name: self._field(field, depth) for field in self._types[name]}
        self._check(end)
        return values

    def _field(self, field: RosField, depth: int) -> Any:
        if not field.array:
            return self._value(field.type, depth)
        if field.type in _CODES:
            count = field.count or self._count()
            code, width = _CODES[field.type]
            if count * width > len(self._data) - self.at:
                raise ValueError(f"field {field.name} claims {count} values, more than it holds")
            return list(self._numbers(f"{count}{code}", width)) if count else []
        begin = self.at
        key = (field.name, (begin - self._begin) % 8, self._encoding)
        known = self._memo.get(key)
        if known is not None and self._data.startswith(known[0], begin):
            self.at += len(known[0])
            return known[1]
        end = self._size() if self._encoding.sequence_size else None
        count = field.count or self._count()
        if count > len(self._data) - self.at:
            raise ValueError(f"field {field.name} claims {count} values, more than it holds")
        values = [self._value(field.type, depth) for _ in range(count)]
        self._check(end)
        if field.type == "string":
            self._memo[key] = (self._data[begin : self.at], values)
        return values

    def _value(self, kind: str, depth: int) -> Any:
        if kind in _CODES:
            return self._numbers(*_CODES[kind])[0]
        if kind == "string":
            return self._text()
        if kind in ("wstring", "wchar", "float128"):
            raise ValueError(f"it holds a {kind}, which is not read")
        return self.struct(kind, depth + 1)

    def _numbers(self, code: str, width: int) -> tuple[Any, ...]:
        self.at += -(self.at - self._begin) & (min(width, self._encoding.align) - 1)
        values = struct.unpack_from(self._encoding.order + code, self._data, self.at)
        self.at += width * len(values)
        return values

    def _text(self) -> str:
        size = self._count()
        if size > len(self._data) - self.at:
            raise ValueError(f"a text claims {size} bytes, more than it holds")
        data = self._data[self.at : self.at + size]
        self.at += size
        if self._encoding.terminated and size:
            if data[-1]:
                raise ValueError("a text does not end in a zero byte")
            data = data[:-1]
        return data.decode()

    def _count(self) -> int:
        at = self.at + (-(self.at - self._begin) & self._step)
        self.at = at + 4
        (count,) = self._unsigned(self._data, at)
        return int(count)

    def _size(self) -> int:
        size = self._count()
        return self.at + size

    def _check(self, end: int | None) -> None:
        if end is not None and self.at != end:
            raise ValueError("a size that it states is not that of what follows")
