"""Triangles that a mesh holds more than once, in either sense, and which of them are one too many."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.geometry.winding import Indices, sides
from replay.numerics.rows import distinct_rows


def copies(faces: Indices) -> NDArray[np.bool_]:
    """Return which faces (n,) have the corners of an earlier one, in either sense, and are not needed.

    Needed are the faces that closed bodies share: where two bodies meet in a wall that each of them has, one wall less
    leaves three triangles at each edge around it, and the second one makes them four. Copies are taken wall by wall,
    the smallest first; a sheet's two sides, or a body that is there twice, close nothing that way.
    """
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
        for wall in _walls(faces, np.flatnonzero(rank == layer), edges, count):
            rim = sides(faces[wall])
            at = np.searchsorted(edges, rim.ends[:, 0] * width + rim.ends[:, 1])
            odd = at[rim.number % 2 == 1]
            if len(odd) and ((count[odd] >= 3) & (count[odd] % 2 == 1)).all():
                result[wall] = False
                count[at] += rim.number
    return result


def _walls(faces: Indices, extra: Indices, edges: Indices, count: Indices) -> list[Indices]:
    """Return the copies in groups, smallest first: neighbours across edges of no more than two faces that are kept."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    found = sides(faces[extra])
    keys = found.ends[:, 0] * (int(faces.max()) + 1) + found.ends[:, 1]
    inner = (count[np.searchsorted(edges, keys)] <= 2)[found.edge]
    face, edge = found.face[inner], found.edge[inner]
    links = np.flatnonzero(edge[1:] == edge[:-1])
    graph = coo_array((np.ones(len(links), np.int8), (face[links], face[links + 1])), shape=(len(extra), len(extra)))
    label = connected_components(graph, directed=False)[1]
    order = np.argsort(label, kind="stable")
    walls = np.split(extra[order], np.flatnonzero(np.diff(label[order])) + 1)
    return sorted(walls, key=len)
