"""Triangles made ready for drawing: a normal for each corner."""

from __future__ import annotations

import numpy as np

from replay.numerics.arrays import Floats
from replay.numerics.kept import kept
from replay.recording.scene_view import Meshes

_CREASE = 0.8
"""Cosine of the angle between two faces below which the edge between them is drawn sharp."""
_MOST_NEIGHBOURS = 64  # faces at one vertex that are looked at together; the apex of a fine cone may have more


@kept
def corner_normals(meshes: Meshes) -> Floats:
    """Return a unit normal for each corner (t, 3, 3) of meshes: smooth over curved parts, sharp at edges.

    A corner takes the area-weighted mean of the normals of those faces at its vertex that lie within about 37 degrees
    of its own face. Vertices with equally many corners are done at once, each corner against each of its vertex.
    """
    triangles = meshes.triangles
    across = _cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    corner = np.argsort(meshes.index.ravel(), kind="stable")  # corners, those of one vertex after another
    count = np.bincount(meshes.index.ravel())
    begin = np.cumsum(count) - count
    total = across[np.arange(len(corner)) // 3]
    face = _unit(across)
    for degree in np.unique(count).tolist():
        first = begin[count == degree]
        for at in range(0, degree, _MOST_NEIGHBOURS):
            here = corner[first[:, None] + np.arange(at, min(at + _MOST_NEIGHBOURS, degree))]
            of = here // 3
            own = face[of]
            near = own @ own.swapaxes(1, 2) > _CREASE
            near |= np.eye(here.shape[1], dtype=np.bool_)  # a face without area has no direction
            total[here] = near.astype(np.float64) @ across[of]
    return _unit(total).reshape(-1, 3, 3)


def _cross(a: Floats, b: Floats) -> Floats:
    x, y, z = a.T
    u, v, w = b.T
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=1)


def _unit(vectors: Floats) -> Floats:
    length = np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
    return vectors / np.where(length > 0.0, length, 1.0)
