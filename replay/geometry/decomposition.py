"""Approximate convex decomposition of concave bodies, with what the approximation costs, kept in the user's cache.

The pieces are V-HACD's (Mamou 2016, package vhacdx): on voxels, so they differ from the body by about a voxel, and they
bridge narrow gaps and fill closed cavities. They are one version of a body to compare with; the exact triangles are the
default.
"""

from __future__ import annotations

import contextlib
import hashlib
import importlib.metadata
import itertools
import os
import tempfile
import zipfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numba import boolean, float64

from replay.errors import InvalidValue
from replay.geometry.closest import nearest_triangle, squared_distance_to_triangle
from replay.geometry.containment import inside
from replay.geometry.hull import convex_hull, to_unit_box
from replay.geometry.parts import find_parts
from replay.geometry.solid import Solid, signed_volume
from replay.geometry.tree import TREE_TYPE, Tree, triangle_tree
from replay.geometry.winding import corner_indices
from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel
from replay.numerics.rows import distinct_rows

REVISION = 1
"""Bumped when the pieces or the figures of the same body change; part of the cache's key."""

MAX_PIECES = 64
RESOLUTION = 400_000
"""Voxels that a body's box is cut into."""

PROTRUSION_TOLERANCE = 1e-3
"""The protrusion is searched until no point can exceed it by more than this times the body's largest extent."""

_STACK = 256  # triangles waiting: at most 3 a level of splitting, and levels end below the tolerance


@dataclass(frozen=True, eq=False)
class Decomposition:
    """Convex pieces that stand for a body.

    Attributes:
        pieces: vertex sets (k, 3) [m].
        volume_error: (sum of the pieces' volumes) / (the body's volume) - 1; NaN when the body is not watertight.
        protrusion: largest distance [m] of a point of the pieces' surfaces outside the body from its surface, to
            within 0.1 % of the body's extent; of any point of them when the body is not watertight.
        missed: largest distance [m] by which a corner of the body lies outside the pieces, measured to the nearest
            piece's planes; thin parts can be lost altogether, and contacts with them are then not seen.
    """

    pieces: tuple[Floats, ...]
    volume_error: float
    protrusion: float
    missed: float


def decompose(solid: Solid) -> Decomposition:
    """Return a convex decomposition of a body: its own pieces where it has them, else V-HACD's.

    The same triangles give the same pieces (single-threaded, tested). Results are kept by content in the user's cache
    folder (XDG_CACHE_HOME, else ~/.cache); where that cannot be written they are computed anew each time.

    Raises:
        InvalidValue: the solid has no triangles, or is flat and has no pieces of its own.
    """
    if solid.pieces:
        return Decomposition(solid.pieces, 0.0, 0.0, 0.0)
    if len(solid.triangles) == 0 or convex_hull(solid.vertices) is None:
        raise InvalidValue("solid", f"{len(solid.triangles)} triangles", "a body without volume has no convex pieces")
    entry = _cache_entry(solid)
    kept = _read(entry)
    if kept is None:
        pieces = _decompose(solid.triangles)
        kept = Decomposition(pieces, _volume_error(solid, pieces), _protrusion(solid, pieces), _missed(solid, pieces))
        _write(entry, kept)
    return kept


def closed_cavities(solid: Solid) -> int:
    """Return how many cavities without an opening a solid has; the pieces of `decompose` fill them."""
    points, faces = corner_indices(solid.triangles)
    parts = find_parts(points, faces)
    volumes = [signed_volume(solid.triangles[parts.label == part]) for part in np.flatnonzero(parts.closed).tolist()]
    return sum(volume < 0.0 for volume in volumes)


def _decompose(triangles: Floats) -> tuple[Floats, ...]:
    import vhacdx

    local, centre, scale = to_unit_box(triangles.reshape(-1, 3))
    vertices, _, corners = distinct_rows(local)
    faces = corners.reshape(-1, 3)
    cells = np.column_stack([np.full(len(faces), 3), faces]).astype(np.uint32).ravel()  # each led by its corner count
    hulls = vhacdx.compute_vhacd(vertices, cells, maxConvexHulls=MAX_PIECES, resolution=RESOLUTION, asyncACD=False)
    pieces = [distinct_rows(np.asarray(points, dtype=np.float64) + 0.0).rows for points, _ in hulls]
    solid = [piece for piece in pieces if convex_hull(piece) is not None]  # a thinner body than a voxel may leave none
    return tuple(centre + scale * piece for piece in solid or [vertices])


def _hull_triangles(piece: Floats) -> Floats:
    hull = convex_hull(piece)
    return np.zeros((0, 3, 3)) if hull is None else piece[hull.faces]


def _volume_error(solid: Solid, pieces: tuple[Floats, ...]) -> float:
    if not solid.watertight or solid.volume <= 0.0:
        return float("nan")
    return sum(signed_volume(_hull_triangles(piece)) for piece in pieces) / solid.volume - 1.0


def _protrusion(solid: Solid, pieces: tuple[Floats, ...]) -> float:
    faces = np.ascontiguousarray(np.concatenate([_hull_triangles(piece) for piece in pieces]))
    slack = PROTRUSION_TOLERANCE * float(np.ptp(solid.vertices, axis=0).max())
    tree = triangle_tree(solid.triangles)
    return float(_furthest(faces, solid.triangles, tree, solid.has_inside, np.ascontiguousarray(solid.closing), slack))


