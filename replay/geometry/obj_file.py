"""Wavefront OBJ files: vertices and faces; everything else in them has no place in a body."""

from __future__ import annotations

import io
from array import array
from collections.abc import Iterator

import numpy as np

from replay import limits
from replay.geometry.polygons import triangulate
from replay.numerics.arrays import Floats, Integers


def read(data: bytes) -> tuple[Floats, Integers]:
    """Return the vertices (v, 3) and the triangles (f, 3) of an OBJ file.

    Polygons are split, see `polygons`. Groups, objects, normals, textures, colours, materials, points and lines are
    passed over.

    Raises:
        ValueError: a vertex or a face is not as the format says; with its line.
    """
    vertices, corners = array("d"), array("q")
    lengths = array("q")  # corners of each face
    for number, line in _lines(data):
        words = line.partition("#")[0].split()
        if not words or words[0] not in ("v", "f"):
            continue
        try:
            if words[0] == "v":
                x, y, z = map(float, words[1:4])
                vertices.extend((x, y, z))
                if len(vertices) > 3 * limits.TRIANGLES:
                    raise _TooMany(f"it has more than the {limits.TRIANGLES} vertices that are read")
                continue
            polygon = [_index(word, len(vertices) // 3) for word in words[1:]]
            if len(polygon) < 3:
                raise ValueError("a face needs three corners")
            corners.extend(polygon)
            lengths.append(len(polygon))
            if len(corners) - 2 * len(lengths) > limits.TRIANGLES:
                raise _TooMany(f"it has more than the {limits.TRIANGLES} triangles that are read")
        except _TooMany:
            raise
        except (ValueError, OverflowError):
            what = "three numbers" if words[0] == "v" else "three or more vertices, counted from 1"
            raise ValueError(f"line {number}, {line.strip()[:60]!r}, does not name {what}") from None
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    if len(corners) and max(corners) >= len(points):
        raise ValueError(f"a face refers to vertex {max(corners) + 1}, and there are {len(points)}")
    return points, triangulate(points, corners, lengths)


class _TooMany(ValueError):
    """There are more vertices or faces than are read."""


def _lines(data: bytes) -> Iterator[tuple[int, str]]:
    """Yield the lines with vertices and faces, and their numbers; one that ends in a backslash goes on below."""
    parts: list[bytes] = []
    number = size = 0
    for raw in io.BytesIO(data):
        line = raw.rstrip(b"\r\n")
        number += not parts
        if line.endswith(b"\\"):
            parts.append(line[:-1])
            size += len(line)
            if size > limits.OBJ_LINE:
                raise ValueError(f"line {number} has more than {limits.OBJ_LINE} characters")
            continue
        whole = b" ".join([*parts, line])
        parts, size = [], 0
        if whole.lstrip()[:1] in (b"v", b"f"):
            yield number, whole.decode(errors="replace")  # comments and names may be in any encoding


def _index(word: str, before: int) -> int:
    """Return the vertex of a corner "vertex/texture/normal", from 0; a negative one counts back from the last."""
    written = int(word.partition("/")[0])
    index = before + written if written < 0 else written - 1
    if written == 0 or index < 0:
        raise ValueError(word)
    return index
