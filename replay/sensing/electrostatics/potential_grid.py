"""The unit's potential and the distance to it, in nested grids around it: what every frame and every pose asks for.

Level l has cells of 5 mm times 2^l and reaches ten of them beyond the unit's box. Values between are those of Catmull
and Rom's cubics (1974). A node's values are computed when somebody first comes by; they follow from its place alone.
Outside the largest grid, and where a caller wants more than a grid gives near the unit, potentials are summed.
"""

from __future__ import annotations

import math
import threading
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numba import boolean, float64, int64

from replay.geometry.closest import distance_to_surface
from replay.geometry.tree import TREE_TYPE, Tree, triangle_tree
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel, record
from replay.sensing.electrostatics.charge_tree import CHARGE_TREE_TYPE, ChargeTree, add_potentials, charge_tree
from replay.sensing.electrostatics.influence import point_potentials

if TYPE_CHECKING:
    from replay.sensing.electrostatics.unit import Unit

_CELL, _FINEST = 5e-3, 1.0 / 150.0
"""The finest cells [m], and as a share of a unit's longest side for one so large that they would be too many."""

_LEVELS = 7
_AROUND = 10
_NEAR = 3.0
"""Nearer to the unit than so many of the finest cells a grid does not follow the potential."""

_PROBES = 8
"""Points along each edge of the box on which the extrapolation is judged."""

_filling = threading.Lock()
"""Units are shared by all that is computed in a process."""


class PotentialGrid(NamedTuple):
    """Values at the nodes of all levels, one level after the other, and what they are computed from."""

    values: Floats  # (n m,): distance [m], potentials of k electrodes alone at 1 V, zeros to fill vectors of four
    known: Flags  # (n,) whether they are there
    whole: Flags  # (n,) whether all 64 nodes around the cell that begins at a node are known
    origins: Floats  # (levels, 3) [m]
    cells: Floats  # (levels,) [m]
    shapes: Integers  # (levels, 3) nodes along each axis
    begins: Integers  # (levels,) first row of each
    charges: ChargeTree
    surface: Floats  # (t, 3, 3) [m], the unit's triangles
    tree: Tree  # over them


POTENTIAL_GRID_TYPE = record(
    PotentialGrid,
    float64[::1],
    boolean[::1],
    boolean[::1],
    float64[:, ::1],
    float64[::1],
    int64[:, ::1],
    int64[::1],
    CHARGE_TREE_TYPE,
    float64[:, :, ::1],
    TREE_TYPE,
)


class Potential:
    """The potential of a unit's electrodes, each alone at 1 V.

    Attributes:
        doubt: (k,) how much the extrapolation from two meshes changes each, as a share.
    """

    def __init__(self, unit: Unit) -> None:
        surface = np.ascontiguousarray(np.concatenate([s for e in unit.electrodes for s in e.surfaces]))
        coarse, fine = unit.charged
        k = len(unit.electrodes)
        self.columns = 1 + k
        weights = unit.extrapolated(0.0, 1.0), unit.extrapolated(1.0, 0.0)
        charges = charge_tree([(fine.panels, weights[0] * fine.charges), (coarse.panels, weights[1] * coarse.charges)])
        low, high = surface.min(axis=(0, 1)), surface.max(axis=(0, 1))
        cell = max(_CELL, _FINEST * float(np.max(high - low)))
        cells: Floats = cell * 2.0 ** np.arange(_LEVELS, dtype=np.float64)
        origins = low - _AROUND * cells[:, None]
        shapes = np.ceil((high + _AROUND * cells[:, None] - origins) / cells[:, None]).astype(np.int64) + 1
        counts = shapes.prod(axis=1)
        total = int(counts.sum())
        self.near = _NEAR * cell
        self.doubt = _doubt(unit, low - self.near, high + self.near)
        self._grid = PotentialGrid(
            np.zeros(total * (self.columns + (-self.columns % 4))),
            np.zeros(total, np.bool_),
            np.zeros(total, np.bool_),
            np.ascontiguousarray(origins),
            cells,
            np.ascontiguousarray(shapes),
            np.cumsum(counts) - counts,
            charges,
            surface,
            triangle_tree(surface),
        )

    @property
    def surface(self) -> tuple[Floats, Tree]:
        """The unit's triangles (n, 3, 3) [m] and the tree over them."""
        return self._grid.surface, self._grid.tree

    def at(self, points: Floats, *, exact: bool = False) -> tuple[Floats, Floats]:
        """Return the potentials (n, k) at points (n, 3) [m] and their distances (n,) [m].

        Args:
            points: in the unit's frame.
            exact: whether potentials nearer than `near` are summed over panels.
        """
        with _filling:
            found = looked_up(np.ascontiguousarray(points), self._grid, self.near if exact else 0.0)
        return found[:, 1 : self.columns], np.ascontiguousarray(found[:, 0])

    def proxies(self, points: Floats, areas: Floats, body: Integers, T: Floats, least: float) -> Floats:
        """Return E (n, k) [m] of n poses, see `keyframes`.

        Args:
            points: (m, 3) [m], each in the frame of its body.
            areas: (m,) [m^2].
            body: (m,) of each.
            T: (n, bodies, 4, 4), T_unit_body.
            least: distance [m] that smaller ones count as.
        """
        with _filling:
            found = sums_over_points(points, areas, body, np.ascontiguousarray(T), self._grid, least)
        return np.ascontiguousarray(found[:, 1 : self.columns]) + 1e-300


