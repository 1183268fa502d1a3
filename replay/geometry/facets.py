"""Flat pieces of a surface that are there more than once, cut into other triangles each time.

A facet is a set of triangles in one plane that are neighbours across edges which no other triangle has. Facets with the
same boundary are the same piece of the surface, by whatever diagonals each is cut; they are given one's triangles, so
that these are seen to repeat (see `copies`).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from replay.geometry.winding import Sides, components, sides
from replay.numerics.arrays import Floats, Integers

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


def alike(points: Floats, faces: Integers) -> Alike:
    """Return faces (n, 3), indices of points (p, 3) [m], with one cut for all facets that have the same boundary."""
    every = np.arange(len(faces))
    points = points / np.max(np.abs(points))
    found = sides(faces)
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
    edge = np.flatnonzero(found.number == 2)
    at = found.first[edge]
    pairs = np.stack([found.face[at], found.face[at + 1]], axis=1)
    a, b = points[found.ends[edge, 0]], points[found.ends[edge, 1]]
    c, d = (points[faces[face].sum(axis=1) - found.ends[edge].sum(axis=1)] for face in pairs.T)
    normal, opposite = np.cross(b - a, c - a), np.cross(b - a, d - a)
    size = np.sqrt(np.maximum(np.sum(normal * normal, axis=1), np.sum(opposite * opposite, axis=1)))
    volume = np.abs(np.sum(normal * (d - a), axis=1))
    flat = volume <= size * np.minimum(_THIN * np.sqrt(size), ROUNDING)
    turn = np.sum(normal * opposite, axis=1)
    if len(edge) == len(found.number) and not (flat & (turn > 0.0)).any():
        return None
    return np.asarray(pairs[flat & (turn < 0.0)])


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
