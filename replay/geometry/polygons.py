"""Polygons of mesh files as triangles: a fan from the first corner where that is right, else ears cut off."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from replay import limits
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.rows import distinct_rows

_FOLD = 1e-6  # of a polygon's area: a triangle that turns back by less is the rounding of a straight edge


def triangulate(points: Floats, corners: Sequence[int] | Integers, lengths: Sequence[int] | Integers) -> Integers:
    """Return the triangles (f, 3) of polygons, in order.

    Args:
        points: (p, 3).
        corners: (c,) the corners of all polygons, one after the other; none is checked.
        lengths: (n,) how many of them each polygon has, at least three.

    Raises:
        ValueError: there are more triangles or corners than are read.
    """
    corners, lengths = np.asarray(corners, dtype=np.int64), np.asarray(lengths, dtype=np.int64)
    if len(lengths) and lengths.max() > limits.POLYGON:
        raise ValueError(f"it has a polygon of {lengths.max()} corners; at most {limits.POLYGON} are read")
    sizes = lengths - 2
    if sizes.sum() > limits.TRIANGLES:
        raise ValueError(f"it has {sizes.sum()} triangles; at most {limits.TRIANGLES} are read")
    start = np.cumsum(lengths) - lengths
    first = np.repeat(start, sizes)
    step = np.arange(len(first)) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    fans: Integers = corners[np.stack([first, first + step + 1, first + step + 2], axis=1)]
    if len(fans) == len(lengths) or fans.min() < 0 or fans.max() >= len(points):
        return fans  # triangles alone, or corners that are none, for who checks them
    folded = np.flatnonzero(_folded(points[fans], sizes))
    place = distinct_rows(points).kind
    again = _again(place[corners], start, lengths)
    if len(folded) == 0 and len(again) == 0:
        return fans
    if len(folded) + len(again) > limits.FOLDED_POLYGONS:
        rule = f"it has {len(folded) + len(again)} polygons that are not convex or are there twice"
        raise ValueError(f"{rule}; at most {limits.FOLDED_POLYGONS} are split: save it as triangles")
    several = np.split(fans, np.cumsum(sizes)[:-1])
    polygons = np.split(corners, start[1:])
    for polygon in folded.tolist():
        several[polygon] = polygons[polygon][_ears(points[polygons[polygon]])]
    for polygon, earlier in again:
        several[polygon] = _split_alike(polygons[polygon], several[earlier], place)
    return np.concatenate(several)


def _again(places: Integers, start: Integers, lengths: Integers) -> list[tuple[int, int]]:
    """Return which polygons of more than three corners have those of an earlier one, in either sense, and which one."""
    mark = np.random.default_rng(1).integers(2**62, size=int(places.max(initial=0)) + 1, dtype=np.uint64)
    total = np.add.reduceat(mark[places], start)  # equal where the corners are
    first = np.unique(total, return_index=True, return_inverse=True)
    earlier = first[1][first[2]]
    found = []
    for polygon in np.flatnonzero((earlier != np.arange(len(start))) & (lengths > 3)).tolist():
        a, b = (places[start[k] : start[k] + lengths[k]].tolist() for k in (earlier[polygon], polygon))
        if len(set(a)) == len(a) and a[0] in b:
            turn = b.index(a[0])
            if a in (b[turn:] + b[:turn], b[turn::-1] + b[:turn:-1]):
                found.append((polygon, int(earlier[polygon])))
    return found


def _split_alike(polygon: Integers, triangles: Integers, place: Integers) -> Integers:
    """Return a polygon's triangles with the diagonals of those of an earlier one, in its own sense.

    A face that is there twice, once from each side, would else be four triangles that differ.
    """
    corner = {int(place[k]): int(k) for k in polygon}
    found = np.array([[corner[int(place[k])] for k in triangle] for triangle in triangles], dtype=np.int64)
    after = dict(zip(polygon.tolist(), np.roll(polygon, -1).tolist(), strict=True))
    forward = any(after[int(a)] == int(b) for face in found for a, b in zip(face, np.roll(face, -1), strict=True))
    return found if forward else found[:, ::-1]


def _folded(triangles: Floats, sizes: Integers) -> Flags:
    """Return which polygons (n,) a fan covers wrongly: of it a triangle turns back over the others.

    Args:
        triangles: (f, 3, 3), corners of the triangles of the fans.
        sizes: (n,), how many of them each polygon became, at least one.
    """
    first = np.cumsum(sizes) - sizes
    with np.errstate(over="ignore", invalid="ignore"):
        normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
        whole = np.repeat(np.add.reduceat(normals, first), sizes, axis=0)
        back = np.sum(normals * whole, axis=1) < -_FOLD * np.sum(whole * whole, axis=1)
    return np.asarray(np.logical_or.reduceat(back, first))


def _ears(polygon: Floats) -> Integers:
    """Return the triangles (f, 3), indices of a polygon (n, 3), seen along the normal that its area has."""
    import mapbox_earcut

    local = polygon - polygon.mean(axis=0)
    size = float(np.max(np.abs(local)))
    if not 0.0 < size < np.inf:
        return np.array([[0, 1, 2]])
    local = local / size
    normal = np.sum(np.cross(local, np.roll(local, -1, axis=0)), axis=0)
    u = np.cross(normal, np.eye(3)[int(np.argmin(np.abs(normal)))])
    v = np.cross(normal, u)
    flat = np.stack([np.sum(local * w / np.sqrt(np.sum(w * w)), axis=1) for w in (u, v)], axis=1)
    ears = mapbox_earcut.triangulate_float64(np.ascontiguousarray(flat), np.array([len(flat)], dtype=np.uint32))
    triangles = np.asarray(ears, dtype=np.int64).reshape(-1, 3)
    a, b, c = (flat[triangles[:, k]] for k in range(3))
    turn = np.sum((b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0]))
    return _with_all_corners(triangles if turn >= 0.0 else triangles[:, ::-1], len(polygon))


def _with_all_corners(triangles: Integers, count: int) -> Integers:
    """Return triangles with more beside them where they leave corners out, most of them on a straight edge.

    Without those corners the edge would not be that of the neighbouring polygons.
    """
    if len(triangles) >= count - 2:
        return triangles
    walked = {(int(a), int(b)) for face in triangles for a, b in zip(face, np.roll(face, -1), strict=True)}
    more = []
    for a, b in sorted(walked):
        if (b, a) not in walked:
            between = [(a + k) % count for k in range((b - a) % count)]
            more += [(c, (c + 1) % count, b) for c in between[:-1]]
            if len(more) > 2 * count:
                raise ValueError(f"a polygon of {count} corners crosses itself and cannot be split into triangles")
    return np.concatenate([triangles, np.array(more, dtype=np.int64).reshape(-1, 3)])
