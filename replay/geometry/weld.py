"""Corners that an exporter's rounding has parted: which of them are one."""

from __future__ import annotations

from typing import Final

import numpy as np

from replay.geometry.copies import copies
from replay.geometry.facets import alike
from replay.geometry.winding import components, sides
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.extents import extents

TOLERANCES: Final = (1e-12, 1e-9, 1e-6)
"""How far apart corners that are taken for one may be, as shares of the body's largest extent, tried in this order.

The rounding of doubles, what is left of it after a few products, and that of single precision or six written digits.
"""

_CROWD = 50  # of neighbours a corner has on average: so many are a shape of its own
_ROUNDING = TOLERANCES[0]


def weld(points: Floats, faces: Integers, flat: Flags) -> Integers:
    """Return the corner that each corner (p,) is taken for, itself for most.

    Only corners at the ends of open edges are looked at, and they become one only where that closes an edge. No
    triangle that has an area loses it, and, beyond the rounding of doubles, no two triangles become the same: a thin
    wall stays two walls.

    Args:
        points: (p, 3) [m].
        faces: (n, 3) indices of them.
        flat: (n,) which faces have no area.
    """
    from scipy.spatial import cKDTree

    taken_for = np.arange(len(points))
    extent = _extent(points)
    for tolerance in TOLERANCES:
        found = sides(taken_for[faces])
        ends = np.unique(found.ends[found.number % 2 == 1])
        if len(ends) < 2:
            break
        reach = tolerance * extent
        tree = cKDTree(points[ends])
        if tree.count_neighbors(tree, reach) > _CROWD * len(ends):
            continue
        pairs = ends[tree.query_pairs(reach, output_type="ndarray")]
        if len(pairs):
            taken_for = _welded(points, faces, flat, taken_for, pairs, reach, tolerance)
    return taken_for


def _welded(
    points: Floats,
    faces: Integers,
    flat: Flags,
    taken_for: Integers,
    pairs: Integers,
    reach: float,
    tolerance: float,
) -> Integers:
    """Return `taken_for` with those groups of near corners that may become one and close an edge by it."""
    now = taken_for[faces]
    group = components(len(points), pairs)
    allowed = _small(points, group, reach, now[~flat])
    used = np.bincount(now.ravel(), minlength=len(points))
    while True:
        trial = _merged(group, allowed, used)[taken_for]
        then = trial[faces]
        if tolerance > _ROUNDING:  # walls that would become one
            clash = _made_alike(now[~flat], then[~flat])
            moved = now[~flat][clash] != then[~flat][clash]
            worse = np.unique(group[now[~flat][clash][moved]])
            if len(worse):
                worse = np.concatenate([worse, np.unique(group[now[~flat][clash].ravel()])])
                allowed[worse] = False
                continue
        useful = np.zeros(len(allowed), dtype=np.bool_)
        useful[group[_ends_of_closed_edges(now, then)]] = True
        if not (allowed & ~useful).any():
            return trial
        allowed &= useful


def weld_copies(points: Floats, faces: Integers, flat: Flags, *, closed: bool) -> Integers:
    """Return the corner that each corner (p,) is taken for, itself for most: triangles are seen to be copies then.

    Corners become one if the rounding of doubles has parted them, no triangle that has an area loses it, and there are
    more copies among the triangles then (see `copies`). What a few products have parted becomes one, unless the surface
    is `closed`, if fewer edges are open without the copies. Other arguments as of `weld`.
    """
    from scipy.spatial import cKDTree

    itself, named = np.arange(len(points)), np.zeros(len(points), dtype=np.bool_)
    named[faces] = True
    used = np.flatnonzero(named)
    tree = cKDTree(points[used], balanced_tree=False, compact_nodes=False)
    for tolerance in TOLERANCES[: 1 if closed else 2]:
        reach = tolerance * _extent(points)
        if tolerance > _ROUNDING and tree.count_neighbors(tree, reach) > _CROWD * len(used):
            break
        pairs = used[tree.query_pairs(reach, output_type="ndarray")]
        if len(pairs) == 0:
            continue
        group = components(len(points), pairs)
        allowed = _small(points, group, reach, faces[~flat])
        trial = _merged(group, allowed, np.bincount(faces.ravel(), minlength=len(points)))
        (copied, open_), (copied_then, open_then) = _copies(points, faces), _copies(points, trial[faces])
        if copied_then > copied and (tolerance == _ROUNDING or open_then < open_):
            return trial
    return itself


def _extent(points: Floats) -> float:
    lower, upper = extents(points)
    return float(np.max(upper - lower))


def _copies(points: Floats, faces: Integers) -> tuple[int, int]:
    """Return how many faces are copies, and how many edges are open without them."""
    cut = alike(points, faces).faces
    again = copies(cut)
    return int(np.count_nonzero(again)), int(np.count_nonzero(sides(cut[~again]).number % 2))


def _small(points: Floats, group: Integers, reach: float, faces: Integers) -> Flags:
    """Return which groups of several corners are no larger than `reach`, and hold no two of one face."""
    size = np.bincount(group)
    low, high = np.full((len(size), 3), np.inf), np.full((len(size), 3), -np.inf)
    np.minimum.at(low, group, points)
    np.maximum.at(high, group, points)
    allowed = (size > 1) & (np.max(high - low, axis=1) <= reach)
    for a, b in ((0, 1), (1, 2), (2, 0)):
        same = (group[faces[:, a]] == group[faces[:, b]]) & (faces[:, a] != faces[:, b])
        allowed[group[faces[same, a]]] = False
    return np.asarray(allowed)


def _merged(group: Integers, allowed: Flags, used: Integers) -> Integers:
    """Return the corner that each one is taken for when the allowed groups are one: the one used most, the first."""
    order = np.lexsort([np.arange(len(group)), -used, group])
    heads = np.empty(len(allowed), dtype=np.int64)
    first = np.flatnonzero(np.diff(group[order], prepend=-1))
    heads[group[order[first]]] = order[first]
    return np.where(allowed[group], heads[group], np.arange(len(group)))


def _made_alike(now: Integers, then: Integers) -> Flags:
    """Return which faces (n,) have the corners of another one then, but not now."""

    def kinds(faces: Integers) -> Integers:
        return np.asarray(np.unique(np.sort(faces, axis=1), axis=0, return_inverse=True)[1]).ravel()

    before, after = kinds(now), kinds(then)
    pairs = np.unique(np.stack([after, before], axis=1), axis=0)
    several = np.bincount(pairs[:, 0], minlength=int(after.max(initial=0)) + 1) > 1
    return np.asarray(several[after])


def _ends_of_closed_edges(now: Integers, then: Integers) -> Integers:
    """Return the corners, as they are now, at the ends of open edges that are not open then."""
    before = sides(now)
    odd = before.ends[before.number % 2 == 1]
    after = sides(then)
    open_then = {tuple(pair) for pair in after.ends[after.number % 2 == 1].tolist()}
    name = np.arange(int(max(now.max(initial=0), then.max(initial=0))) + 1)
    name[now.ravel()] = then.ravel()
    renamed = np.sort(name[odd], axis=1)
    closed = [tuple(pair) not in open_then for pair in renamed.tolist()]
    return np.unique(odd[np.array(closed, dtype=np.bool_)])
