"""Whether a PLY file is whole, told before its elements are read."""

from __future__ import annotations

from dataclasses import dataclass, field

_SIZES = {
    **dict.fromkeys(("char", "uchar", "int8", "uint8"), 1),
    **dict.fromkeys(("short", "ushort", "int16", "uint16"), 2),
    **dict.fromkeys(("int", "uint", "float", "int32", "uint32", "float32"), 4),
    **dict.fromkeys(("double", "float64"), 8),
}
"""Bytes of each type of number."""

_LONGEST_HEADER = 1 << 16


@dataclass
class _Element:
    """What the header announces: how many there are of a kind, and the fewest bytes of one."""

    name: str
    count: int
    sizes: list[int] = field(default_factory=list)


def check(data: bytes) -> int:
    """Return how many faces a PLY file announces.

    Raises:
        ValueError: it has no whole header, or less than its header announces.
    """
    head, end, body = data.partition(b"end_header")
    if not data.startswith(b"ply") or not end or len(head) > _LONGEST_HEADER:
        raise ValueError("it does not begin with a header from 'ply' to 'end_header'")
    text, elements = _parse(head.decode("ascii", errors="replace"))
    announced = ", ".join(f"{element.name} {element.count}" for element in elements)
    body = body.partition(b"\n")[2]
    if text:
        rows = sum(1 for line in body.splitlines() if line.strip())
        wanted = sum(element.count for element in elements)
        if rows < wanted:
            raise ValueError(f"its header announces {announced}, one a line; {rows} lines follow")
    else:
        least = sum(element.count * sum(element.sizes) for element in elements)
        if len(body) < least:
            raise ValueError(f"its header announces {announced}: {least} bytes or more; {len(body)} bytes follow")
    return next((element.count for element in elements if element.name == "face"), 0)


def _parse(head: str) -> tuple[bool, list[_Element]]:
    """Return whether the body is text, and the elements that follow."""
    text = True
    elements: list[_Element] = []
    for line in head.splitlines()[1:]:
        match line.split():
            case ["format", kind, *_]:
                text = kind == "ascii"
            case ["element", name, count] if count.isdecimal():
                elements.append(_Element(name, int(count)))
            case ["property", "list", size, item, _] if elements and {size, item} <= _SIZES.keys():
                elements[-1].sizes.append(_SIZES[size])
            case ["property", size, _] if elements and size in _SIZES:
                elements[-1].sizes.append(_SIZES[size])
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise ValueError(f"its header holds the line {line.strip()[:60]!r}, which is not of the format")
    return text, elements
