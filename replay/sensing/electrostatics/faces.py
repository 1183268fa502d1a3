"""The flat faces of a surface: triangles, and parallelograms that pairs of them make, with what lies at their edges.

A grid that is fine at the edges of a conductor, where charge gathers, takes a tenth of the panels of a uniform one. It
needs parallelograms, and to know which of their edges are sharp. A triangle that is there twice would make the
influences singular, so it counts once; one without area carries nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.numerics.arrays import Floats, Integers
from replay.sensing.electrostatics.panels import Panels, make_panels

_SAME = 1e-9
"""Corners closer than this share of the extent are one."""

_FLAT = 1e-6
"""Deviation of a pair of triangles from a parallelogram, in its edges."""

_SLIVER = 1e-9
"""Height over longest edge below which a triangle has no area."""

_BENT = 0.8
"""Cosine of the angle between two normals below which the edge between their faces is sharp."""

SMOOTH, BENT, OPEN = 1.0, 2.0, 2.5
"""What lies at an edge of a parallelogram, as the exponent of the grid towards it: the surface goes on smoothly; goes
on at an angle; ends."""


@dataclass(frozen=True, eq=False)
class Faces:
    """n faces.

    Attributes:
        panels: the faces.
        edges: (n, 4) exponents at the edges b = 0, b = 1, a = 0, a = 1 of parallelograms; see `panels.Panels`.
    """

    panels: Panels
    edges: Floats


def faces_of(triangles: Floats) -> Faces:
    """Return the faces of a surface of triangles (n, 3, 3) [m]; none where no triangle has area."""
    triangles, corners = _counted_once(np.asarray(triangles, dtype=np.float64))
    if len(triangles) == 0:
        nothing = np.zeros((0, 3))
        return Faces(make_panels(nothing, nothing, nothing, np.zeros(0, np.bool_)), np.zeros((0, 4)))
    first, second = _pairs(triangles, corners)
    alone = np.setdiff1d(np.arange(len(triangles)), np.concatenate([first, second]))
    # the longest edge, the diagonal, goes from corner 0 to corner 1; corner 2 lies opposite
    origin, u, v = triangles[first, 2], triangles[first, 0], triangles[first, 1]
    panels = make_panels(
        np.concatenate([origin, triangles[alone, 0]]),
        np.concatenate([u - origin, triangles[alone, 1] - triangles[alone, 0]]),
        np.concatenate([v - origin, triangles[alone, 2] - triangles[alone, 0]]),
        np.arange(len(first) + len(alone)) < len(first),
    )
    o, a, b, opposite = corners[first, 2], corners[first, 0], corners[first, 1], corners[second, 2]
    keys = np.stack(
        [np.stack([o, a], 1), np.stack([b, opposite], 1), np.stack([o, b], 1), np.stack([a, opposite], 1)], 1
    )
    return Faces(panels, _edges(panels, keys, corners[alone]))


def _counted_once(triangles: Floats) -> tuple[Floats, Integers]:
    """Return the triangles (n, 3, 3) that count, longest edge first, and the numbers (n, 3) of their corners."""
    lengths = np.linalg.norm(np.roll(triangles, -1, axis=1) - triangles, axis=2)
    longest = np.argmax(lengths, axis=1)
    triangles = np.take_along_axis(triangles, ((longest[:, None] + np.arange(3)) % 3)[:, :, None], axis=1)
    size = lengths.max(axis=1, initial=0.0)
    double = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    triangles = triangles[double > _SLIVER * size * size]
    if len(triangles) == 0:
        return triangles, np.zeros((0, 3), np.int64)
    points = triangles.reshape(-1, 3)
    step = _SAME * max(float(np.max(np.ptp(points, axis=0))), 1e-300)
    grid = np.round((points - points.min(axis=0)) / step)
    corners = np.unique(grid, axis=0, return_inverse=True)[1].reshape(-1, 3).astype(np.int64)
    kept = np.sort(np.unique(np.sort(corners, axis=1), axis=0, return_index=True)[1])
    return triangles[kept], corners[kept]


def _pairs(triangles: Floats, corners: Integers) -> tuple[Integers, Integers]:
    """Return pairs of triangles that make a parallelogram across the longest edge of both."""
    order = np.lexsort((*np.sort(corners[:, :2], axis=1).T,))
    keys = np.sort(corners[order][:, :2], axis=1)
    same = np.all(keys[1:] == keys[:-1], axis=1)
    # exactly two
    before, after = np.append(False, same[:-1]), np.append(same[1:], False)
    at = np.flatnonzero(same & ~before & ~after)
    first, second = order[at], order[at + 1]
    a, b = triangles[first], triangles[second]
    defect = np.linalg.norm(a[:, 2] + b[:, 2] - a[:, 0] - a[:, 1], axis=1)
    good = defect <= _FLAT * np.linalg.norm(a[:, 1] - a[:, 0], axis=1)
    return first[good], second[good]


def _edges(panels: Panels, keys: Integers, triangles: Integers) -> Floats:
    """Return the exponents at the edges of all faces; keys (m, 4, 2) are the corners of the parallelograms."""
    m = len(keys)
    result = np.full((len(panels.area), 4), SMOOTH)
    sides = np.stack([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]], axis=1)
    everything = np.sort(np.concatenate([keys.reshape(-1, 2), sides.reshape(-1, 2)]), axis=1)
    face = np.concatenate([np.repeat(np.arange(m), 4), np.repeat(m + np.arange(len(triangles)), 3)])
    number, count = np.unique(everything, axis=0, return_inverse=True, return_counts=True)[1:]
    number = number.ravel()
    normal = np.cross(panels.u, panels.v)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    order = np.argsort(number, kind="stable")
    begin = np.concatenate([[0], np.cumsum(count)[:-1]])
    first, last = face[order[begin]], face[order[begin + count - 1]]
    bent = (count > 2) | (np.abs(np.sum(normal[first] * normal[last], axis=1)) < _BENT)
    kind = np.where(count == 1, OPEN, np.where(bent, BENT, SMOOTH))
    result[:m] = kind[number[: 4 * m]].reshape(m, 4)
    return result
