"""Support points: the vertex of a convex set that is farthest in a direction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import leaf_kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Sets(NamedTuple):
    """The arrays of `geometry.ConvexSets` that GJK reads: convex sets of one body, in the body's frame."""

    vertices: Floats  # (v, 3) [m]
    first: Integers  # (m + 1,)
    neighbors_first: Integers  # (v + 1,)
    neighbors: Integers  # (e,)


@leaf_kernel
def farthest(sets: Sets, k: int, x: float, y: float, z: float, hint: int) -> int:
    """Return the vertex of set k (its row in `vertices`) that is farthest along (x, y, z).

    Sets with adjacency are climbed from the row `hint` over ever farther neighbours; on a convex set that ends at the
    farthest vertex to within rounding.
    """
    begin, end = sets.first[k], sets.first[k + 1]
    if sets.neighbors_first[begin] == sets.neighbors_first[end]:
        return farthest_of_all(sets.vertices, begin, end, x, y, z)
    start = hint if begin <= hint < end else begin
    return _climb(sets.vertices, sets.neighbors_first, sets.neighbors, begin, start, x, y, z)


@leaf_kernel
def farthest_of_all(vertices: Floats, begin: int, end: int, x: float, y: float, z: float) -> int:
    """Return the row of vertices[begin:end] that is farthest along (x, y, z), the first of equals."""
    best = begin
    top = -np.inf
    for i in range(begin, end):
        height = vertices[i, 0] * x + vertices[i, 1] * y + vertices[i, 2] * z
        if height > top:
            top = height
            best = i
    return best


@leaf_kernel
def _climb(
    vertices: Floats,
    neighbors_first: Integers,
    neighbors: Integers,
    begin: int,
    start: int,
    x: float,
    y: float,
    z: float,
) -> int:
    best = start
    top = vertices[best, 0] * x + vertices[best, 1] * y + vertices[best, 2] * z
    centre = -1
    while centre != best:
        centre = best
        for e in range(neighbors_first[centre], neighbors_first[centre + 1]):
            i = begin + neighbors[e]
            height = vertices[i, 0] * x + vertices[i, 1] * y + vertices[i, 2] * z
            if height > top:
                top = height
                best = i
    return best