def _doubt(unit: Unit, low: Floats, high: Floats) -> Floats:
    """Return by which share (k,) the extrapolation changes potentials on a box around the unit, in the mean square."""
    t = (np.arange(_PROBES) + 0.5) / _PROBES
    square = np.stack(np.meshgrid(t, t, indexing="ij"), axis=-1).reshape(-1, 2)
    sides = [np.insert(square, axis, side, axis=1) for axis in range(3) for side in (0.0, 1.0)]
    points = low + np.concatenate(sides) * (high - low)
    coarse, fine = (point_potentials(points, mesh.panels, mesh.charges) for mesh in unit.charged)
    phi = unit.extrapolated(coarse, fine)
    return np.asarray(np.sqrt(((phi - fine) ** 2).sum(axis=1) / ((phi * phi).sum(axis=1) + 1e-300)))


@leaf_kernel
def _weights(t: float) -> tuple[float, float, float, float]:
    return (
        0.5 * t * (-1.0 + t * (2.0 - t)),
        1.0 + 0.5 * t * t * (-5.0 + 3.0 * t),
        0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
        0.5 * t * t * (t - 1.0),
    )


@leaf_kernel
def _add_four(total: Floats, share: float, weights: tuple[float, float, float, float], rows: Floats) -> None:
    """Add four rows of values, each times its weight."""
    n = len(total)
    a, b, c, d = share * weights[0], share * weights[1], share * weights[2], share * weights[3]
    first, second, third, last = rows[:n], rows[n : 2 * n], rows[2 * n : 3 * n], rows[3 * n :]
    for k in range(n):
        total[k] += (a * first[k] + b * second[k]) + (c * third[k] + d * last[k])


@kernel
def _sum(row: Floats, point: Floats, grid: PotentialGrid, R: Floats) -> None:
    """Write distance and potentials at a point, summed over panels."""
    k = grid.charges.moments.shape[2]
    row[:] = 0.0
    row[0] = distance_to_surface(point, grid.surface, grid.tree)
    add_potentials(row[1 : 1 + k], point[0], point[1], point[2], grid.charges, R)


@kernel
def _complete(grid: PotentialGrid, level: int, at: Integers, point: Floats, R: Floats) -> None:
    """Compute the 64 nodes around a cell that are not known."""
    cell, columns = grid.cells[level], len(grid.values) // len(grid.known)
    for i in range(at[0] - 1, at[0] + 3):
        for j in range(at[1] - 1, at[1] + 3):
            for k in range(at[2] - 1, at[2] + 3):
                row = grid.begins[level] + (i * grid.shapes[level, 1] + j) * grid.shapes[level, 2] + k
                if not grid.known[row]:
                    point[0] = grid.origins[level, 0] + cell * i
                    point[1] = grid.origins[level, 1] + cell * j
                    point[2] = grid.origins[level, 2] + cell * k
                    _sum(grid.values[columns * row : columns * (row + 1)], point, grid, R)
                    grid.known[row] = True


