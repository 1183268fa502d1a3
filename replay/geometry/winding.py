"""How a surface's triangles are joined: whether it is closed, and wound one way round."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.rows import distinct_rows

Array = NDArray[np.float64]
Indices = NDArray[np.int64]


class Topology(NamedTuple):
    """What keeps a surface from being closed and wound one way.

    Attributes:
        open_edges: edges with an odd number of triangles.
        reversed_edges: other edges that are not walked equally often both ways.
    """

    open_edges: int
    reversed_edges: int

    @property
    def is_closed(self) -> bool:
        """Whether the surface has an inside."""
        return self.open_edges == 0 and self.reversed_edges == 0


def corner_indices(triangles: Array) -> Indices:
    """Return the corners of triangles (n, 3, 3) as indices (n, 3); corners are one where they are exactly equal."""
    corners = distinct_rows(triangles.reshape(-1, 3) + 0.0).kind
    return corners.reshape(-1, 3).astype(np.int64)


def topology(faces: Indices) -> Topology:
    """Return the topology of a surface of faces (n, 3), corner indices."""
    _, forward, edge = _edges(faces)
    total = np.bincount(edge)
    balance = np.bincount(edge, weights=np.where(forward, 1.0, -1.0))
    odd = total % 2 == 1
    return Topology(int(np.count_nonzero(odd)), int(np.count_nonzero(~odd & (balance != 0.0))))


def wound_against_neighbours(faces: Indices) -> NDArray[np.bool_]:
    """Return which faces (n,) to turn over so that neighbours across an edge of two triangles agree.

    Of each connected part the smaller number of faces is turned, so that a cavity keeps facing inwards. A one-sided
    surface has no answer: whether the result is wound one way is for the caller to check.
    """
    face, forward, edge = _edges(faces)
    order = np.argsort(edge, kind="stable")
    face, forward, edge = face[order], forward[order], edge[order]
    first = np.flatnonzero(np.diff(edge, prepend=-1))
    pairs = first[np.diff(first, append=len(edge)) == 2]
    near: list[list[tuple[int, bool]]] = [[] for _ in range(len(faces))]
    against = forward[pairs] == forward[pairs + 1]
    for a, b, differ in zip(face[pairs].tolist(), face[pairs + 1].tolist(), against.tolist(), strict=True):
        near[a].append((b, differ))
        near[b].append((a, differ))
    turned = np.zeros(len(faces), dtype=np.bool_)
    seen = [False] * len(faces)
    for start in range(len(faces)):
        if seen[start]:
            continue
        seen[start] = True
        part = [start]
        for at in part:  # grows while it is walked
            for other, differ in near[at]:
                if not seen[other]:
                    seen[other] = True
                    turned[other] = turned[at] != differ
                    part.append(other)
        if 2 * np.count_nonzero(turned[part]) > len(part):
            turned[part] = ~turned[part]
    return turned


def _edges(faces: Indices) -> tuple[Indices, NDArray[np.bool_], Indices]:
    """Return (face, whether it is walked from the lower corner, undirected edge) of all sides between two corners."""
    face = np.repeat(np.arange(len(faces)), 3)
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    keep = start != end
    face, start, end = face[keep], start[keep], end[keep]
    key = np.minimum(start, end) * (faces.max() + 1) + np.maximum(start, end)
    _, edge = np.unique(key, return_inverse=True)
    return face, start < end, edge.astype(np.int64)
