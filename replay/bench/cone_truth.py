"""What a cone sensor has to read, without closed forms: border rays swept by angle, membership and bisection.

The part of a triangle in a cone of at most 180 deg is convex, so its point nearest to the apex is the triangle's own
nearest point, if that is in the cone, or else lies on the cone's border. The border is the rays

    w(f) = cos h v + sin h (cos f e1 + sin f e2),

and the ray w(f) meets the triangle a b c at t(f) = delta / (n.w(f)) where it passes between the planes of the apex and
each edge. The angles at which it does are found by sampling and bisection, the smallest t among them by golden section.
All in extended precision where the platform has it. The plane of a triangle thinner than THIN is lost even there; it
is as near as its edges to about THIN squared, and on an edge both the membership (concave) and the distance (convex)
are searched from end to end.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from replay.numerics.arrays import Flags, Floats, Wide

THIN = 1e-6
"""Width over length below which a triangle is its edges."""
SAMPLES = 256
"""Angles at which every border is looked at, besides those near which an edge is crossed."""

_GOLDEN = np.longdouble((math.sqrt(5.0) - 1.0) / 2.0)


def nearest_in_cone(triangles: Floats, apex: Floats, axis: Floats, aperture: float) -> float:
    """Return the distance of the point of triangles (n, 3, 3) [m] nearest to the apex in the cone; inf if none.

    Args:
        triangles, apex, axis: [m]; the axis of unit length.
        aperture: above 0, at most pi [rad].
    """
    h = np.longdouble(aperture) / 2
    v = axis.astype(np.longdouble)
    v /= np.sqrt(np.sum(v * v))
    corners = triangles.astype(np.longdouble) - apex.astype(np.longdouble)
    nearest = _nearest_points(corners)
    lengths = np.sqrt(np.sum(nearest**2, axis=1))
    held = _membership(nearest, v, h) >= -1e-16 * lengths
    best = float(np.min(lengths[held], initial=np.inf))
    candidates = np.flatnonzero(~held & (lengths < best))
    candidates = candidates[_may_reach(corners[candidates], v, h)]
    for k in candidates[np.argsort(lengths[candidates])].tolist():
        if float(lengths[k]) >= best:
            break
        best = min(best, _on_edges(corners[k], v, h) if _is_thin(corners[k]) else _on_border(corners[k], v, h))
    return best


def _is_thin(corners: Wide) -> bool:
    a, b, c = corners
    longest = max(float(np.sum(edge * edge)) for edge in (b - a, c - b, a - c))
    return float(np.sqrt(np.sum(np.cross(b - a, c - a) ** 2))) < THIN * longest


def _on_edges(corners: Wide, v: Wide, h: np.longdouble) -> float:
    """Return the distance of the nearest point of a triangle's edges in the cone; inf if there is none."""
    best = math.inf
    for k in range(3):
        start, way = corners[k], corners[(k + 1) % 3] - corners[k]

        def inside(t: np.longdouble, start: Wide = start, way: Wide = way) -> np.longdouble:
            return np.longdouble(_membership((start + t * way)[None], v, h)[0])

        ends = np.longdouble(0), np.longdouble(1)
        low, high = ends
        for _ in range(100):
            first, second = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            low, high = (first, high) if inside(first) < inside(second) else (low, second)
        middle = max((low, high, *ends), key=inside)
        if inside(middle) < 0:
            continue
        hits = []
        for end in ends:
            hit, miss = middle, end
            for _ in range(0 if inside(end) >= 0 else 80):
                half = (hit + miss) / 2
                hit, miss = (half, miss) if inside(half) >= 0 else (hit, half)
            hits.append(end if inside(end) >= 0 else hit)
        square = way @ way
        foot = -(start @ way) / square if square > 0 else np.longdouble(0)
        t = min(max(foot, hits[0]), hits[1])
        best = min(best, float(np.sqrt(np.sum((start + t * way) ** 2))))
    return best


def _membership(x: Wide, v: Wide, h: np.longdouble) -> Wide:
    """Return what is >= 0 in the cone, for points (n, 3)."""
    across = np.cross(v[None], x)
    result: Wide = (x @ v) * np.sin(h) - np.sqrt(np.sum(across**2, axis=1)) * np.cos(h)
    return result


def _may_reach(corners: Wide, v: Wide, h: np.longdouble) -> Flags:
    """Return which triangles' bounding balls are not clear of the cone."""
    centre = corners.mean(axis=1)
    radius = np.sqrt(np.sum((corners - centre[:, None]) ** 2, axis=2)).max(axis=1)
    result: Flags = _membership(centre, v, h) >= -radius
    return result


def _nearest_points(corners: Wide) -> Wide:
    """Return the points (n, 3) of triangles nearest to the origin: the foot where it is inside, else on an edge."""
    a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
    best = _on_segments(a, b)
    for other in (_on_segments(b, c), _on_segments(c, a)):
        nearer = np.sum(other**2, axis=1) < np.sum(best**2, axis=1)
        best = np.where(nearer[:, None], other, best)
    normal = np.cross(b - a, c - a)
    square = np.sum(normal**2, axis=1)
    solid = square > 0
    foot = (np.sum(normal * a, axis=1) / np.where(solid, square, 1))[:, None] * normal
    inside = solid.copy()
    for p, q in ((a, b), (b, c), (c, a)):
        inside &= np.sum(np.cross(q - p, foot - p) * normal, axis=1) >= 0
    return np.where(inside[:, None], foot, best)


