"""ROS messages from bytes: ROS 1, CDR in either byte order, and XCDR2 as newer DDS write it.

Every value is read within the bytes that are there, and a message must be used up by its definition: one that is not
is no message of that type, whatever its channel says.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any

from replay.logs.ros_schema import Field, Types

_CODES = {
    "bool": "?",
    "byte": "B",
    "char": "B",
    "int8": "b",
    "uint8": "B",
    "octet": "B",
    "int16": "h",
    "uint16": "H",
    "int32": "i",
    "uint32": "I",
    "int64": "q",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
}
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


def decode_ros1(types: Types, name: str, data: bytes) -> dict[str, Any]:
    """Return a ROS 1 message's values by field; ValueError when it is none of that type."""
    return _whole(types, name, data, 0, ROS1, 0)


def decode_cdr(types: Types, name: str, data: bytes) -> dict[str, Any]:
    """Return a ROS 2 message's values by field; ValueError when it is none of that type, or of another encoding."""
    if len(data) < 4:
        raise ValueError(f"it has {len(data)} bytes, less than CDR begins with")
    kind = int.from_bytes(data[:2], "big")
    if kind in (0, 1):
        return _whole(types, name, data, 4, Encoding("<" if kind else ">", 8, terminated=True), _PADDING)
    if kind not in _XCDR2:
        raise ValueError(f"its encoding 0x{kind:04x} is neither CDR nor plain or delimited XCDR2")
    order, sized = _XCDR2[kind]
    try:
        return _whole(types, name, data, 4, Encoding(order, 4, True, sized, sequence_size=True), _PADDING)
    except ValueError:  # some writers leave out the size before a sequence of texts, which the standard asks for
        return _whole(types, name, data, 4, Encoding(order, 4, True, sized, sequence_size=False), _PADDING)


def _whole(types: Types, name: str, data: bytes, begin: int, encoding: Encoding, padding: int) -> dict[str, Any]:
    reader = _Reader(types, data, begin, encoding)
    try:
        message = reader.struct(name, 0)
    except struct.error:
        raise ValueError("it ends inside a value") from None
    except UnicodeDecodeError:
        raise ValueError("it holds a text that is not UTF-8") from None
    if len(data) - reader.at > padding:
        raise ValueError(f"it has {len(data) - reader.at} bytes more than its definition")
    return message


class _Reader:
    """Reads values one after another; alignment counts from the first one."""

    def __init__(self, types: Types, data: bytes, begin: int, encoding: Encoding) -> None:
        self.at = begin
        self._types = types
        self._data = data
        self._begin = begin
        self._encoding = encoding

    def struct(self, name: str, depth: int) -> dict[str, Any]:
        """Return the values of the message type `name`."""
        if depth > _MAX_DEPTH:
            raise ValueError("its definition is nested too deeply")
        if self._encoding.align == 1 and name in _ROS1_TIMES:
            return dict(zip(("sec", "nanosec"), self._numbers(_ROS1_TIMES[name], 4), strict=True))
        if name not in self._types:
            raise ValueError(f"its definition does not describe {name}")
        end = self._size() if self._encoding.struct_size else None
        values = {field.name: self._field(field, depth) for field in self._types[name]}
        self._check(end)
        return values

    def _field(self, field: Field, depth: int) -> Any:
        if not field.array:
            return self._value(field.type, depth)
        if field.type in _CODES:
            count = field.count or self._count()
            code = _CODES[field.type]
            width = struct.calcsize(f"={code}")
            if count * width > len(self._data) - self.at:
                raise ValueError(f"field {field.name} claims {count} values, more than it holds")
            return list(self._numbers(f"{count}{code}", width)) if count else []
        end = self._size() if self._encoding.sequence_size else None
        count = field.count or self._count()
        if count > len(self._data) - self.at:
            raise ValueError(f"field {field.name} claims {count} values, more than it holds")
        values = [self._value(field.type, depth) for _ in range(count)]
        self._check(end)
        return values

    def _value(self, kind: str, depth: int) -> Any:
        if kind in _CODES:
            code = _CODES[kind]
            return self._numbers(code, struct.calcsize(f"={code}"))[0]
        if kind == "string":
            return self._text()
        if kind in ("wstring", "wchar", "float128"):
            raise ValueError(f"it holds a {kind}, which is not read")
        return self.struct(kind, depth + 1)

    def _numbers(self, code: str, width: int) -> tuple[Any, ...]:
        self._align(width)
        values = struct.unpack_from(self._encoding.order + code, self._data, self.at)
        self.at += struct.calcsize(self._encoding.order + code)
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
        return int(self._numbers("I", 4)[0])

    def _size(self) -> int:
        size = self._count()
        return self.at + size

    def _check(self, end: int | None) -> None:
        if end is not None and self.at != end:
            raise ValueError("a size that it states is not that of what follows")

    def _align(self, width: int) -> None:
        step = min(width, self._encoding.align)
        self.at += -(self.at - self._begin) % step
