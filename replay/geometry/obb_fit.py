"""The axes of an oriented box: principal axes, and what to do where those are not determined.

Principal axes are the eigenvectors of a covariance. Where eigenvalues repeat (a sphere, a cube, a cylinder) any basis
of their eigenspace is one, and an arbitrary one can give a box of 2.4 times the volume (a cube). There the smallest
box is looked for: about the distinct axis when a pair repeats, among axes that the hull suggests when all three do.
Flat and straight sets have eigenvalues that are zero within rounding; they are solved in their own plane.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from replay.geometry.box_search import smallest_box
from replay.geometry.calipers import turn_about
from replay.geometry.hull import Hull
from replay.geometry.principal_axes import eigen
from replay.geometry.solid import signed_volume
from replay.numerics.arrays import Floats
from replay.numerics.rows import distinct_rows

Number = TypeVar("Number", bound=np.generic)

NEARLY_REPEATED = 0.3
"""Neighbouring eigenvalues whose difference is at most this times the larger count as repeated.

Measured on cubes, octahedra, tetrahedra and cylinders that are stretched by up to 10 % in three directions: the worst
box has 3.9, 3.4, 2.9 and 1.0 times the smallest volume at a threshold of 0.02, 0.1, 0.2 and 0.3. Hulls of 20 random
points, which have no axes to be found, are at most 1.9 times as large as need be at any threshold up to 0.3.
"""

_FLAT = 1e-14  # eigenvalues this far below the largest are rounding: the set is thinner than 1e-7 of its extent
_TRIALS = (400, 40)  # axes tried on small hulls, and on hulls of thousands of vertices
_KEPT = (8, 2)  # boxes kept of them
_TURNED = (20, 2)  # boxes turned at random
_LOOKED_AT = 2000  # faces that give trial axes
_FEW = 32  # points
_SMALL_HULL = 250  # vertices from which the effort goes down in proportion


def box_axes(points: Floats, hull: Callable[[], Hull | None], covariance: Floats) -> Floats:
    """Return the unit axes (3, 3 rows) of the box around points (n, 3) of extent about 1.

    Args:
        points: (n, 3); only hull vertices matter.
        hull: returns the convex hull of the points, None if they are flat; called where a box has to be looked for.
        covariance: (3, 3) whose eigenvectors the axes are, where they are determined.
    """
    values, axes = eigen(covariance)
    low, middle, high = (float(value) for value in values)
    if not high > 0.0:
        return np.eye(3)
    lower_pair = middle - low <= NEARLY_REPEATED * middle
    upper_pair = high - middle <= NEARLY_REPEATED * high
    if middle <= _FLAT * high or (lower_pair and not upper_pair):
        return _about(_turned(points, hull), axes[2])
    if low <= _FLAT * high or (upper_pair and not lower_pair):
        return _about(_turned(points, hull), axes[0])
    if lower_pair and (around := hull()) is not None:
        corners = _corners(points, around)
        trials, kept, turned = (_effort(bounds, len(corners)) for bounds in (_TRIALS, _KEPT, _TURNED))
        floor = signed_volume(points[around.faces])
        return np.asarray(
            smallest_box(corners, axes, _trial_axes(points, around, trials), _spread_rotations(turned), kept, floor)
        )
    return axes


def _corners(points: Floats, hull: Hull | None) -> Floats:
    return points if hull is None else np.ascontiguousarray(points[hull.vertices])


def _turned(points: Floats, hull: Callable[[], Hull | None]) -> Floats:
    """Return the points that a box is turned about; of few, all: their hull would take longer."""
    return points if len(points) <= _FEW else _corners(points, hull())


def _effort(bounds: tuple[int, int], vertices: int) -> int:
    """Return how many to try: bounds[0] for small hulls, down in proportion to the vertices, bounds[1] at least."""
    most, fewest = bounds
    return max(fewest, min(most, most * _SMALL_HULL // vertices))


def _about(corners: Floats, axis: Floats) -> Floats:
    result = np.empty((3, 3))
    turn_about(corners, np.ascontiguousarray(axis), result)
    return result


def _trial_axes(points: Floats, hull: Hull, most: int) -> Floats:
    """Return axes (t, 3) that the smallest box may have: face normals, edges, and normals to two edges.

    Of more than `most`, evenly spread ones of each kind are taken.
    """
    faces = _spread(hull.faces, _LOOKED_AT)
    a, b, c = np.moveaxis(points[faces], 1, 0)
    normals = _distinct_directions(np.cross(b - a, c - a))
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    ends = ends[ends[:, 0] < ends[:, 1]]
    edges = _distinct_directions(points[ends[:, 1]] - points[ends[:, 0]])
    normals, edges = _spread(normals, most // 4), _spread(edges, most // 4)
    some = _spread(edges, 40)
    first, second = np.triu_indices(len(some), 1)
    across = _distinct_directions(np.cross(some[first], some[second]))
    return np.concatenate([normals, edges, _spread(across, most - len(normals) - len(edges))])


def _distinct_directions(vectors: Floats) -> Floats:
    """Return unit vectors along the lines of (n, 3) vectors, each line once (to 1e-7), zero vectors left out."""
    length = np.sqrt(np.sum(vectors * vectors, axis=1))
    unit = vectors[length > 1e-9] / length[length > 1e-9, None]
    grid = np.round(unit * 1e7).astype(np.int64)
    leading = np.take_along_axis(grid, np.argmax(grid != 0, axis=1)[:, None], axis=1)[:, 0]
    grid *= np.where(leading < 0, -1, 1)[:, None]
    return np.ascontiguousarray(unit[distinct_rows(grid).first])


def _spread(rows: NDArray[Number], most: int) -> NDArray[Number]:
    """Return at most `most` rows, evenly spread over those given."""
    if len(rows) <= most:
        return rows
    return rows[np.arange(most) * len(rows) // most]


@lru_cache
def _spread_rotations(count: int) -> Floats:
    """Return rotations (count, 3, 3) spread over all orientations (super-Fibonacci spirals, Alexa 2022)."""
    phi, psi = math.sqrt(2.0), 1.533751168755204288118041
    result = np.empty((count, 3, 3))
    for k in range(count):
        s = k + 0.5
        r, R = math.sqrt(s / count), math.sqrt(1.0 - s / count)
        alpha, beta = 2.0 * math.pi * s / phi, 2.0 * math.pi * s / psi
        x, y, z, w = r * math.sin(alpha), r * math.cos(alpha), R * math.sin(beta), R * math.cos(beta)
        result[k, 0] = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)
        result[k, 1] = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)
        result[k, 2] = 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)
    return result
