"""Whether an STL file is whole, told before its triangles are read."""

from __future__ import annotations

import re
from collections import Counter

from replay import limits

_KEYWORDS = re.compile(rb"^[ \t]*(solid|endsolid|facet|endfacet|vertex)\b", re.MULTILINE | re.IGNORECASE)


def check(data: bytes) -> int:
    """Return how many triangles a binary or text STL file announces.

    Raises:
        ValueError: a binary file is not as long as its header says; the parts of a text file do not fit together.
    """
    triangles = int.from_bytes(data[80:84], "little")
    needed = 84 + 50 * triangles
    if len(data) == needed:
        _check_count(triangles)
        return triangles  # the header of a binary file may begin with "solid" too
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        return _check_text(data)
    if len(data) < 84:
        raise ValueError(f"its header is cut; the file has {len(data)} bytes")
    raise ValueError(f"its header announces {triangles} triangles, which need {needed} bytes; the file has {len(data)}")


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
