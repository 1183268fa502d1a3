"""Triangles that a mesh holds more than once, in either sense, and which of them are one too many."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from replay.geometry.winding import Sides, components, sides
from replay.numerics.arrays import Flags, Integers
from replay.numerics.rows import distinct_rows

_MOST_TOGETHER = 200  # walls that close something only together


def copies(faces: Integers, found: Sides | None = None) -> Flags:
    """Return which faces (n,) have the corners of an earlier one, in either sense, and are not needed.

    Args:
        faces: (n, 3).
        found: `sides(faces)` if they are at hand: what has two different faces at each edge holds no copies.

    Needed are the faces that closed bodies share: where two bodies meet in a wall that each of them has, one wall less
    leaves three triangles at each edge around it, and the second one makes them four. Copies are taken wall by wall,
    the smallest first, then walls that meet together; a sheet's two sides, or a body that is there twice, close nothing
    that way.
    """
    if found is not None and (found.number == 2).all():
        first, second = found.face.reshape(-1, 2).T
        if not (faces[first].sum(axis=1) == faces[second].sum(axis=1)).any():
            return np.zeros(len(faces), dtype=np.bool_)
    kind = distinct_rows(np.sort(faces, axis=1)).kind
    order = np.argsort(kind, kind="stable")
    begin = np.flatnonzero(np.diff(kind[order], prepend=-1))
    rank = np.empty(len(faces), dtype=np.int64)
    rank[order] = np.arange(len(faces)) - np.repeat(begin, np.diff(begin, append=len(faces)))
    result = rank > 0
    if not result.any():
        return result
    width = int(faces.max()) + 1
    kept = sides(faces[~result])
    edges, count = kept.ends[:, 0] * width + kept.ends[:, 1], kept.number  # those of copies are among them
    for layer in range(1, int(rank.max()) + 1):
        left: list[_Wall] = []
        for wall in _walls(faces, np.flatnonzero(rank == layer), edges, count):
            around = sides(faces[wall])
            at = np.searchsorted(edges, around.ends[:, 0] * width + around.ends[:, 1])
            left.append(_Wall(wall, at, around.number))
        for needed in _needed(left, count):
            result[needed.faces] = False
    return result


class _Wall(NamedTuple):
    """A wall: its faces, the edges at them, and how many of its faces each of these has."""

    faces: Integers
    edges: Integers
    number: Integers

    @property
    def rim(self) -> Integers:
        return np.asarray(self.edges[self.number % 2 == 1])


def _needed(walls: list[_Wall], count: Integers) -> list[_Wall]:
    """Return the walls that close what is open without them, alone or several that meet, and add them to `count`.

    Args:
        walls: smallest first.
        count: (e,) faces that are kept at each edge.
    """
    found: list[_Wall] = []
    waiting = [wall for wall in walls if len(wall.rim) and (count[wall.rim] >= 3).all()]
    for wall in list(waiting):
        if (count[wall.rim] % 2 == 1).all():
            count[wall.edges] += wall.number
            found.append(wall)
            waiting = [other for other in waiting if other is not wall]
    # where several walls meet at an edge it takes all of them
    while waiting:
        group = [waiting.pop(0)]
        touched = set(group[0].rim.tolist())
        closed = False
        grown = True
        while grown and not closed and len(group) < _MOST_TOGETHER:
            rims = np.concatenate([wall.rim for wall in group])
            at, more = np.unique(rims, return_counts=True)
            closed = bool(((count[at] + more) % 2 == 0).all() and (count[at] % 2 == 1).any())
            grown = False
            for k, other in enumerate(waiting):
                if not closed and not touched.isdisjoint(other.rim.tolist()):
                    group.append(waiting.pop(k))
                    touched |= set(other.rim.tolist())
                    grown = True
                    break
        if closed:
            for wall in group:
                count[wall.edges] += wall.number
            found += group
    return found


def _walls(faces: Integers, extra: Integers, edges: Integers, count: Integers) -> list[Integers]:
    """Return the copies in groups, smallest first: neighbours across edges of no more than two faces that are kept."""
    found = sides(faces[extra])
    keys = found.ends[:, 0] * (int(faces.max()) + 1) + found.ends[:, 1]
    inner = (count[np.searchsorted(edges, keys)] <= 2)[found.edge]
    face, edge = found.face[inner], found.edge[inner]
    links = np.flatnonzero(edge[1:] == edge[:-1])
    label = components(len(extra), np.stack([face[links], face[links + 1]], axis=1))
    order = np.argsort(label, kind="stable")
    walls = np.split(extra[order], np.flatnonzero(np.diff(label[order])) + 1)
    return sorted(walls, key=len)
