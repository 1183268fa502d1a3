"""The parts of a surface: which triangles hang together, and how they are turned so that each is wound one way.

Across an edge of two triangles these are neighbours. Where more meet, bodies touch or walls branch off: first each
part's own two are neighbours, then the others are paired, those that are wound one way and bound the thinnest wedge
first, but no two that lie on each other while there are others. So two bodies that share an edge or a wall stay two
parts.
"""

from __future__ import annotations

import itertools
import math
from typing import NamedTuple

import numpy as np

from replay.geometry.winding import Sides, components, sides
from replay.numerics.arrays import Flags, Floats, Integers

Link = tuple[int, int, bool]

_NO_WEDGE = 1e-9  # [rad]
_MOST_AT_EDGE = 16  # triangles at one edge that are paired; more are no bodies that touch


class Parts(NamedTuple):
    """The parts of n faces.

    Attributes:
        label: (n,) which part each face belongs to, from 0.
        turned: (n,) which faces are wound against the others of their part, the smaller number of them.
        closed: (parts,) whether the part is closed and wound one way once these are turned.
        one_sided: (parts,) whether no winding fits.
    """

    label: Integers
    turned: Flags
    closed: Flags
    one_sided: Flags


def find_parts(points: Floats, faces: Integers, found: Sides | None = None) -> Parts:
    """Return the parts of faces (n, 3), indices of points (p, 3). One-sided parts are left as they are wound.

    Args:
        found: `sides(faces)` if they are at hand.
    """
    found = sides(faces) if found is None else found
    at = found.first[:-1][found.number == 2]
    pairs = np.stack([found.face[at], found.face[at + 1], found.forward[at] == found.forward[at + 1]], axis=1)
    several = np.flatnonzero(found.number > 2)
    if len(several):
        joined = _Joined(components(len(faces), pairs))
        more = [link for edge in several.tolist() for link in _pair_up(points, faces, found, edge, joined)]
        pairs = np.concatenate([pairs, np.array(more, dtype=np.int64).reshape(-1, 3)])
    label = components(len(faces), pairs)
    turned, one_sided = _against(label, pairs)
    if turned.any():  # where several meet, neighbours are a guess: what is closed as it is wound stays
        turned &= ~_closed(found, label)[label]
    if turned.any():
        found = sides(np.where(turned[:, None], faces[:, [0, 2, 1]], faces))
    return Parts(label, turned, _closed(found, label), one_sided)


class _Joined:
    """Which part each face belongs to, as far as it is known, while parts are joined."""

    def __init__(self, label: Integers) -> None:
        self._label = label
        self._joined_to: dict[int, int] = {}

    def part(self, face: int) -> int:
        label = int(self._label[face])
        while label in self._joined_to:
            label = self._joined_to[label]
        return label

    def join(self, a: int, b: int) -> None:
        first, second = self.part(a), self.part(b)
        if first != second:
            self._joined_to[second] = first


def _against(label: Integers, pairs: Integers) -> tuple[Flags, Flags]:
    """Return which faces to turn over so that neighbours agree, the smaller number of each part; which are one-sided.

    Each face stands twice, as it is and turned over, and is joined to its neighbours as they agree with it. The copies
    fall into two sets a part, one the opposite of the other, unless the part is one-sided.
    """
    count, (a, b, differ) = len(label), pairs.T
    if not differ.any():
        return np.zeros(count, dtype=np.bool_), np.zeros(int(label.max()) + 1, dtype=np.bool_)
    twice = components(
        2 * count,
        np.concatenate([np.stack([a, b + differ * count], axis=1), np.stack([a + count, b + (1 - differ) * count], 1)]),
    )
    first = np.unique(label, return_index=True)[1]
    one_sided = twice[first] == twice[first + count]
    turned = (twice[:count] != twice[first][label]) & ~one_sided[label]
    most = 2 * np.bincount(label, weights=turned) > np.bincount(label)
    return turned ^ most[label], one_sided


def _pair_up(points: Floats, faces: Integers, found: Sides, edge: int, joined: _Joined) -> list[Link]:
    """Return the neighbours across an edge of more than two faces, and join their parts."""
    at = range(found.first[edge], found.first[edge + 1])
    if len(at) > _MOST_AT_EDGE:
        return []
    own: dict[int, list[int]] = {}
    for k in at:
        own.setdefault(joined.part(int(found.face[k])), []).append(k)
    links: list[Link] = []
    left: list[int] = []
    for same in own.values():
        if len(same) == 2:
            links.append(_link(found, *same))
        else:
            left.extend(same)
    angle = dict(zip(left, _angles(points, faces, found, edge, left), strict=True))

    balanced = 2 * sum(bool(found.forward[k]) for k in left) == len(left)

    def cost(pair: tuple[int, int]) -> tuple[bool, bool, float, bool, int]:
        a, b = pair
        between = abs(angle[a] - angle[b])
        between = min(between, 2.0 * math.pi - between)
        same_way = bool(found.forward[a] == found.forward[b])
        return between < _NO_WEDGE, balanced and same_way, round(between, 9), same_way, abs(a - b)

    for a, b in sorted(itertools.combinations(left, 2), key=cost):
        if a in angle and b in angle:
            links.append(_link(found, a, b))
            joined.join(int(found.face[a]), int(found.face[b]))
            del angle[a], angle[b]
    return links


def _link(found: Sides, a: int, b: int) -> Link:
    return int(found.face[a]), int(found.face[b]), bool(found.forward[a] == found.forward[b])


def _angles(points: Floats, faces: Integers, found: Sides, edge: int, which: list[int]) -> list[float]:
    """Return how far the faces are turned about an edge [rad], from any direction."""
    low, high = found.ends[edge]
    start, way = points[low], points[high] - points[low]
    across = np.eye(3)[int(np.argmin(np.abs(way)))]
    u = np.cross(way, across)
    v = np.cross(way, u) / np.sqrt(np.sum(way * way))
    angles = []
    for k in which:
        third = next((c for c in faces[found.face[k]].tolist() if c not in (low, high)), low)
        d = points[third] - start
        angles.append(math.atan2(float(np.sum(v * d)), float(np.sum(u * d))))
    return angles


def _closed(found: Sides, label: Integers) -> Flags:
    """Return which parts are closed: walked equally often both ways along each edge, within the part."""
    of_part = label[found.face]
    key = found.edge * (int(label.max()) + 1) + of_part
    steps = np.where(found.forward, 1, -1)
    order = np.argsort(key, kind="stable")
    begin = np.flatnonzero(np.diff(key[order], prepend=-1))
    balance = np.add.reduceat(steps[order], begin) if len(begin) else np.zeros(0, np.int64)
    closed = np.ones(int(label.max()) + 1, dtype=np.bool_)
    closed[of_part[order][begin[balance != 0]]] = False
    return closed
