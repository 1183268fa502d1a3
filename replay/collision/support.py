"""Support points: the vertex of a convex set that is farthest in a direction.

Few vertices are all looked at. For many, directions are sorted into cells once, and each cell lists the vertices that
can be farthest for any direction in it: on 642 vertices about five. That is what climbing over a hull's edges ends at,
without the steps, without a hull, and without a place to get stuck.

Cells: the eight octants, and in each the squares of N x N over (u, v) = (|x|, |y|) / (|x| + |y| + |z|), those on the
border u + v = 1 cut by it. A cell lies in a plane, so heights are linear over it: what is lower than one vertex at all
its corners is lower in the whole cell. Cells are halved N = 1, 2, 4, ..; each looks only at what its parent kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float64, int64

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, inlined_kernel, kernel, record
from replay.numerics.kept import kept

FEW = 16
"""Sets of so many vertices or fewer are looked at vertex by vertex: as fast as finding the cell."""

MARGIN = 2.0**-30
"""What a cell leaves out is lower than its highest vertex by this part of the set's largest coordinate, or more."""


class Sets(NamedTuple):
    """Convex sets as GJK reads them; see `make_sets`. Set k is the hull of vertices[first[k]:first[k + 1]].

    Cell c of a set with a table lists candidates[cells[table[k] + c]:cells[table[k] + c + 1]], rows of `vertices`.
    """

    vertices: Floats  # (v, 3) [m]
    flat: Floats  # (3 v,) [m], the same memory: indexing it needs no stride
    first: Integers  # (m + 1,)
    center: Floats  # (m, 3) [m], mean of each set's vertices
    side: Integers  # (m,) squares along a side of an octant, 0 for sets without a table
    table: Integers  # (m,) row of `cells`
    margin: Floats  # (m,) [m] what a cell leaves out is lower by, per |x| + |y| + |z| of the direction
    cells: Integers  # (c,) rows of `candidates`
    candidates: Integers  # (t,)


SETS_TYPE = record(
    Sets,
    float64[:, ::1],
    float64[::1],
    int64[::1],
    float64[:, ::1],
    int64[::1],
    int64[::1],
    float64[::1],
    int64[::1],
    int64[::1],
)


