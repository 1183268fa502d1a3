"""Flat pieces of a surface that are there more than once, cut into other triangles each time.

A facet is a set of triangles in one plane that are neighbours across edges which no other triangle has. Facets with the
same boundary are the same piece of the surface, by whatever diagonals each is cut; they are given one's triangles, so
that these are seen to repeat (see `copies`).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import float64, int64

from replay.geometry.winding import Sides, components, sides
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel

ROUNDING: Final = 2.0**-22
"""How far from its plane a corner of a flat piece may be, in parts of the largest coordinate.

STL and GLB keep 24 bits of a coordinate, so corners leave their true place by 2^-25 of it each; three corners of a face
and the one tested add up to less than this for all but slivers.
"""

_THIN = 1e-3  # of its own size: a body that is no flatter than this is one, however small it is


class Alike(NamedTuple):
    """Faces of which some facets have those of another one.

    Attributes:
        faces: (m, 3).
        source: (m,) the face that has the same corners among those given.
    """

    faces: Integers
    source: Integers


def alike(points: Floats, faces: Integers, found: Sides | None = None) -> Alike:
    """Return faces (n, 3), indices of points (p, 3) [m], with one cut for all facets that have the same boundary.

    Args:
        found: `sides(faces)` if they are at hand.
    """
    every = np.arange(len(faces))
    points = points / np.max(np.abs(points))
    found = sides(faces) if found is None else found
    joined = _joined(points, faces, found)
    if joined is None:
        return Alike(faces, every)
    label = components(len(faces), joined)
    new, sources, dropped = [], [], np.zeros(len(faces), dtype=np.bool_)
    members = np.argsort(label, kind="stable")
    begin = np.searchsorted(label[members], np.arange(int(label.max()) + 2))
    for group in _same_boundary(found, label):
        facets = sorted((members[begin[facet] : begin[facet + 1]] for facet in group), key=len)
        area = [_area(points, faces[facet]) for facet in facets]
        if not _in_one_plane(points[faces[np.concatenate(facets)]], area[0]):
            continue
        for facet, its_area in zip(facets[1:], area[1:], strict=True):
            turned = float(np.sum(area[0] * its_area)) < 0.0
            new.append(faces[facets[0]][:, ::-1] if turned else faces[facets[0]])
            sources.append(facets[0])
            dropped[facet] = True
    if not new:
        return Alike(faces, every)
    return Alike(np.concatenate([faces[~dropped], *new]), np.concatenate([every[~dropped], *sources]))


def _joined(points: Floats, faces: Integers, found: Sides) -> Integers | None:
    """Return the pairs (k, 2) of faces that are in one facet; None where no facet can be there more than once.

    One that is has at each edge of its boundary either more than two faces, or two that lie on each other.
    """
    flat = _flat_edges(points, faces, found.face, found.first, found.ends)
    if (found.number == 2).all() and not (flat > 0).any():
        return None
    at = found.first[:-1][flat < 0]
    return np.stack([found.face[at], found.face[at + 1]], axis=1)


@entry(float64[:, ::1], int64[:, ::1], int64[::1], int64[::1], int64[:, ::1])
@kernel
def _flat_edges(points: Floats, faces: Integers, face: Integers, first: Integers, ends: Integers) -> Integers:
    """Return at which edges (e,) two faces are in one plane: beside each other -1, on each other 1; else 0."""
    result = np.zeros(len(ends), np.int64)
    for edge in range(len(ends)):
        if first[edge + 1] - first[edge] != 2:
            continue
        low, high = ends[edge]
        a, b = points[low], points[high]
        one, other = faces[face[first[edge]]], faces[face[first[edge] + 1]]
        c, d = points[one[0] + one[1] + one[2] - low - high], points[other[0] + other[1] + other[2] - low - high]
        x, y, z = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        cx, cy, cz, dx, dy, dz = c[0] - a[0], c[1] - a[1], c[2] - a[2], d[0] - a[0], d[1] - a[1], d[2] - a[2]
        nx, ny, nz = y * cz - z * cy, z * cx - x * cz, x * cy - y * cx
        ox, oy, oz = y * dz - z * dy, z * dx - x * dz, x * dy - y * dx
        size = math.sqrt(max(nx * nx + ny * ny + nz * nz, ox * ox + oy * oy + oz * oz))
        volume = abs(nx * dx + ny * dy + nz * dz)
        if volume <= size * min(_THIN * math.sqrt(size), ROUNDING):
            turn = nx * ox + ny * oy + nz * oz
            result[edge] = 1 if turn > 0.0 else (-1 if turn < 0.0 else 0)
    return result


def _same_boundary(found: Sides, label: Integers) -> list[list[int]]:
    """Return the facets that have the same boundary, in groups; those alone that are cut in different ways."""
    count = int(label.max()) + 1
    key, times = np.unique(found.edge * count + label[found.face], return_counts=True)
    edge, facet = np.divmod(key[times == 1], count)
    order = np.argsort(facet, kind="stable")
    edge, begin = edge[order], np.searchsorted(facet[order], np.arange(count + 1))
    whole = np.flatnonzero(begin[1:] > begin[:-1])  # a closed surface has no boundary
    if len(whole) == 0:
        return []
    mark = np.random.default_rng(1).integers(2**62, size=len(found.ends), dtype=np.uint64)
    total = np.add.reduceat(mark[edge], begin[whole])  # equal where the edges are
    kind = np.unique(total, return_inverse=True)[1]
    size = np.bincount(label)[whole]
    several = (np.bincount(kind) > 1) & (np.bincount(kind, weights=size) > np.bincount(kind))
    groups: dict[tuple[int, bytes], list[int]] = {}
    for k in np.flatnonzero(several[kind]).tolist():
        its_edges = edge[begin[whole[k]] : begin[whole[k] + 1]]
        groups.setdefault((int(kind[k]), its_edges.tobytes()), []).append(int(whole[k]))
    return [group for group in groups.values() if len(group) > 1]


def _area(points: Floats, faces: Integers) -> Floats:
    """Return twice the area of faces as a vector (3,)."""
    a, b, c = np.moveaxis(points[faces], 1, 0)
    return np.asarray(np.cross(b - a, c - a).sum(axis=0))


def _in_one_plane(triangles: Floats, area: Floats) -> bool:
    """Return whether triangles (n, 3, 3) of the size of 1 lie in the plane that the vector `area` (3,) stands on."""
    size = float(np.sqrt(np.sum(area * area)))
    height = np.sum((triangles - triangles[0, 0]) * area, axis=2)
    most = min(_THIN * np.sqrt(size), ROUNDING)
    return bool(np.max(np.abs(height)) <= most * size)
