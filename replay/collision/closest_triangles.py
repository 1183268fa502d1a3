"""The closest triangles of two surfaces, for a reader who asks: exact, and as quick as one frame needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.collision.gjk import distance
from replay.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class ClosestTriangles:
    """Where two surfaces are closest.

    Attributes:
        gap: [m], 0 where they meet.
        triangles: index of one triangle of each.
        points: (2, 3) [m], the closest point on each.
    """

    gap: float
    triangles: tuple[int, int]
    points: Floats


def closest_triangles(a: Floats, b: Floats) -> ClosestTriangles:
    """Return where the surfaces of triangles (n, 3, 3) and (m, 3, 3) [m] are closest; the first pair of several.

    Pairs are taken in the order of a lower bound, the gap of their enclosing balls, until that reaches what was found.
    A body inside another one is as far as its surface is.

    Accuracy: of `collision.gjk.distance`, for each pair (tests/comparison/test_explain.py).
    """
    centres = [triangles.mean(axis=1) for triangles in (a, b)]
    radii = [
        np.linalg.norm(triangles - centre[:, None], axis=2).max(axis=1)
        for triangles, centre in zip((a, b), centres, strict=True)
    ]
    best = ClosestTriangles(np.inf, (0, 0), np.zeros((2, 3)))
    # of each triangle of a, how near b's can be at best: the order in which they are looked at
    middle, reach = b.reshape(-1, 3).mean(axis=0), 0.0
    reach = float(np.linalg.norm(b.reshape(-1, 3) - middle, axis=1).max())
    nearest = np.linalg.norm(centres[0] - middle, axis=1) - radii[0] - reach
    for i in np.argsort(nearest, kind="stable").tolist():
        if nearest[i] > best.gap:
            break
        bounds = np.linalg.norm(centres[1] - centres[0][i], axis=1) - radii[1] - radii[0][i]
        (close,) = np.nonzero(bounds < best.gap)
        for j in close[np.argsort(bounds[close], kind="stable")].tolist():
            if bounds[j] >= best.gap:
                break
            found = distance(a[i], b[j])
            if found.distance < best.gap:
                best = ClosestTriangles(found.distance, (i, j), np.stack((found.point_a, found.point_b)))
            if best.gap == 0.0:
                return best
    return best
