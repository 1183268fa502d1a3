"""Independent answers about convex sets: separating axes and feature-by-feature distance, no GJK in it.

`signed_distance` works on small sets in extended precision and forms every candidate feature from vertex pairs and
triples, so that it needs no hull; the compiled functions work on boxes and on hulls with given faces.
"""

from __future__ import annotations

import itertools
import math
from fractions import Fraction

import numba
import numpy as np

Wide = np.longdouble


def box(size):
    """Return the 8 corners of a box with full edges `size`, about its centre."""
    return np.array(list(itertools.product((-0.5, 0.5), repeat=3))) * np.asarray(size, dtype=float)


def placed(points, pose, origin):
    """Return R p + (t - origin) in extended precision, from the doubles as they are."""
    points, pose, origin = (np.asarray(value).astype(Wide) for value in (points, pose, origin))
    return points @ pose[:3, :3].T + (pose[:3, 3] - origin)


def exact_gap(a, b, pose_a, pose_b, direction):
    """Return how far apart two posed vertex sets are along a direction, in rational arithmetic but for the last root.

    No point of b is nearer to any point of a than this: a lower bound on the distance that no rounding has touched.
    """
    along = [Fraction(value) for value in direction.tolist()]
    heights = []
    for points, pose in ((a, pose_a), (b, pose_b)):
        turn = [[Fraction(value) for value in row] for row in pose[:3].tolist()]
        tilted = [sum(along[i] * turn[i][j] for i in range(3)) for j in range(4)]
        heights.append(
            [sum(x * Fraction(y) for x, y in zip(tilted, p, strict=False)) + tilted[3] for p in points.tolist()]
        )
    return float(min(heights[1]) - max(heights[0])) / math.sqrt(float(sum(x * x for x in along)))


def _directions(points, edges):
    normals = [np.cross(points[j] - points[i], points[k] - points[i]) for i, j, k in _triples(len(points))]
    normals = np.array(normals, dtype=Wide).reshape(-1, 3)
    in_plane = np.cross(normals[:, None], edges[None]).reshape(-1, 3) if len(points) <= 4 else np.zeros((0, 3), Wide)
    return np.concatenate([normals, in_plane])


def _triples(n):
    return list(itertools.combinations(range(n), 3))


def _pairs(n):
    return np.array(list(itertools.combinations(range(n), 2))).reshape(-1, 2)


def signed_distance(a, b):
    """Return the distance of two small convex vertex sets (longdouble), or minus the penetration depth if they meet."""
    middle = a.mean(axis=0)
    a, b = a - middle, b - middle
    pairs_a, pairs_b = _pairs(len(a)), _pairs(len(b))
    edges_a, edges_b = a[pairs_a[:, 1]] - a[pairs_a[:, 0]], b[pairs_b[:, 1]] - b[pairs_b[:, 0]]
    crosses = np.cross(edges_a[:, None], edges_b[None]).reshape(-1, 3)
    axes = np.concatenate([_directions(a, edges_a), _directions(b, edges_b), crosses])
    size = max(np.abs(edges_a).max(), np.abs(edges_b).max())
    lengths = np.sqrt((axes**2).sum(axis=1))
    # a product of two edges of a sliver is short; only noise is dropped
    axes = axes[lengths > 1e-14 * size**2] / lengths[lengths > 1e-14 * size**2, None]
    along_a, along_b = axes @ a.T, axes @ b.T
    gap = max((along_b.min(axis=1) - along_a.max(axis=1)).max(), (along_a.min(axis=1) - along_b.max(axis=1)).max())
    if gap <= 0:
        return gap
    candidates = [_corners_to_faces(a, b), _corners_to_faces(b, a), _edges_to_edges(a, pairs_a, b, pairs_b)]
    return min(candidates)


def _corners_to_faces(points, corners):
    best = np.sqrt(((points[:, None] - corners[None]) ** 2).sum(axis=-1)).min()
    for i, j, k in _triples(len(corners)):
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
    return best


def _edges_to_edges(a, pairs_a, b, pairs_b):
    p, u = a[pairs_a[:, 0]][:, None], (a[pairs_a[:, 1]] - a[pairs_a[:, 0]])[:, None]
    q, v = b[pairs_b[:, 0]][None], (b[pairs_b[:, 1]] - b[pairs_b[:, 0]])[None]
    r = p - q
    uu, vv, uv, ur, vr = ((x * y).sum(axis=-1) for x, y in ((u, u), (v, v), (u, v), (u, r), (v, r)))
    uu, vv = np.where(uu > 0, uu, 1), np.where(vv > 0, vv, 1)
    det = uu * vv - uv**2
    s = np.clip(np.where(det > 0, (uv * vr - vv * ur) / np.where(det > 0, det, 1), 0), 0, 1)
    for _ in range(3):
        t = np.clip((uv * s + vr) / vv, 0, 1)
        s = np.clip((uv * t - ur) / uu, 0, 1)
    best = r + s[..., None] * u - t[..., None] * v
    ends = [  # corners against edges
        np.sqrt(((x - np.clip((x * w).sum(-1) / ww, 0, 1)[..., None] * w) ** 2).sum(-1)).min()
        for x, w, ww in ((-r, u, uu), (-r + v, u, uu), (r, v, vv), (r + u, v, vv))
    ]
    return min(np.sqrt((best**2).sum(axis=-1)).min(), *ends)