def make_sets(vertices: Floats, first: Integers, *, tables: bool = True) -> Sets:
    """Return the convex hulls of vertices[first[k]:first[k + 1]] as GJK reads them.

    Args:
        vertices: (v, 3) [m], finite.
        first: (m + 1,), at least one vertex a set.
        tables: whether sets of many vertices get tables, which pay after some hundred queries.
    """
    vertices = np.ascontiguousarray(vertices)
    flat, counts = vertices.reshape(-1), np.diff(first)
    side, table, margin = np.zeros_like(counts), np.zeros_like(counts), np.zeros(len(counts))
    cells, candidates = [], []
    cell_count = candidate_count = 0
    for k in np.flatnonzero(counts > FEW) if tables else ():
        begin, end = first[k], first[k + 1]
        margin[k] = MARGIN * float(np.abs(vertices[begin:end]).max())
        starts, listed = _table(flat[3 * begin : 3 * end], float(margin[k]))
        side[k], table[k] = round(np.sqrt(len(starts) // 8)), cell_count
        cells.append(starts + candidate_count)
        candidates.append(listed + begin)
        cell_count, candidate_count = cell_count + len(starts), candidate_count + len(listed)
    none = [np.zeros(0, dtype=np.int64)]
    return Sets(
        vertices=vertices,
        flat=flat,
        first=first,
        center=np.add.reduceat(vertices, first[:-1]) / counts[:, None],
        side=side,
        table=table,
        margin=margin,
        cells=np.concatenate(none + cells),
        candidates=np.concatenate(none + candidates),
    )


@kept
def _table(flat: Floats, margin: float) -> tuple[Integers, Integers]:
    """Return the starts (8 N N + 1,) of each cell's list and the lists, of the rows of v vertices (3 v,)."""
    vertices = len(flat) // 3
    side, starts, listed = 0, np.array([0, vertices], dtype=np.int64), np.arange(vertices, dtype=np.int64)
    while side < 8 or (3 * side * side < vertices and side < 64):
        side = max(1, 2 * side)
        finer = np.empty(8 * side * side + 1, dtype=np.int64)
        found = np.empty(2 * len(listed) + 64 * side * side, dtype=np.int64)  # more are listed where many are alike
        count = _list_cells(flat, side, margin, starts, listed, finer, found)
        if count > len(found):
            found = np.empty(count, dtype=np.int64)
            _list_cells(flat, side, margin, starts, listed, finer, found)
        starts, listed = finer, found[:count]
    return starts, listed


@entry(float64[::1], int64, float64, int64[::1], int64[::1], int64[::1], int64[::1])
@kernel
def _list_cells(
    flat: Floats, side: int, margin: float, starts: Integers, listed: Integers, finer: Integers, found: Integers
) -> int:
    """Write the starts of each cell's list, and the lists if `found` has room; return their total length.

    `starts` and `listed` are those of half the side, or one list for all cells of side 1.
    """
    count, half = 0, side // 2
    least = np.empty((4, 4))  # directions to a cell's corners, and how high is high enough
    for cell in range(8 * side * side):
        octant, row, column = cell // (side * side), cell // side % side, cell % side
        finer[cell] = count
        if row + column > side:  # no direction; on the border u + v = 1 there may be one
            continue
        parent = 0 if half == 0 else (octant * half + row // 2) * half + column // 2
        top, best = -np.inf, listed[starts[parent]]
        for e in range(starts[parent], starts[parent + 1]):
            x, y, z = _direction(octant, (row + 1.0 / 3.0) / side, (column + 1.0 / 3.0) / side)
            height = _height(flat, listed[e], x, y, z)
            if height > top:
                top, best = height, listed[e]
        corners = 0
        for corner in range(4):
            u, v = row + corner % 2, column + corner // 2
            if u + v <= side:
                x, y, z = _direction(octant, u / side, v / side)
                least[corners, 0], least[corners, 1], least[corners, 2] = x, y, z
                least[corners, 3] = _height(flat, best, x, y, z) - margin
                corners += 1
        for e in range(starts[parent], starts[parent + 1]):
            i = listed[e]
            kept = False
            for corner in range(corners):
                x, y, z, low = least[corner]
                kept = kept or _height(flat, i, x, y, z) >= low
            if kept:
                if count < len(found):
                    found[count] = i
                count += 1
    finer[8 * side * side] = count
    return count


@inlined_kernel
def _direction(octant: int, u: float, v: float) -> tuple[float, float, float]:
    """Return the direction at (u, v) of an octant."""
    w = 1.0 - u - v
    return -u if octant & 1 else u, -v if octant & 2 else v, -w if octant & 4 else w


@inlined_kernel
def _cell(side: int, x: float, y: float, z: float) -> int:
    """Return the cell of a direction."""
    octant = (1 if x < 0.0 else 0) + (2 if y < 0.0 else 0) + (4 if z < 0.0 else 0)
    total = abs(x) + abs(y) + abs(z)
    if not 1e-290 < total < 1e290:  # NaN, and what would overflow below
        return 0
    scale = side / total
    row, column = min(int(abs(x) * scale), side - 1), min(int(abs(y) * scale), side - 1)
    return (octant * side + row) * side + column


@inlined_kernel
def _height(flat: Floats, i: int, x: float, y: float, z: float) -> float:
    height: float = flat[3 * i] * x + flat[3 * i + 1] * y + flat[3 * i + 2] * z
    return height


@inlined_kernel
def candidates(sets: Sets, table: int, side: int, x: float, y: float, z: float) -> tuple[int, int]:
    """Return begin and end in `sets.candidates` of the vertices that may be farthest along (x, y, z)."""
    cell = table + _cell(side, x, y, z)
    return sets.cells[cell], sets.cells[cell + 1]


@inlined_kernel
def farthest(sets: Sets, begin: int, end: int, table: int, side: int, x: float, y: float, z: float) -> int:
    """Return the row in begin:end of `vertices` that is farthest along (x, y, z), for the set with that table."""
    best, top = begin, -np.inf
    if side > 0:
        low, high = candidates(sets, table, side, x, y, z)
        for e in range(low, high):
            i = sets.candidates[e]
            height = _height(sets.flat, i, x, y, z)
            if height > top:
                top, best = height, i
        return best
    for i in range(begin, end):
        height = _height(sets.flat, i, x, y, z)
        if height > top:
            top, best = height, i
    return best
