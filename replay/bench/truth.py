"""What the right answer about two convex bodies is, without GJK.

- `proven_distance`: a certificate (separating direction, witness points) is checked against every vertex of both bodies
  in extended precision and against the planes of their hulls' faces, so whoever found it need not be trusted.
- `signed_distance`: bodies of a few vertices by all their features in extended precision (80 bits on x86-64), every
  candidate formed from pairs and triples of vertices, so that no hull is needed.
"""

from __future__ import annotations

import itertools

import numpy as np

from replay.collision.gjk import Status, distance
from replay.geometry.hull import convex_hull
from replay.numerics.arrays import Floats, Integers, Wide


def proven_distance(a: Floats, b: Floats, T_a_b: Floats) -> tuple[float, float]:
    """Return proven bounds of the distance [m] of the hulls of a (n, 3) and b (m, 3) at T_a_b (4, 4).

    A common point makes the bounds 0 and how far outside of either hull it is at most. NaN where a proof fails.
    """
    found = distance(a, b, pose_b=T_a_b)
    in_a, in_b = np.asarray(a).astype(np.longdouble), placed(b, T_a_b)
    turn, origin = T_a_b[:3, :3].astype(np.longdouble), T_a_b[:3, 3].astype(np.longdouble)
    point_b = (found.point_b.astype(np.longdouble) - origin) @ turn  # R^T (p - t)
    outside = max(_beyond(a, found.point_a), _beyond(b, point_b.astype(np.float64)))
    if found.status is Status.CONTACT:
        return 0.0, outside
    if found.direction is None:
        return np.nan, np.nan
    direction = found.direction.astype(np.longdouble)
    direction /= np.sqrt(np.sum(direction**2))
    low = float((in_b @ direction).min() - (in_a @ direction).max())
    return low, float(np.sqrt(np.sum((found.point_b - found.point_a) ** 2))) + outside


def _beyond(vertices: Floats, point: Floats) -> float:
    """Return how far a point is outside the planes of a hull's faces [m], 0 inside."""
    hull = convex_hull(vertices)
    if hull is None:
        return float("nan")
    a, b, c = (vertices[hull.faces[:, k]].astype(np.longdouble) for k in range(3))
    normals = np.cross(b - a, c - a)
    normals /= np.sqrt(np.sum(normals**2, axis=1, keepdims=True))
    normals *= np.sign(np.sum(normals * (a - vertices.mean(axis=0)), axis=1))[:, None]
    return max(0.0, float(np.sum(normals * (point - a), axis=1).max()))


def placed(points: Floats, T: Floats | Wide) -> Wide:
    """Return R p + t in extended precision, from the doubles as they are."""
    wide, pose = np.asarray(points).astype(np.longdouble), np.asarray(T).astype(np.longdouble)
    return wide @ pose[:3, :3].T + pose[:3, 3]


def signed_distance(a: Wide, b: Wide) -> float:
    """Return the distance of the hulls of two small vertex sets, or minus their depth where they meet [m].

    The separation along every face normal and every product of two edges is the depth; the distance is the smallest
    over corners and faces, corners and edges, and edges and edges.
    """
    middle = a.mean(axis=0)
    a, b = a - middle, b - middle
    pairs_a, pairs_b = _choices(len(a), 2), _choices(len(b), 2)
    edges_a, edges_b = _edges(a, pairs_a), _edges(b, pairs_b)
    axes = np.concatenate([_normals(a, edges_a), _normals(b, edges_b), _products(edges_a, edges_b)])
    size = max(float(np.abs(edges_a).max(initial=0.0)), float(np.abs(edges_b).max(initial=0.0)))
    lengths = np.sqrt(np.sum(axes**2, axis=1))
    kept = lengths > 1e-14 * size**2  # products of a sliver's edges are short; only noise is dropped
    axes = axes[kept] / lengths[kept, None]
    along_a, along_b = axes @ a.T, axes @ b.T
    gaps = np.maximum(along_b.min(axis=1) - along_a.max(axis=1), along_a.min(axis=1) - along_b.max(axis=1))
    gap = gaps.max(initial=-np.inf)
    if len(axes) and gap <= 0:
        return float(gap)
    corners = [f(x, y) for f in (_corners_to_faces, _corners_to_edges) for x, y in ((a, b), (b, a))]
    return float(min(*corners, _edges_to_edges(a, pairs_a, b, pairs_b)))


