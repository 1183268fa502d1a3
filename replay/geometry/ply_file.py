"""PLY files: vertices, polygons and triangle strips, as the header describes them; everything else is passed over."""

from __future__ import annotations

from typing import Final

import numpy as np

from replay import limits
from replay.geometry.ply_numbers import BinaryNumbers, Columns, Element, Lists, Property, TextNumbers, columns_of
from replay.geometry.polygons import triangulate
from replay.numerics.arrays import Floats, Integers

_TYPES: Final = {
    **dict.fromkeys(("char", "int8"), "i1"),
    **dict.fromkeys(("uchar", "uint8"), "u1"),
    **dict.fromkeys(("short", "int16"), "i2"),
    **dict.fromkeys(("ushort", "uint16"), "u2"),
    **dict.fromkeys(("int", "int32"), "i4"),
    **dict.fromkeys(("uint", "uint32"), "u4"),
    **dict.fromkeys(("float", "float32"), "f4"),
    **dict.fromkeys(("double", "float64"), "f8"),
}
_ORDERS: Final = {"ascii": "", "binary_little_endian": "<", "binary_big_endian": ">"}
_CORNERS: Final = ("vertex_index", "vertex_indices")
"""What files call the corners of a face."""

_LONGEST_HEADER = 1 << 16
_LONGEST_COUNT = 18  # digits


def read(data: bytes) -> tuple[Floats, Integers]:
    """Return the vertices (v, 3) and the triangles (f, 3) of a PLY file; polygons are split, see `polygons`.

    Raises:
        ValueError: it has no whole header, less than its header announces, or a face of fewer than three corners.
    """
    head, end, body = data.partition(b"end_header")
    if not data.startswith(b"ply") or not end or len(head) > _LONGEST_HEADER:
        raise ValueError("it does not begin with a header from 'ply' to 'end_header'")
    order, elements = _parse(head.decode("ascii", errors="replace"))
    announced = ", ".join(f"{element.name} {element.count}" for element in elements)
    old_mac = body.startswith(b"\r") and not body.startswith(b"\r\n")  # whose lines end so
    body = body[1:] if old_mac else body.partition(b"\n")[2]
    source: TextNumbers | BinaryNumbers = BinaryNumbers(body, announced)
    if order:
        least = sum(element.count * element.least for element in elements)
        if len(body) < least:
            raise ValueError(f"its header announces {announced}: {least} bytes or more; {len(body)} bytes follow")
    else:
        if body.count(b"\n") + body.count(b"\r") > 4 * limits.TRIANGLES:
            raise ValueError(f"it has more than the {4 * limits.TRIANGLES} lines that are read")
        rows = sum(1 for line in body.splitlines() if line.strip())
        if rows < sum(element.count for element in elements):
            raise ValueError(f"its header announces {announced}, one a line; {rows} lines follow")
    for element in elements:
        if element.count > limits.TRIANGLES:
            rule = f"its header announces {element.name[:60]} {element.count}"
            raise ValueError(f"{rule}; at most {limits.TRIANGLES} of an element are read")
    if not order:
        source = TextNumbers(body, announced)
    columns = [(element, columns_of(element, source)) for element in elements]
    points, triangles = np.zeros((0, 3)), [np.zeros((0, 3), np.int64)]
    for element, found in columns:
        if element.name == "vertex" and element.count:
            missing = [axis for axis in "xyz" if not isinstance(found.get(axis), np.ndarray)]
            if missing:
                raise ValueError(f"its vertices have no {missing[0]}")
            points = np.stack([np.asarray(found[axis], dtype=np.float64) for axis in "xyz"], axis=1)
    for element, found in columns:
        if element.name in ("face", "tristrips") and element.count:
            split = _polygons if element.name == "face" else _strips
            triangles.append(split(points, _corners(element, found)))
    return points, np.concatenate(triangles)


def _parse(head: str) -> tuple[str, list[Element]]:
    """Return the byte order ("" of text), and the elements that follow."""
    order = ""
    elements: list[Element] = []
    for line in head.splitlines()[1:]:
        match line.split():
            case ["format", kind, *_] if kind in _ORDERS:
                order = _ORDERS[kind]
            case ["element", name, count] if count.isdecimal() and len(count) <= _LONGEST_COUNT:
                elements.append(Element(name, int(count)))
            case ["property", "list", size, item, name] if elements and {size, item} <= _TYPES.keys():
                length = np.dtype(order + _TYPES[size])
                elements[-1].properties.append(Property(name, np.dtype(order + _TYPES[item]), length))
            case ["property", item, name] if elements and item in _TYPES:
                elements[-1].properties.append(Property(name, np.dtype(order + _TYPES[item]), None))
            case ["comment" | "obj_info", *_] | []:
                pass
            case _:
                raise ValueError(f"its header holds the line {line.strip()[:60]!r}, which is not of the format")
    return order, elements


def _corners(element: Element, found: Columns) -> Lists:
    named = [found[name] for name in _CORNERS if name in found]
    lists = [column for column in (*named, *found.values()) if isinstance(column, Lists)]
    if not lists:
        raise ValueError(f"its element {element.name} has no list of corners")
    return lists[0]


def _polygons(points: Floats, corners: Lists) -> Integers:
    if corners.lengths.min() < 3:
        raise ValueError(f"face {int(np.argmax(corners.lengths < 3)) + 1} has fewer than three corners")
    return triangulate(points, corners.values.astype(np.int64), corners.lengths)


def _strips(_points: Floats, corners: Lists) -> Integers:
    """Return the triangles of strips, every second one turned; -1 ends a strip within a list."""
    found = [np.zeros((0, 3), np.int64)]
    for strip in np.split(corners.values.astype(np.int64), np.cumsum(corners.lengths)[:-1]):
        for run in np.split(strip, np.flatnonzero(strip == -1)):
            run = run[run != -1]
            triangles = np.stack([run[:-2], run[1:-1], run[2:]], axis=1) if len(run) > 2 else found[0]
            triangles[1::2] = triangles[1::2, [1, 0, 2]]
            found.append(triangles)
    result = np.concatenate(found)
    a, b, c = result.T
    kept: Integers = result[(a != b) & (b != c) & (c != a)]  # a corner given twice turns the strip, no more
    return kept