def _missed(solid: Solid, pieces: tuple[Floats, ...]) -> float:
    corners = solid.vertices
    outside = np.full(len(corners), np.inf)
    for piece in pieces:
        a, b, c = np.moveaxis(_hull_triangles(piece), 1, 0)
        normals = np.cross(b - a, c - a)
        lengths = np.sqrt(np.sum(normals * normals, axis=1))
        furthest = np.zeros(len(corners))
        for corner, normal, length in zip(a, normals, lengths, strict=True):
            if length > 0.0:
                seen = corners - corner
                height = seen[:, 0] * normal[0] + seen[:, 1] * normal[1] + seen[:, 2] * normal[2]
                np.maximum(furthest, height / length, out=furthest)
        np.minimum(outside, furthest, out=outside)
    return float(outside.max())


@entry(float64[:, :, ::1], float64[:, :, ::1], TREE_TYPE, boolean, float64[:, :, ::1], float64)
@kernel
def _furthest(faces: Floats, triangles: Floats, tree: Tree, closed: bool, closing: Floats, slack: float) -> float:
    """Return the largest distance of a point of faces outside the body, at most slack below the true one.

    A part of a face is bounded in two ways: distance changes by no more than the way gone, so it is at most the
    centroid's plus the furthest corner's distance from the centroid; and the distance to one triangle is a convex
    function, so it is nowhere larger than at a corner. Parts that could still beat the best are split into four.
    """
    best = 0.0
    waiting = np.empty((_STACK, 3, 3))
    parts = np.empty((4, 3, 3))
    m = np.empty(3)
    for f in range(len(faces)):
        waiting[0] = faces[f]
        size = 1
        while size > 0:
            size -= 1
            parts[0] = waiting[size]
            for axis in range(3):
                m[axis] = (parts[0, 0, axis] + parts[0, 1, axis] + parts[0, 2, axis]) / 3.0
            distance, nearest = nearest_triangle(m, triangles, tree)
            reach, corner = 0.0, 0.0
            for k in range(3):
                x, y, z = parts[0, k, 0] - m[0], parts[0, k, 1] - m[1], parts[0, k, 2] - m[2]
                reach = max(reach, x * x + y * y + z * z)
                corner = max(corner, squared_distance_to_triangle(parts[0, k], triangles[nearest]))
            reach, corner = np.sqrt(reach), np.sqrt(corner)
            if min(distance + reach, corner) <= best + slack:
                continue
            if closed and inside(m, triangles, tree, closing) == 1:
                distance = 0.0
            best = max(best, distance)
            if distance + reach <= best + slack or size + 4 > _STACK:
                continue
            for k in range(3):
                after = (k + 1) % 3
                for axis in range(3):
                    parts[3, k, axis] = 0.5 * (parts[0, k, axis] + parts[0, after, axis])
            parts[1, 0], parts[1, 1], parts[1, 2] = parts[3, 0], parts[0, 1], parts[3, 1]
            parts[2, 0], parts[2, 1], parts[2, 2] = parts[3, 2], parts[3, 1], parts[0, 2]
            parts[0, 1], parts[0, 2] = parts[3, 0], parts[3, 2]
            for k in range(4):
                waiting[size] = parts[k]
                size += 1
    return best


def _cache_entry(solid: Solid) -> Path | None:
    """Return the file that keeps this body's decomposition, or None when the user has no cache folder."""
    given = os.environ.get("XDG_CACHE_HOME", "")
    try:
        base = Path(given) if Path(given).is_absolute() else Path.home() / ".cache"
    except RuntimeError:  # no home
        return None
    identity = (REVISION, MAX_PIECES, RESOLUTION, importlib.metadata.version("vhacdx"), solid.watertight)
    digest = hashlib.sha256(repr(identity).encode() + np.ascontiguousarray(solid.triangles).tobytes())
    return base / "replay" / "decompositions" / f"{digest.hexdigest()}.npz"


def _read(entry: Path | None) -> Decomposition | None:
    if entry is None:
        return None
    try:
        with entry.open("rb") as stream, np.load(stream, allow_pickle=False) as kept:
            vertices, first = kept["vertices"], kept["first"]
            pieces = tuple(vertices[a:b].copy() for a, b in itertools.pairwise(first.tolist()))
            figures = (float(kept[name]) for name in ("volume_error", "protrusion", "missed"))
            return Decomposition(pieces, *figures)
    except (OSError, EOFError, ValueError, KeyError, zipfile.BadZipFile):  # none yet, or damaged
        return None


def _write(entry: Path | None, result: Decomposition) -> None:
    """Keep a result; written whole under another name first, so that a reader never sees half of it."""
    if entry is None:
        return
    with contextlib.suppress(OSError):
        entry.parent.mkdir(parents=True, exist_ok=True)
        descriptor, part = tempfile.mkstemp(dir=entry.parent, suffix=".part")
        try:
            with os.fdopen(descriptor, "wb") as stream:
                np.savez(
                    stream,
                    vertices=np.concatenate(result.pieces),
                    first=np.concatenate([[0], np.cumsum([len(piece) for piece in result.pieces])]),
                    volume_error=result.volume_error,
                    protrusion=result.protrusion,
                    missed=result.missed,
                )
            Path(part).replace(entry)
        except BaseException:
            Path(part).unlink(missing_ok=True)
            raise
