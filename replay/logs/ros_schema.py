"""ROS message definitions, as `.msg` or IDL text, to the fields that stand on the wire, in their order.

The texts are parsed by `rosbags`; nothing of a log is ever executed.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from replay import limits

_NESTED = re.compile(r"(?:<[^<>;]*){5}")
"""Types within types, which take the parser twice the time with each level; ROS has one level."""
_IDL_SEPARATOR = "=" * 80 + "\n"


@dataclass(frozen=True)
class RosField:
    """A field of a message.

    Attributes:
        name: as written.
        type: a base type such as "float64" or "string", or the name of a message type.
        count: 1 for a single value, 0 for a sequence, or the size of an array.
        array: whether it is an array or a sequence.
    """

    name: str
    type: str
    count: int
    array: bool


_BUILT_IN = {
    f"builtin_interfaces/msg/{kind}": (RosField("sec", "int32", 1, False), RosField("nanosec", "uint32", 1, False))
    for kind in ("Time", "Duration")
}
"""What definitions may refer to without describing it."""

Types = Mapping[str, tuple[RosField, ...]]
"""Fields by the name of the message type, such as "std_msgs/msg/Header"."""


def long_name(name: str) -> str:
    """Return a type's name in ROS 2's form: `sensor_msgs/JointState` is `sensor_msgs/msg/JointState`."""
    package, _, rest = name.replace("::", "/").partition("/")
    return f"{package}/{rest if '/' in rest else f'msg/{rest}'}"


class _CountedText(str):
    """A text that is not looked at without end."""

    __slots__ = ("_looks",)
    _looks: int

    def __new__(cls, text: str) -> _CountedText:
        made = super().__new__(cls, text)
        made._looks = 0
        return made

    def startswith(self, *arguments: Any) -> bool:
        self._looks += 1
        if self._looks > limits.DEFINITION_STEPS:
            raise ValueError("its types are nested too deeply")
        return super().startswith(*arguments)


@functools.lru_cache(maxsize=64)
def types_of(name: str, text: str, *, ros1: bool = False) -> Types:
    """Return the types that a definition of message `name` describes; some logs call `.msg` text IDL, and are read.

    What it refers to without describing it is taken from ROS's own types.

    Args:
        name: of the type, in ROS 1's or ROS 2's form.
        text: the definition.
        ros1: whose types stand for what is missing: ROS 1's `Header` has one field more.

    Raises:
        ValueError: the text is no definition, or does not describe that message.
    """
    from rosbags.typesys import TypesysError, get_types_from_idl, get_types_from_msg

    own = long_name(name)
    if _NESTED.search(text):
        raise ValueError(f"its definition of {name} cannot be read: its types are nested too deeply")
    text = "".join(
        line for line in text.splitlines(keepends=True) if line.strip() and not line.lstrip().startswith("#")
    )
    try:
        if re.search(r"^[ \t]*module\s+\w+", text, re.MULTILINE):
            parts = text.split(_IDL_SEPARATOR)
            bodies = [
                re.sub(r"\A\s*IDL: .*\n|^[ \t]*#.*$", "", part, flags=re.MULTILINE) for part in parts if part.strip()
            ]
            found = {key: value for body in bodies for key, value in get_types_from_idl(_CountedText(body)).items()}
        else:
            found = get_types_from_msg(text, own)
    except (TypesysError, ValueError, KeyError, IndexError, AssertionError, RecursionError) as error:
        told = str(error).partition("\n")[0].rstrip(":") or type(error).__name__
        raise ValueError(f"its definition of {name} cannot be read: {told}") from None
    if own not in found:
        raise ValueError(f"its definition does not describe {name}, but {', '.join(sorted(found)) or 'nothing'}")
    types = _BUILT_IN | _fields(found)
    if any("/" in field.type and field.type not in types for fields in types.values() for field in fields):
        return {**standard_types(ros1=ros1), **types}
    return types


@functools.cache
def standard_types(*, ros1: bool = False) -> Types:
    """Return ROS's own types, for bags that carry no definitions."""
    from rosbags.typesys import Stores, get_typestore

    return _fields(get_typestore(Stores.ROS1_NOETIC if ros1 else Stores.ROS2_HUMBLE).fielddefs)


def _fields(found: Mapping[str, Any]) -> dict[str, tuple[RosField, ...]]:
    from rosbags.interfaces import Nodetype

    def field(name: str, description: tuple[Any, Any]) -> RosField:
        kind, what = description
        if kind == Nodetype.BASE:
            return RosField(name, what[0], 1, False)
        if kind == Nodetype.NAME:
            return RosField(name, what, 1, False)
        inner, count = what
        return RosField(name, field(name, inner).type, count if kind == Nodetype.ARRAY else 0, True)

    return {key: tuple(field(*entry) for entry in value[1]) for key, value in found.items()}
