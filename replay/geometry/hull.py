"""Convex hulls in three dimensions through Qhull, made independent of the place and size of the points."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from replay.numerics.arrays import Floats, Integers
from replay.numerics.extents import extents


class Hull(NamedTuple):
    """The convex hull of points with a volume.

    Attributes:
        vertices: (h,) indices of the hull's vertices in the points given, ascending.
        faces: (f, 3) indices in the points given of the hull's triangles, counter-clockwise from outside.
    """

    vertices: Integers
    faces: Integers


def convex_hull(points: Floats) -> Hull | None:
    """Return the hull of finite points (n, 3), or None when they are flat (within rounding of their extent).

    Accuracy: Qhull merges facets within ~1e-15 of the extent; a point that close to a face may be left out.
    Source: Barber, Dobkin, Huhdanpaa (1996), as wrapped by SciPy.
    """
    local, _, _ = to_unit_box(points)
    hull = _qhull(local)
    if hull is None:
        return None
    faces = hull.simplices.astype(np.int64)
    a, b, c = np.moveaxis(local[faces], 1, 0)
    inward = np.sum(np.cross(b - a, c - a) * hull.equations[:, :3], axis=1) < 0.0
    faces[inward] = faces[inward][:, [0, 2, 1]]
    return Hull(_vertices(hull), faces)


def extreme_points(points: Floats) -> Floats:
    """Return those of finite points (n, 3) that are vertices of their hull, in their order; of flat points all.

    Accuracy: as of `convex_hull`.
    """
    hull = _qhull(to_unit_box(points)[0])
    return points if hull is None else points[_vertices(hull)]


def to_unit_box(points: Floats) -> tuple[Floats, Floats, float]:
    """Return (local, centre, scale): points = centre + scale * local with local in about [-1, 1]; scale a power of two.

    A power of two makes the scaling exact, and subtracting a centre that is among the points' magnitudes loses
    nothing beyond the points' own rounding.
    """
    lower, upper = extents(points)
    centre = 0.5 * lower + 0.5 * upper
    extent = float(np.max(0.5 * upper - 0.5 * lower))
    scale = float(2.0 ** np.ceil(np.log2(extent))) if extent > 0.0 else 1.0
    if not 0.0 < scale < np.inf:
        scale = 1.0
    return np.ascontiguousarray((points - centre) / scale), centre, scale


def _qhull(local: Floats) -> Any:
    from scipy.spatial import ConvexHull, QhullError

    if len(local) < 4:
        return None
    try:
        return ConvexHull(local)
    except QhullError:
        return None


def _vertices(hull: Any) -> Integers:
    used = np.zeros(len(hull.points), dtype=np.bool_)
    used[hull.simplices] = True
    return np.flatnonzero(used)