def _choices(count: int, size: int) -> Integers:
    return np.array(list(itertools.combinations(range(count), size)), dtype=np.int64).reshape(-1, size)


def _edges(points: Wide, pairs: Integers) -> Wide:
    return points[pairs[:, 1]] - points[pairs[:, 0]]


def _products(u: Wide, v: Wide) -> Wide:
    products: Wide = np.cross(u[:, None], v[None]).reshape(-1, 3)
    return products


def _normals(points: Wide, edges: Wide) -> Wide:
    """Return normals of all planes through three points and, for flat bodies, of the edges within them."""
    triples = points[_choices(len(points), 3)]
    normals: Wide = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0]).reshape(-1, 3)
    return np.concatenate([normals, _products(normals, edges)]) if len(points) <= 4 else normals


def _corners_to_faces(points: Wide, corners: Wide) -> np.longdouble:
    best = np.sqrt(np.sum((points[:, None] - corners[None]) ** 2, axis=-1)).min()
    for i, j, k in _choices(len(corners), 3).tolist():
        o, u, v = corners[i], corners[j] - corners[i], corners[k] - corners[i]
        n = np.cross(u, v)
        nn = n @ n
        if nn <= 1e-28 * (u @ u) * (v @ v):
            continue
        r = points - o
        s, t = np.cross(r, v) @ n / nn, np.cross(u, r) @ n / nn
        inside = (s >= 0) & (t >= 0) & (s + t <= 1)
        if inside.any():
            best = min(best, np.abs(r[inside] @ n / np.sqrt(nn)).min())
    return np.longdouble(best)


def _corners_to_edges(points: Wide, corners: Wide) -> np.longdouble:
    pairs = _choices(len(corners), 2)
    if len(pairs) == 0:
        return np.longdouble(np.inf)
    way = _edges(corners, pairs)[None]
    square = np.sum(way * way, axis=-1)
    r = points[:, None] - corners[pairs[:, 0]][None]
    along = np.clip(np.sum(r * way, axis=-1) / np.where(square > 0, square, 1), 0, 1)
    return np.longdouble(np.sqrt(np.sum((r - along[..., None] * way) ** 2, axis=-1)).min())


def _edges_to_edges(a: Wide, pairs_a: Integers, b: Wide, pairs_b: Integers) -> np.longdouble:
    if len(pairs_a) == 0 or len(pairs_b) == 0:
        return np.longdouble(np.inf)
    u, v = _edges(a, pairs_a)[:, None], _edges(b, pairs_b)[None]
    r = a[pairs_a[:, 0]][:, None] - b[pairs_b[:, 0]][None]
    uu, vv, uv, ur, vr = (np.sum(x * y, axis=-1) for x, y in ((u, u), (v, v), (u, v), (u, r), (v, r)))
    uu, vv = np.where(uu > 0, uu, 1), np.where(vv > 0, vv, 1)
    det = uu * vv - uv**2
    s = np.clip(np.where(det > 0, (uv * vr - vv * ur) / np.where(det > 0, det, 1), 0), 0, 1)
    for _ in range(3):
        t = np.clip((uv * s + vr) / vv, 0, 1)
        s = np.clip((uv * t - ur) / uu, 0, 1)
    best = np.sum((r + s[..., None] * u - t[..., None] * v) ** 2, axis=-1).min()
    return np.longdouble(np.sqrt(best))
