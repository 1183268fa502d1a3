"""Flat panels that carry a uniform charge: triangles and parallelograms, as arrays that kernels read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba import boolean, float64

from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.jit import record


class Panels(NamedTuple):
    """n panels: the points origin + a u + b v, of a triangle 0 <= a, b, a + b <= 1, of a parallelogram 0 <= a, b <= 1.

    The sense of a panel does not matter: nothing here knows an inside.
    """

    origin: Floats  # (n, 3) [m], a corner
    u: Floats  # (n, 3) [m], from there to the next corner
    v: Floats  # (n, 3) [m], to the other neighbour
    four: Flags  # (n,) whether it is a parallelogram
    centroid: Floats  # (n, 3) [m]
    diameter: Floats  # (n,) [m], the longest edge or diagonal
    area: Floats  # (n,) [m^2]


PANELS_TYPE = record(
    Panels,
    float64[:, ::1],
    float64[:, ::1],
    float64[:, ::1],
    boolean[::1],
    float64[:, ::1],
    float64[::1],
    float64[::1],
)


def make_panels(origin: Floats, u: Floats, v: Floats, four: Flags) -> Panels:
    """Return panels with what follows from their corners."""
    origin, u, v = (np.ascontiguousarray(array, dtype=np.float64).reshape(-1, 3) for array in (origin, u, v))
    four = np.ascontiguousarray(four, dtype=np.bool_)
    share = np.where(four, 0.5, 1.0 / 3.0)[:, None]
    edges = np.maximum(_length(u), _length(v))
    across = np.maximum(_length(u - v), np.where(four, _length(u + v), 0.0))
    area = _length(np.cross(u, v)) * np.where(four, 1.0, 0.5)
    centroid = np.ascontiguousarray(origin + share * (u + v))
    return Panels(origin, u, v, four, centroid, np.maximum(edges, across), area)


def triangles_as_panels(triangles: Floats) -> Panels:
    """Return triangles (n, 3, 3) [m] as they are."""
    a = triangles[:, 0]
    return make_panels(a, triangles[:, 1] - a, triangles[:, 2] - a, np.zeros(len(triangles), np.bool_))


def joined(parts: Sequence[Panels]) -> Panels:
    """Return all panels of at least one part, in order."""
    arrays: list[Any] = [np.concatenate(column) for column in zip(*parts, strict=True)]
    return Panels(*arrays)


def chosen(panels: Panels, which: Integers | Flags) -> Panels:
    """Return the panels of an index or mask."""
    arrays: list[Any] = [np.ascontiguousarray(array[which]) for array in panels]
    return Panels(*arrays)


def moved(panels: Panels, T: Floats) -> Panels:
    """Return panels placed by a rigid pose (4, 4)."""
    turn = T[:3, :3]
    origin, u, v = _turned(panels.origin, turn) + T[:3, 3], _turned(panels.u, turn), _turned(panels.v, turn)
    centroid = _turned(panels.centroid, turn) + T[:3, 3]
    return Panels(origin, u, v, panels.four, centroid, panels.diameter, panels.area)


def halved(panels: Panels) -> Panels:
    """Return twice as many panels: each is cut at the middle of its longest edge; the halves of one are neighbours."""
    origin, u, v, four = panels.origin, panels.u, panels.v, panels.four
    # a triangle is named anew from the corner that its longest edge begins at
    third = _length(u - v)
    longest = np.argmax(np.stack([_length(u), _length(v), np.where(four, -1.0, third)]), axis=0)
    start = np.where((longest == 2)[:, None], origin + u, origin)
    along = np.choose(longest[:, None], [u, v, v - u])
    other = np.choose(longest[:, None], [v, u, -u])
    half = 0.5 * along
    # of a triangle (start, along, other) the halves are (start, half, other) and (middle, half, other - half)
    second = np.where(four[:, None], other, other - half)
    pair = (np.stack([start, start + half], 1), np.stack([half, half], 1), np.stack([other, second], 1))
    return make_panels(*pair, np.repeat(four, 2))


def _length(vectors: Floats) -> Floats:
    return np.asarray(np.sqrt(np.sum(vectors * vectors, axis=1)))


def _turned(vectors: Floats, turn: Floats) -> Floats:
    """Return vectors turned by a matrix, summed in the same order everywhere (no BLAS)."""
    return np.ascontiguousarray(
        vectors[:, :1] * turn[:, 0] + vectors[:, 1:2] * turn[:, 1] + vectors[:, 2:] * turn[:, 2]
    )
