"""What a COLLADA file says and pycollada reads as something else without a word: found in its text, and refused."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from replay.numerics.arrays import Floats

UP = ("X_UP", "Y_UP", "Z_UP")
"""What may point up."""

_NUMBER = re.compile(r"\s*[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\s*")
_LONG = re.compile(r"\d{10}")  # beyond 2^31 numbers begin again, and more than a billion corners are never read


def asset(root: Any) -> tuple[float, str]:
    """Return metres per unit, and which axis points up; pycollada takes 1 and Y_UP for what it does not know.

    Args:
        root: the file's root element.

    Raises:
        ValueError: the unit is no number, or the axis none.
    """
    unit, up = 1.0, "Y_UP"
    for held in (child for found in _all(root, "asset") for child in found):
        if _tag(held) == "unit":
            meter = held.get("meter", "1")
            if not _NUMBER.fullmatch(meter):
                raise ValueError(f"its unit has meter={meter[:40]!r}, which is no number")
            unit = float(meter)
        elif _tag(held) == "up_axis":
            up = (held.text or "").strip()
            if up not in UP:
                raise ValueError(f"its <up_axis> is {up[:40]!r}; there are {', '.join(UP)}")
    return unit, up


def check_primitive(primitive: Any) -> None:
    """Refuse triangles or polygons of which pycollada would leave some out, or take other corners.

    Args:
        primitive: a set of them, as pycollada has read it.

    Raises:
        ValueError: with what is there.
    """
    element = primitive.xmlnode
    if next(_all(element, "ph"), None) is not None:
        raise ValueError("a polygon has a hole (<ph>), which is not read")
    count = element.get("count", "")
    if _tag(element) in ("triangles", "polylist") and count.isdecimal() and len(primitive) < int(count):
        raise ValueError(f"<{_tag(element)}> has count={count[:20]!r}, of which {len(primitive)} are there")
    if hasattr(primitive, "vcounts"):  # what pycollada makes of more corners than there are grows with their number
        wanted, there = int(np.sum(primitive.vcounts, dtype=np.int64)), len(primitive.index)
        if wanted != there:
            raise ValueError(f"the polygons of a <{_tag(element)}> have {wanted} corners, of which {there} are there")
    for indices in _all(element, "p"):
        found = _LONG.search(indices.text or "")
        if found:
            raise ValueError(f"a triangle refers to vertex {found[0]}..., which cannot be")


def corners_of(primitive: Any) -> Floats:
    """Return the corners (v, 3) that triangles refer to, NaN where the file has that: pycollada makes it 0.

    Raises:
        ValueError: they lie in the file with something between them, which pycollada takes for corners.
    """
    corners = np.array(primitive.vertex, dtype=np.float64)
    source = primitive.sources["VERTEX"][0][4].xmlnode
    for technique in _all(source, "technique_common"):
        for accessor in _all(technique, "accessor"):
            stride, offset = accessor.get("stride", "3"), accessor.get("offset", "0")
            if (stride.strip(), offset.strip()) != ("3", "0"):
                rule = f"its corners have stride={stride[:20]!r} and offset={offset[:20]!r}; 3 and 0 are read"
                raise ValueError(rule)
    for array in _all(source, "float_array"):
        if "nan" in (array.text or "").lower():
            values = np.array([float("nan" in word.lower()) for word in array.text.split()])
            corners.reshape(-1)[values[: corners.size] > 0.0] = np.nan
    return corners


def _all(element: Any, tag: str) -> Iterator[Any]:
    return (child for child in element if _tag(child) == tag)


def _tag(element: Any) -> str:
    return str(element.tag).rpartition("}")[2]
