"""Triangles made ready for drawing: corner normals, cones and plates."""

from __future__ import annotations

import numpy as np

from replay.numerics import transforms
from replay.recording.scene_view import ConeView, Floats, Meshes, PlateView

_CREASE = 0.8
"""Cosine of the angle between two faces below which the edge between them is drawn sharp."""
_MOST_NEIGHBOURS = 64  # faces at one vertex that are looked at together; the apex of a fine cone may have more
_CONE_SEGMENTS = 24
_ENDLESS_CONE = 2.0
"""Length [m] that a cone without a range is drawn with."""


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


def cone_strips(cone: ConeView) -> list[Floats]:
    """Return the line strips (k, 3) [m], in the link's frame, that outline a sensing cone and the end of its range."""
    length = cone.range if np.isfinite(cone.range) else _ENDLESS_CONE
    half = min(0.5 * cone.aperture, 0.49 * np.pi)
    turn = np.linspace(0.0, 2.0 * np.pi, _CONE_SEGMENTS + 1)
    ring = np.stack(
        [np.sin(half) * np.cos(turn), np.sin(half) * np.sin(turn), np.full(len(turn), np.cos(half))], axis=1
    )
    corners = transforms.apply(cone.T_link_sensor, np.concatenate([np.zeros((1, 3)), length * ring]))
    apex, rim = corners[0], corners[1:]
    sides = [np.stack([apex, rim[k]]) for k in range(0, _CONE_SEGMENTS, _CONE_SEGMENTS // 8)]
    return [*sides, rim] if np.isfinite(cone.range) else sides


def plate_corners(plate: PlateView) -> Floats:
    """Return the corners (4, 3) [m] of a plate in the link's frame, in order around it."""
    x, y = plate.half_size
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return transforms.apply(plate.T_link_plate, corners)


def _unit(vectors: Floats) -> Floats:
    length = np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
    return vectors / np.where(length > 0.0, length, 1.0)
