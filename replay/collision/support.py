"""Support points: the vertex of a convex set that is farthest in a direction.

Few vertices are all looked at. Many are climbed over the hull's edges, from the better of two starts: the caller's
hint, and a table that holds the farthest vertex for the middle of each of `CELLS` cells of a cube about the origin, of
which the direction names one. On 642 vertices that leaves about one step to climb.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import leaf_kernel

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


_STEPS = 8

CELLS = 6 * _STEPS * _STEPS
"""Cells of the table of starts: as many squares on each face of a cube as 642 vertices share out among."""


class Sets(NamedTuple):
    """The arrays of `geometry.ConvexSets` that GJK reads, and what it starts from; see `make_sets`."""

    vertices: Floats  # (v, 3) [m]
    first: Integers  # (m + 1,)
    neighbors_first: Integers  # (v + 1,)
    neighbors: Integers  # (e,)
    center: Floats  # (m, 3) [m], mean of each set's vertices
    table: Integers  # (m,) row of `starts`, -1 for sets without adjacency
    starts: Integers  # (t, CELLS) vertices within their set


def make_sets(vertices: Floats, first: Integers, neighbors_first: Integers, neighbors: Integers) -> Sets:
    """Return convex sets, given as in `geometry.ConvexSets`, as GJK reads them."""
    center = np.add.reduceat(vertices, first[:-1]) / np.diff(first)[:, None]
    climbed = neighbors_first[first[:-1]] < neighbors_first[first[1:]]
    table = np.where(climbed, np.cumsum(climbed) - 1, -1)
    starts = np.zeros((int(climbed.sum()), CELLS), dtype=np.int64)
    x, y, z = _cell_directions().T
    for row, k in enumerate(np.flatnonzero(climbed)):
        points = vertices[first[k] : first[k + 1]]
        heights = points[:, :1] * x + points[:, 1:2] * y + points[:, 2:] * z
        starts[row] = heights.argmax(axis=0)
    return Sets(np.ascontiguousarray(vertices), first, neighbors_first, neighbors, center, table, starts)


def _cell_directions() -> Floats:
    """Return the middles of the cells (CELLS, 3), in the order of `_cell`."""
    steps = (np.arange(_STEPS) + 0.5) * (2.0 / _STEPS) - 1.0
    u, v = np.repeat(steps, _STEPS), np.tile(steps, _STEPS)
    faces = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            face = np.empty((_STEPS * _STEPS, 3))
            face[:, axis], face[:, (axis + 1) % 3], face[:, (axis + 2) % 3] = sign, u, v
            faces.append(face)
    return np.concatenate(faces)


@leaf_kernel
def _cell(x: float, y: float, z: float) -> int:
    """Return the cell of a direction: the cube's face that it meets, and the square on it."""
    ax, ay, az = abs(x), abs(y), abs(z)
    if ax >= ay and ax >= az:
        face, top, u, v = (0 if x >= 0.0 else 1), ax, y, z
    elif ay >= az:
        face, top, u, v = (2 if y >= 0.0 else 3), ay, z, x
    else:
        face, top, u, v = (4 if z >= 0.0 else 5), az, x, y
    if not 0.0 < top < np.inf:
        return 0
    scale = 0.5 * _STEPS / top
    row, column = int(u * scale + 0.5 * _STEPS), int(v * scale + 0.5 * _STEPS)
    return (face * _STEPS + min(max(row, 0), _STEPS - 1)) * _STEPS + min(max(column, 0), _STEPS - 1)


@leaf_kernel
def farthest_by_climbing(sets: Sets, k: int, x: float, y: float, z: float, hint: int) -> int:
    """Return the vertex of set k (its row in `vertices`) that is farthest along (x, y, z), for a set with adjacency.

    It is climbed, from the table's start or the row `hint` if that is farther, over ever farther neighbours; on a
    convex set that ends at the farthest vertex to within rounding.
    """
    begin, end = sets.first[k], sets.first[k + 1]
    start = begin + sets.starts[sets.table[k], _cell(x, y, z)]
    if begin <= hint < end and _height(sets.vertices, hint, x, y, z) > _height(sets.vertices, start, x, y, z):
        start = hint
    return _climb(sets.vertices, sets.neighbors_first, sets.neighbors, begin, start, x, y, z)


@leaf_kernel
def _height(vertices: Floats, i: int, x: float, y: float, z: float) -> float:
    height: float = vertices[i, 0] * x + vertices[i, 1] * y + vertices[i, 2] * z
    return height


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
