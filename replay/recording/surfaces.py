"""Triangles made ready for drawing: corner normals, cones and plates."""

from __future__ import annotations

import numpy as np

from replay.numerics import transforms
from replay.recording.scene_view import ConeView, Floats, Meshes, PlateView

_CREASE = 0.8
"""Cosine of the angle between two faces below which the edge between them is drawn sharp."""
_MOST_NEIGHBOURS = 64  # faces at one vertex that are looked at; the apex of a fine cone may have more
_CONE_SEGMENTS = 24
_ENDLESS_CONE = 2.0
"""Length [m] that a cone without a range is drawn with."""


def corner_normals(meshes: Meshes) -> Floats:
    """Return a unit normal for each corner (t, 3, 3) of meshes: smooth over curved parts, sharp at edges.

    A corner takes the area-weighted mean of the normals of those faces at its vertex that lie within about 37 degrees
    of its own face. Each corner meets the others of its vertex by looking ever further along the corners sorted by
    vertex.
    """
    triangles = meshes.triangles
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    order = np.argsort(meshes.index.ravel(), kind="stable")
    vertex = meshes.index.ravel()[order]
    weighted = across[order // 3]
    face = _unit(weighted)
    total = weighted.copy()
    here = np.arange(len(vertex))  # corners whose vertex has another corner `step` places on
    for step in range(1, _MOST_NEIGHBOURS):
        here = here[: np.searchsorted(here, len(vertex) - step)]
        here = here[vertex[here + step] == vertex[here]]
        if not len(here):
            break
        near = here[np.sum(face[here + step] * face[here], axis=1) > _CREASE]
        total[near + step] += weighted[near]
        total[near] += weighted[near + step]
    result = np.empty_like(total)
    result[order] = _unit(total)
    return result.reshape(-1, 3, 3)


def cone_strips(cone: ConeView) -> list[Floats]:
    """Return the line strips (k, 3) [m], in the link's frame, that outline a sensing cone and the end of its range."""
    length = cone.range if np.isfinite(cone.range) else _ENDLESS_CONE
    half = min(0.5 * cone.aperture, 0.49 * np.pi)
    turn = np.linspace(0.0, 2.0 * np.pi, _CONE_SEGMENTS + 1)
    rim = np.stack([np.sin(half) * np.cos(turn), np.sin(half) * np.sin(turn), np.full(len(turn), np.cos(half))], axis=1)
    sides = [np.stack([np.zeros(3), length * rim[k]]) for k in range(0, _CONE_SEGMENTS, _CONE_SEGMENTS // 8)]
    rings = [length * rim] if np.isfinite(cone.range) else []
    return [transforms.apply(cone.T_link_sensor, strip) for strip in (*sides, *rings)]


def plate_corners(plate: PlateView) -> Floats:
    """Return the corners (4, 3) [m] of a plate in the link's frame, in order around it."""
    x, y = plate.half_size
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    return transforms.apply(plate.T_link_plate, corners)


def _unit(vectors: Floats) -> Floats:
    length = np.sqrt(np.sum(vectors**2, axis=-1, keepdims=True))
    return vectors / np.where(length > 0.0, length, 1.0)