def _on_segments(p: Wide, q: Wide) -> Wide:
    e = q - p
    square = np.sum(e * e, axis=1)
    t = np.clip(-np.sum(p * e, axis=1) / np.where(square > 0, square, 1), 0, 1)
    result: Wide = p + t[:, None] * e
    return result


def _on_border(corners: Wide, v: Wide, h: np.longdouble) -> float:
    """Return the smallest t(f) at which a border ray meets one triangle; inf if none does."""
    a, b, c = corners
    normal = np.cross(b - a, c - a)
    if a @ normal < 0:
        b, c = c, b
        normal = -normal
    delta = a @ normal
    if delta <= 0:
        return math.inf
    sides = np.stack([np.cross(a, b), np.cross(b, c), np.cross(c, a)])
    least = np.eye(3, dtype=np.longdouble)[int(np.argmin(np.abs(v)))]
    e1 = np.cross(v, least)
    e1 /= np.sqrt(e1 @ e1)
    e2 = np.cross(v, e1)

    def rays(f: Wide) -> Wide:
        result: Wide = np.cos(h) * v + np.sin(h) * (np.cos(f)[:, None] * e1 + np.sin(f)[:, None] * e2)
        return result

    def inside(f: Wide) -> Wide:
        result: Wide = (rays(f) @ sides.T).min(axis=1)
        return result

    f = _samples(sides, e1, e2, v, h)
    hit = inside(f) >= 0
    if not hit.any():
        return math.inf
    # n.w is one wave: on the hits it is largest at its crest, hence about the best sample, or where a run of hits ends
    height = np.where(hit, rays(f) @ normal, -np.inf)
    crest = int(np.argmax(height))
    ends = {(k, side): _last_hit(inside, f[k], _step(f, k, side)) for k, side in _ends(hit)}
    low, high = (ends.get((crest, side), _step(f, crest, side)) for side in (-1, 1))
    reached = max(height[crest], _highest(lambda x: rays(x) @ normal, low, high))
    if ends:
        reached = max(reached, (rays(np.array(list(ends.values()))) @ normal).max())
    return float(delta / reached) if reached > 0 else math.inf


def _ends(hit: Flags) -> list[tuple[int, int]]:
    """Return (sample, side) for every hit whose neighbour on that side is none."""
    return [(int(k), side) for side in (-1, 1) for k in np.flatnonzero(hit & ~np.roll(hit, -side))]


def _step(f: Wide, k: int, side: int) -> np.longdouble:
    """Return the angle next to sample k on one side, without a jump at the full turn."""
    other = k + side
    turns = -1 if other < 0 else (1 if other >= len(f) else 0)
    return np.longdouble(f[other % len(f)] + turns * 2 * np.longdouble(np.pi))


def _samples(sides: Wide, e1: Wide, e2: Wide, v: Wide, h: np.longdouble) -> Wide:
    """Return angles (m,): an even ring, and what surrounds each edge's two crossings, where narrow hits hide."""
    even = np.linspace(0, 2 * np.pi, SAMPLES, endpoint=False).astype(np.longdouble)
    near = []
    for s in sides:
        # s.w(f) = p + q cos(f - g): it is largest at g and vanishes at equal angles on both sides
        p, x, y = np.cos(h) * (s @ v), np.sin(h) * (s @ e1), np.sin(h) * (s @ e2)
        q, g = np.hypot(x, y), np.arctan2(y, x)
        half = np.arccos(np.clip(-p / q, -1, 1)) if q > 0 else np.longdouble(0)
        steps = np.longdouble(10) ** np.arange(-12, 0)
        near += [g, *(g + half - steps), *(g + half + steps), *(g - half - steps), *(g - half + steps)]
    crossings = np.array(near, dtype=np.longdouble)
    between = 0.5 * (np.sort(crossings)[1:] + np.sort(crossings)[:-1])
    angles = np.sort(np.mod(np.concatenate([even, crossings, between]), 2 * np.longdouble(np.pi)))
    # of two that are one to rounding, neither would be seen to be beside a crest
    return angles[np.diff(angles, prepend=angles[-1] - 7.0) > 1e-14]


def _last_hit(inside: Callable[[Wide], Wide], hit: np.longdouble, miss: np.longdouble) -> np.longdouble:
    """Return the last angle that is a hit on the way from a hit to a miss."""
    for _ in range(64):
        middle = (hit + miss) / 2
        if inside(np.array([middle]))[0] >= 0:
            hit = middle
        else:
            miss = middle
    return hit


def _highest(value: Callable[[Wide], Wide], low: np.longdouble, high: np.longdouble) -> np.longdouble:
    """Return the largest value on an interval on which it has one maximum."""
    best = max(value(np.array([low]))[0], value(np.array([high]))[0])
    for _ in range(60):
        first, second = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
        f1, f2 = value(np.array([first, second]))
        best = max(best, f1, f2)
        if f1 < f2:
            low = first
        else:
            high = second
    return np.longdouble(best)
