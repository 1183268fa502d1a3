"""How a surface's triangles are joined: whether it is closed, and wound one way round."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.rows import distinct_rows


class Sides(NamedTuple):
    """The sides of faces, but for those from a corner to itself, sorted by the edge they lie on.

    Attributes:
        face: (s,) the face of each side.
        forward: (s,) whether it is walked from the lower corner to the higher.
        first: (e + 1,) where the sides of each edge begin; the last entry closes the list.
        ends: (e, 2) the lower and the higher corner of each edge.
    """

    face: Integers
    forward: Flags
    first: Integers
    ends: Integers

    @property
    def number(self) -> Integers:
        """How many sides lie on each edge (e,)."""
        return np.diff(self.first)

    @property
    def edge(self) -> Integers:
        """The edge of each side (s,)."""
        return np.repeat(np.arange(len(self.ends)), self.number)

    @property
    def balance(self) -> Integers:
        """How much oftener each edge (e,) is walked forward than back; all 0: the surface is closed."""
        steps = np.concatenate([[0], np.cumsum(np.where(self.forward, 1, -1))])
        return np.asarray(np.diff(steps[self.first]), dtype=np.int64)


class Topology(NamedTuple):
    """What keeps a surface from being closed and wound one way.

    Attributes:
        open_edges: edges of one triangle.
        crowded_edges: edges of an odd number of triangles, three or more.
        reversed_edges: other edges that are not walked equally often both ways.
    """

    open_edges: int
    crowded_edges: int
    reversed_edges: int

    @property
    def is_closed(self) -> bool:
        """Whether the surface has an inside."""
        return self.open_edges == 0 and self.crowded_edges == 0 and self.reversed_edges == 0


def corner_indices(triangles: Floats) -> tuple[Floats, Integers]:
    """Return the corners of triangles (n, 3, 3) as points (p, 3) and indices (n, 3) of them.

    Corners are one where they are exactly equal.
    """
    corners = distinct_rows(triangles.reshape(-1, 3) + 0.0)
    return corners.rows, corners.kind.reshape(-1, 3).astype(np.int64)


def sides(faces: Integers) -> Sides:
    """Return the sides of faces (n, 3), corner indices."""
    face = np.repeat(np.arange(len(faces)), 3)
    start, end = faces.ravel(), faces[:, [1, 2, 0]].ravel()
    keep = start != end
    face, start, end = face[keep], start[keep], end[keep]
    low, high = np.minimum(start, end), np.maximum(start, end)
    key, order = _sorted(low * (int(faces.max(initial=0)) + 1) + high)
    first = np.flatnonzero(np.concatenate([[True], key[1:] != key[:-1]])) if len(key) else np.zeros(0, np.int64)
    ends = np.stack([low[order][first], high[order][first]], axis=1)
    return Sides(face[order], (start < end)[order], np.append(first, len(key)), ends)


def _sorted(keys: Integers) -> tuple[Integers, Integers]:
    """Return whole numbers >= 0 in order, and their places; equal ones as they came.

    A key and its place in one number are sorted at once, as far as 63 bits hold them.
    """
    bits = len(keys).bit_length()
    if int(keys.max(initial=0)) >> (63 - bits):
        order = np.argsort(keys, kind="stable")
        return keys[order], order
    both = np.sort(keys << bits | np.arange(len(keys)))
    return both >> bits, both & ((1 << bits) - 1)


def topology(found: Sides) -> Topology:
    """Return the topology of a surface whose faces have these sides."""
    count = found.number
    odd = count % 2 == 1
    turned = ~odd & (found.balance != 0)
    return Topology(*(int(np.count_nonzero(kind)) for kind in (count == 1, odd & (count > 1), turned)))


def components(count: int, pairs: Integers) -> Integers:
    """Return which component (count,) each of `count` things is in, where pairs (k, 2) are joined."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    graph = coo_array((np.ones(len(pairs), np.int8), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.int64)
