"""Polygons of mesh files as triangles that share the first corner, and which of them may not be split so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

NOT_CONVEX = "is not convex and would be split wrongly; save it as triangles"
"""What is said of a polygon that is refused."""

_FOLD = 1e-6  # of a polygon's area: a triangle that turns back by less is the rounding of a straight edge


def split(polygons: Sequence[Sequence[int]] | Indices) -> tuple[Indices, Indices]:
    """Return the triangles (f, 3) of polygons, in order, and how many each became (n,)."""
    lengths = np.fromiter(map(len, polygons), dtype=np.int64, count=len(polygons))
    sizes = np.maximum(lengths - 2, 0)
    corners = np.concatenate(polygons).astype(np.int64)
    first = np.repeat(np.cumsum(lengths) - lengths, sizes)
    step = np.arange(len(first)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    return corners[np.stack([first, first + step + 1, first + step + 2], axis=1)], sizes


def first_folded(triangles: Floats, sizes: Indices) -> int | None:
    """Return which polygon is the first that is not convex, if any: of it a triangle turns back over the others.

    Such a triangle would cover what the polygon leaves free.

    Args:
        triangles: (f, 3, 3), corners of the triangles that the polygons were split into.
        sizes: (n,), how many of them each polygon became, at least one.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        whole = np.repeat(np.add.reduceat(normals, np.cumsum(sizes) - sizes), sizes, axis=0)
        back = np.sum(normals * whole, axis=1) < -_FOLD * np.sum(whole * whole, axis=1)
    return int(np.repeat(np.arange(len(sizes)), sizes)[np.argmax(back)]) if back.any() else None