@numba.njit(error_model="numpy")
def box_gap(rotation, translation, half_a, half_b):
    """Return the largest separation over the 15 axes of two boxes; > 0 iff they are apart. B is at (R, t) in A."""
    best = -np.inf
    for k in range(15):
        if k < 3:
            x, y, z = 1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2)
        elif k < 6:
            x, y, z = rotation[0, k - 3], rotation[1, k - 3], rotation[2, k - 3]
        else:
            i, j = (k - 6) // 3, (k - 6) % 3
            rx, ry, rz = rotation[0, j], rotation[1, j], rotation[2, j]
            x, y, z = (0.0, -rz, ry) if i == 0 else ((rz, 0.0, -rx) if i == 1 else (-ry, rx, 0.0))
            length = math.sqrt(x * x + y * y + z * z)
            if length < 1e-7:
                continue
            x, y, z = x / length, y / length, z / length
        reach = half_a[0] * abs(x) + half_a[1] * abs(y) + half_a[2] * abs(z)
        for j in range(3):
            reach += half_b[j] * abs(rotation[0, j] * x + rotation[1, j] * y + rotation[2, j] * z)
        best = max(best, abs(translation[0] * x + translation[1] * y + translation[2] * z) - reach)
    return best


@numba.njit(error_model="numpy")
def hull_gap(a, faces_a, edges_a, b, faces_b, edges_b):
    """Return the distance of two hulls (vertices, faces, edges), or minus their penetration depth."""
    depth = -np.inf
    for which in range(2):
        faces, points = (faces_a, a) if which == 0 else (faces_b, b)
        for f in range(len(faces)):
            o = points[faces[f, 0]]
            depth = max(depth, _axis_gap(a, b, np.cross(points[faces[f, 1]] - o, points[faces[f, 2]] - o)))
    for i in range(len(edges_a)):
        for j in range(len(edges_b)):
            u, v = a[edges_a[i, 1]] - a[edges_a[i, 0]], b[edges_b[j, 1]] - b[edges_b[j, 0]]
            n = np.cross(u, v)
            if (n * n).sum() > 1e-14 * (u * u).sum() * (v * v).sum():
                depth = max(depth, _axis_gap(a, b, n))
    if depth <= 0.0:
        return depth
    best = np.inf
    for which in range(2):
        faces, corners, points = (faces_a, a, b) if which == 0 else (faces_b, b, a)
        for f in range(len(faces)):
            o = corners[faces[f, 0]]
            u, v = corners[faces[f, 1]] - o, corners[faces[f, 2]] - o
            n = np.cross(u, v)
            nn = (n * n).sum()
            for p in range(len(points)):
                r = points[p] - o
                s, t = (np.cross(r, v) * n).sum(), (np.cross(u, r) * n).sum()
                if s >= 0.0 and t >= 0.0 and s + t <= nn:
                    best = min(best, abs((r * n).sum()) / math.sqrt(nn))
    for i in range(len(edges_a)):
        for j in range(len(edges_b)):
            best = min(best, _edge_distance(a[edges_a[i, 0]], a[edges_a[i, 1]], b[edges_b[j, 0]], b[edges_b[j, 1]]))
    return best


@numba.njit(error_model="numpy")
def _axis_gap(a, b, n):
    n = n / math.sqrt((n * n).sum())
    low_a, high_a, low_b, high_b = np.inf, -np.inf, np.inf, -np.inf
    for i in range(len(a)):
        x = a[i, 0] * n[0] + a[i, 1] * n[1] + a[i, 2] * n[2]
        low_a, high_a = min(low_a, x), max(high_a, x)
    for i in range(len(b)):
        x = b[i, 0] * n[0] + b[i, 1] * n[1] + b[i, 2] * n[2]
        low_b, high_b = min(low_b, x), max(high_b, x)
    return max(low_b - high_a, low_a - high_b)


@numba.njit(error_model="numpy")
def _edge_distance(p0, p1, q0, q1):
    u, v, r = p1 - p0, q1 - q0, p0 - q0
    uu, vv, uv, ur, vr = (u * u).sum(), (v * v).sum(), (u * v).sum(), (u * r).sum(), (v * r).sum()
    best = np.inf
    det = uu * vv - uv * uv
    if det > 0.0:
        s, t = (uv * vr - vv * ur) / det, (uu * vr - uv * ur) / det
        if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
            x = r + s * u - t * v
            best = (x * x).sum()
    for end in range(2):
        t = min(max((uv * end + vr) / vv, 0.0), 1.0)
        x = r + end * u - t * v
        best = min(best, (x * x).sum())
        s = min(max((uv * end - ur) / uu, 0.0), 1.0)
        x = r + s * u - end * v
        best = min(best, (x * x).sum())
    return math.sqrt(best)
