"""Wavefront OBJ files: vertices and faces; everything else in them has no place in a body."""

from __future__ import annotations

import itertools
from array import array

import numpy as np
from numpy.typing import NDArray

from replay.geometry.polygons import NOT_CONVEX, first_folded


def read(data: bytes) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the vertices (v, 3) and the triangles (f, 3) of an OBJ file.

    Polygons are split into triangles that share their first corner. Groups, objects, normals, textures, colours,
    materials, points and lines are passed over.

    Raises:
        ValueError: a vertex or a face is not as the format says, or a polygon is not convex; with its line.
    """
    vertices, corners = array("d"), array("q")
    sizes, lines = array("q"), array("q")  # of each face, its triangles and its line
    text = data.decode(errors="replace").replace("\r\n", "\n")  # comments and names may be in any encoding
    for number, line in enumerate(text.replace("\\\n", " ").split("\n"), start=1):
        words = line.partition("#")[0].split()
        if not words or words[0] not in ("v", "f"):
            continue
        try:
            if words[0] == "v":
                x, y, z = map(float, words[1:4])
                vertices.extend((x, y, z))
                continue
            first, *others = (_index(word, len(vertices) // 3) for word in words[1:])
            if len(others) < 2:
                raise ValueError("a face needs three corners")
            sizes.append(len(others) - 1)
            lines.append(number)
            for second, third in itertools.pairwise(others):
                corners.extend((first, second, third))
        except (ValueError, OverflowError):
            what = "three numbers" if words[0] == "v" else "three or more vertices, counted from 1"
            raise ValueError(f"line {number}, {line.strip()[:60]!r}, does not name {what}") from None
    faces = np.array(corners, dtype=np.int64).reshape(-1, 3)
    if len(faces) and faces.max() >= len(vertices) // 3:
        raise ValueError(f"a face refers to vertex {faces.max() + 1}, and there are {len(vertices) // 3}")
    points = np.array(vertices, dtype=np.float64).reshape(-1, 3)
    if len(faces) > len(sizes) and (folded := first_folded(points[faces], np.array(sizes))) is not None:
        raise ValueError(f"the polygon of line {lines[folded]} {NOT_CONVEX}")
    return points, faces


def _index(word: str, before: int) -> int:
    """Return the vertex of a corner "vertex/texture/normal", from 0; a negative one counts back from the last."""
    written = int(word.partition("/")[0])
    index = before + written if written < 0 else written - 1
    if written == 0 or index < 0:
        raise ValueError(word)
    return index
