"""A part as YAML that people read and change: one line a joint, one a shape, and what was changed as comments."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from replay.errors import printable
from replay.robots.description import RobotChange
from replay.robots.part import RobotPart

_PLAIN = re.compile(r"[A-Za-z_][A-Za-z0-9_./\-]*")
_NOT_TEXT = ("null", "true", "false", "yes", "no", "on", "off", "y", "n")
"""Words that some version of YAML takes for something else than text."""


def text(part: RobotPart, head: Iterable[str], changes: Iterable[RobotChange]) -> str:
    """Return the YAML of a part, below comments with where it comes from and what was changed."""
    lines = [*(f"# {printable(line)}" for line in head)]
    told = [f"#   {printable(str(change))}" for change in changes]
    lines += ["# What is not as the description says:", *told] if told else []
    lines += ["links:", *_links(part.links)]
    if part.poses:
        lines += ["poses:", *(f"  {_scalar(name)}: {flow(pose)}" for name, pose in part.poses.items())]
    if part.disabled:
        lines += ["collision:", "  disable:"]
        lines += [f"    - {disable_line(*entry)}" for entry in part.disabled]
    return "\n".join(lines) + "\n"


def disable_line(a: str, b: str, reason: str) -> str:
    """Return an entry of `collision.disable`."""
    return f"{{pair: [{_scalar(a)}, {_scalar(b)}], reason: {_scalar(reason)}}}"


def _links(links: Mapping[str, Mapping[str, Any]]) -> Iterator[str]:
    for name, entry in links.items():
        if not entry:
            yield f"  {_scalar(name)}: {{}}"
            continue
        yield f"  {_scalar(name)}:"
        for key, value in entry.items():
            if key == "shapes":
                yield "    shapes:"
                yield from (f"      {_scalar(shape)}: {flow(body)}" for shape, body in value.items())
            else:
                yield f"    {key}: {flow(value)}"


def flow(value: Any) -> str:
    """Return a value in one line of YAML."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{_scalar(key)}: {flow(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(flow, value)) + "]"
    return _scalar(value)


def _scalar(value: str | float) -> str:
    """Return a name, text or number; each number reads back as the same double."""
    if isinstance(value, str):
        plain = _PLAIN.fullmatch(value) is not None and value.lower() not in _NOT_TEXT
        return value if plain else json.dumps(value, ensure_ascii=False)
    if math.isinf(value):
        return ".inf" if value > 0.0 else "-.inf"
    return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
