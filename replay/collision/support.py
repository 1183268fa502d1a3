"""Support points: the vertex of a convex set that is farthest in a direction."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class Sets(NamedTuple):
    """The arrays of `geometry.ConvexSets` that GJK reads: convex sets of one body, in the body's frame."""

    vertices: Floats  # (v, 3) [m]
    first: Integers  # (m + 1,)
    neighbors_first: Integers  # (v + 1,)
    neighbors: Integers  # (e,)


@kernel
def farthest(sets: Sets, k: int, x: float, y: float, z: float, hint: int) -> int:
    """Return the vertex of set k (its row in `vertices`) that is farthest along (x, y, z).

    Sets with adjacency are climbed from the row `hint` over ever farther neighbours; on a convex set that ends at the
    farthest vertex to within rounding.
    """
    begin = sets.first[k]
    if sets.neighbors_first[begin] == sets.neighbors_first[sets.first[k + 1]]:
        return farthest_of_all(sets, k, x, y, z)
    vertices = sets.vertices
    best = hint if begin <= hint < sets.first[k + 1] else begin
    top = vertices[best, 0] * x + vertices[best, 1] * y + vertices[best, 2] * z
    while True:
        centre = best
        for e in range(sets.neighbors_first[centre], sets.neighbors_first[centre + 1]):
            i = begin + sets.neighbors[e]
            height = vertices[i, 0] * x + vertices[i, 1] * y + vertices[i, 2] * z
            if height > top:
                top = height
                best = i
        if best == centre:
            return best


@kernel
def farthest_of_all(sets: Sets, k: int, x: float, y: float, z: float) -> int:
    """Return the vertex of set k (its row in `vertices`) that is farthest along (x, y, z), looking at each one."""
    vertices = sets.vertices
    best = sets.first[k]
    top = -np.inf
    for i in range(sets.first[k], sets.first[k + 1]):
        height = vertices[i, 0] * x + vertices[i, 1] * y + vertices[i, 2] * z
        if height > top:
            top = height
            best = i
    return best
