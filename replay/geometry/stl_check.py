"""Whether an STL file is whole, told before its triangles are read; and those of a binary one."""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from replay import limits
from replay.numerics.arrays import Floats, Integers

_HEADER = 84  # bytes
_FACET = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_KEYWORDS = re.compile(rb"^[ \t]*(solid|endsolid|facet|endfacet|vertex)\b", re.MULTILINE | re.IGNORECASE)


def check(data: bytes) -> int:
    """Return how many triangles a binary or text STL file announces.

    Raises:
        ValueError: a binary file is not as long as its header says; the parts of a text file do not fit together.
    """
    triangles = _announced(data)
    needed = _HEADER + _FACET.itemsize * triangles
    if is_binary(data):
        _check_count(triangles)
        return triangles
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        return _check_text(data)
    if len(data) < _HEADER:
        raise ValueError(f"its header is cut; the file has {len(data)} bytes")
    raise ValueError(f"its header announces {triangles} triangles, which need {needed} bytes; the file has {len(data)}")


def is_binary(data: bytes) -> bool:
    """Return whether a file is as long as a binary one with its header, which may begin with "solid" too.

    What follows the triangles is none where it is shorter than one, or zeros alone, as transfers in blocks leave them.
    """
    triangles = _announced(data)
    end = _HEADER + _FACET.itemsize * triangles
    more = len(data) - end
    return more == 0 or (triangles > 0 and more > 0 and (more < _FACET.itemsize or not any(data[end:])))


def triangles(data: bytes) -> tuple[Floats, Integers]:
    """Return the vertices (3 n, 3) and triangles (n, 3) of a binary file, corner by corner."""
    corners = np.frombuffer(data, dtype=_FACET, offset=_HEADER, count=_announced(data))["corners"]
    with np.errstate(invalid="ignore"):  # NaN that signals
        return corners.reshape(-1, 3).astype(np.float64), np.arange(3 * len(corners)).reshape(-1, 3)


def _announced(data: bytes) -> int:
    return int.from_bytes(data[80:_HEADER], "little")


def _check_count(triangles: int) -> None:
    if triangles > limits.TRIANGLES:
        raise ValueError(f"it holds {triangles} triangles; at most {limits.TRIANGLES} are read")


def _check_text(data: bytes) -> int:
    _check_count(max(data.lower().count(b"vertex") // 3, data.lower().count(b"facet") // 2))
    counts = Counter(found[1].lower() for found in _KEYWORDS.finditer(data))
    facets, vertices = counts[b"facet"], counts[b"vertex"]
    if counts[b"solid"] != counts[b"endsolid"] or counts[b"endfacet"] != facets or vertices != 3 * facets:
        found = ", ".join(f"{count} {word.decode()}" for word, count in sorted(counts.items()))
        raise ValueError(f"its text is cut or damaged: it has {found}")
    return facets