@leaf_kernel
def _level_of(point: Floats, grid: PotentialGrid, at: Integers) -> int:
    """Return the finest level that holds a point, and write the cell in which it is; -1 where none does."""
    for level in range(len(grid.cells)):
        inside = True
        for axis in range(3):
            at[axis] = math.floor((point[axis] - grid.origins[level, axis]) / grid.cells[level])
            inside = inside and at[axis] >= 1 and at[axis] + 2 < grid.shapes[level, axis]
        if inside:
            return level
    return -1


@leaf_kernel
def _blend(row: Floats, point: Floats, grid: PotentialGrid, level: int, at: Integers, begin: int) -> None:
    """Write values between the nodes around a cell that begins at a node."""
    cell = grid.cells[level]
    wx = _weights((point[0] - grid.origins[level, 0]) / cell - at[0])
    wy = _weights((point[1] - grid.origins[level, 1]) / cell - at[1])
    wz = _weights((point[2] - grid.origins[level, 2]) / cell - at[2])
    second, third, columns = grid.shapes[level, 1], grid.shapes[level, 2], len(row)
    flat = grid.values
    for c in range(columns):
        row[c] = 0.0
    for i in range(4):
        for j in range(4):
            first = (begin + ((i - 1) * second + j - 1) * third - 1) * columns
            _add_four(row, wx[i] * wy[j], wz, flat[first : first + 4 * columns])


@kernel
def _interpolate(row: Floats, point: Floats, grid: PotentialGrid, at: Integers, node: Floats, R: Floats) -> None:
    """Write values at a point: of the finest grid that holds it, or summed where none does."""
    level = _level_of(point, grid, at)
    if level < 0:
        _sum(row, point, grid, R)
        return
    begin = grid.begins[level] + (at[0] * grid.shapes[level, 1] + at[1]) * grid.shapes[level, 2] + at[2]
    if not grid.whole[begin]:
        _complete(grid, level, at, node, R)
        grid.whole[begin] = True
    _blend(row, point, grid, level, at, begin)


@entry(float64[:, ::1], POTENTIAL_GRID_TYPE, float64)
@kernel
def looked_up(points: Floats, grid: PotentialGrid, near: float) -> Floats:
    """Return values (n, m) at points (n, 3), summed where they are nearer than `near` [m] to the unit."""
    result = np.zeros((len(points), len(grid.values) // len(grid.known)))
    at, node, R = np.zeros(3, np.int64), np.zeros(3), np.zeros(5)
    for k in range(len(points)):
        _interpolate(result[k], points[k], grid, at, node, R)
        if result[k, 0] < near:
            _sum(result[k], points[k], grid, R)
    return result


@entry(float64[:, ::1], float64[::1], int64[::1], float64[:, :, :, ::1], POTENTIAL_GRID_TYPE, float64)
@kernel
def sums_over_points(
    points: Floats, areas: Floats, body: Integers, T: Floats, grid: PotentialGrid, least: float
) -> Floats:
    """Return E in columns 1 .. k of rows (n, m), see `Potential.proxies`."""
    columns = len(grid.values) // len(grid.known)
    result = np.zeros((len(T), columns))
    at, node, R = np.zeros(3, np.int64), np.zeros(3), np.zeros(5)
    point, row = np.zeros(3), np.zeros(columns)
    for pose in range(len(T)):
        for j in range(len(points)):
            M = T[pose, body[j]]
            for axis in range(3):
                point[axis] = (
                    M[axis, 0] * points[j, 0] + M[axis, 1] * points[j, 1] + M[axis, 2] * points[j, 2] + M[axis, 3]
                )
            _interpolate(row, point, grid, at, node, R)
            share = areas[j] / max(row[0], least)
            for c in range(columns):
                result[pose, c] += share * row[c] * row[c]
    return result
