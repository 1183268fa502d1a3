"""The unit's potential and the distance to it, in nested grids around it: what every frame and every pose asks for.

Level l has cells of 1 cm times 2^l and reaches ten of them beyond the unit's box. Values between are those of
Catmull and Rom's cubics (1974). Outside the largest grid, and where a caller wants more than a grid gives near the
unit, potentials are summed over the panels.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import float64, int64

from replay.geometry.tree import triangle_tree
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel
from replay.sensing.electrostatics.influence import point_potentials
from replay.sensing.electrostatics.proxy import surface_distances
from replay.sensing.electrostatics.unit import Unit

_CELL = 0.01
_LEVELS = 6
_AROUND = 10

NEAR = 3.0 * _CELL
"""Nearer to the unit than this [m] a grid does not follow the potential."""


@dataclass(frozen=True, eq=False)
class Grids:
    """Values at the nodes of all levels, one level after the other.

    Attributes:
        values: (n, m): distance [m], potentials of k electrodes alone at 1 V, zeros to fill vectors of four.
        origins: (levels, 3) [m]; cells: (levels,) [m].
        shapes: (levels, 3) nodes along each axis; begins: (levels,) first row of each.
    """

    values: Floats
    origins: Floats
    cells: Floats
    shapes: Integers
    begins: Integers


class Potential:
    """The potential of a unit's electrodes, each alone at 1 V.

    Args:
        unit: the electrodes.
        surface: (n, 3, 3) [m], its triangles.
    """

    def __init__(self, unit: Unit, surface: Floats) -> None:
        self.surface, self.tree = surface, triangle_tree(surface)
        self._unit = unit

    @cached_property
    def grids(self) -> Grids:
        """The grids; they take seconds."""
        low, high = self.surface.min(axis=(0, 1)), self.surface.max(axis=(0, 1))
        parts, origins, cells, shapes, begins, total = [], [], [], [], [], 0
        for level in range(_LEVELS):
            cell = _CELL * 2.0**level
            origin = low - _AROUND * cell
            shape = np.ceil((high + _AROUND * cell - origin) / cell).astype(np.int64) + 1
            axes = [origin[axis] + cell * np.arange(shape[axis]) for axis in range(3)]
            points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3)
            parts.append(np.concatenate([self.distances(points)[:, None], self.summed(points)[0].T], axis=1))
            origins.append(origin)
            cells.append(cell)
            shapes.append(shape)
            begins.append(total)
            total += len(points)
        return Grids(
            _padded(np.concatenate(parts)),
            np.array(origins),
            np.array(cells),
            np.array(shapes, dtype=np.int64),
            np.array(begins, dtype=np.int64),
        )

    def summed(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the potentials (k, n) at points (n, 3), extrapolated, and those of the finer mesh."""
        first, second = (point_potentials(points, mesh.panels, mesh.charges) for mesh in self._unit.charged)
        return self._unit.extrapolated(first, second), second

    def distances(self, points: Floats) -> Floats:
        """Return the distances (n,) [m] of points (n, 3)."""
        return surface_distances(np.ascontiguousarray(points), self.surface, self.tree)

    def interpolated(self, points: Floats) -> tuple[Floats, Floats]:
        """Return the potentials (k, n) at points (n, 3) [m] and their distances (n,) [m]."""
        g = self.grids
        found = interpolated(points, g.values, g.origins, g.cells, g.shapes, g.begins)
        k = len(self._unit.electrodes)
        outside = np.flatnonzero(np.isnan(found[:, 0]))
        if len(outside):
            far = np.ascontiguousarray(points[outside])
            found[outside, 1 : k + 1] = self.summed(far)[0].T
            found[outside, 0] = self.distances(far)
        return np.ascontiguousarray(found[:, 1 : k + 1].T), np.ascontiguousarray(found[:, 0])


def _padded(values: Floats) -> Floats:
    """Return columns with zeros beside them, up to a multiple of four."""
    more = -values.shape[1] % 4
    return np.ascontiguousarray(np.pad(values, ((0, 0), (0, more))))


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


@entry(float64[:, ::1], float64[:, ::1], float64[:, ::1], float64[::1], int64[:, ::1], int64[::1])
@kernel
def interpolated(
    points: Floats, values: Floats, origins: Floats, cells: Floats, shapes: Integers, begins: Integers
) -> Floats:
    """Return values (n, c) at points (n, 3) of the finest grid that holds each; NaN where none does."""
    n, columns = len(points), values.shape[1]
    result = np.full((n, columns), np.nan)
    at = np.zeros(3, np.int64)
    part = np.zeros(3)
    for k in range(n):
        for level in range(len(cells)):
            inside = True
            for axis in range(3):
                x = (points[k, axis] - origins[level, axis]) / cells[level]
                cell = math.floor(x)
                inside = inside and cell >= 1 and cell + 2 < shapes[level, axis]
                at[axis], part[axis] = cell, x - cell
            if not inside:
                continue
            wx, wy, wz = _weights(part[0]), _weights(part[1]), _weights(part[2])
            for c in range(columns):
                result[k, c] = 0.0
            for i in range(4):
                for j in range(4):
                    share = wx[i] * wy[j]
                    row = (
                        begins[level]
                        + ((at[0] - 1 + i) * shapes[level, 1] + at[1] - 1 + j) * shapes[level, 2]
                        + at[2]
                        - 1
                    )
                    four = values[row : row + 4].reshape(4 * columns)
                    _add_four(result[k], share, wz, four)
            break
    return result
