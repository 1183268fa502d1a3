"""Mesh files as solids: what they hold is checked, with every repair and shortcoming told in the solid's notes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numba import float64

from replay.errors import InvalidValue, MeshError, count
from replay.geometry.closing import NO_CAPS, Openness, caps, openness
from replay.geometry.copies import copies
from replay.geometry.facets import ROUNDING, alike
from replay.geometry.hull import extreme_points, to_unit_box
from replay.geometry.mesh_file import read_faces
from replay.geometry.outward import Turned, inside_out
from replay.geometry.parts import find_parts
from replay.geometry.solid import Solid
from replay.geometry.tree import MAX_DEPTH, TREE_TYPE, Tree, build_tree
from replay.geometry.weld import weld, weld_copies
from replay.geometry.winding import Topology, corner_indices, topology
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.constants import EPSILON
from replay.numerics.jit import entry, kernel
from replay.numerics.rows import distinct_rows

_LARGEST = 1e60  # volumes and squared areas of anything smaller stay finite


def load_mesh(path: Path | str, *, scale: float | Sequence[float], data: bytes | None = None) -> Solid:
    """Return the body in a mesh file, its coordinates multiplied by scale.

    Args:
        path: an STL, OBJ, PLY or GLB file; a GLB's scene is flattened into one body, each part in its place.
        scale: metres per unit of the file: 0.01 for centimetres; or three numbers along x, y and z, of which a negative
            one mirrors the mesh and turns its triangles over.
        data: the file's content when it has been read already; then the path names the format, and errors.

    Returns:
        A solid; `notes` tells what a reader should know (not watertight, inside out, dropped triangles). It has one
        piece if it is convex within the rounding of single-precision coordinates, else none.

    Raises:
        MeshError: unreadable or of another format, empty, not finite, without any triangle that has an area.
        InvalidValue: a scale that is not finite and positive, or along an axis not finite or 0.
    """
    scales = _along_axes(scale)
    name = str(path)
    vertices, faces = read_faces(path, data)
    if len(faces) == 0:
        raise MeshError(name, "holds no triangles")
    wrong = faces[(faces < 0) | (faces >= len(vertices))]
    if len(wrong):
        raise MeshError(name, f"a triangle refers to vertex {wrong[0]}; there are 0 to {len(vertices) - 1}")
    bad = np.count_nonzero(~np.isfinite(vertices[faces]).all(axis=(1, 2)))
    if bad:
        raise MeshError(name, f"{bad} of {len(faces)} triangles have a corner that is not finite")
    with np.errstate(over="ignore", under="ignore"):
        triangles = vertices[faces] * scales
    if np.prod(np.sign(scales)) < 0.0:
        triangles = triangles[:, [0, 2, 1]]
    if np.max(np.abs(triangles)) > _LARGEST:
        raise MeshError(name, f"coordinates times scale = {scale} reach beyond {_LARGEST} m")
    try:
        return solid_from_triangles(triangles)
    except InvalidValue as error:
        raise MeshError(name, error.rule) from error


def _along_axes(scale: float | Sequence[float]) -> Floats:
    scales = np.atleast_1d(np.asarray(scale, dtype=np.float64))
    if scales.shape == (1,):
        if not 0.0 < scales[0] < math.inf:
            raise InvalidValue("scale", scale, "must be finite and positive [m per unit of the file]")
        return np.repeat(scales, 3)
    if scales.shape != (3,) or not np.isfinite(scales).all() or not scales.all():
        raise InvalidValue("scale", scale, "must be one or three finite numbers, not 0 [m per unit of the file]")
    return scales


def solid_from_triangles(triangles: Floats) -> Solid:
    """Return checked triangles (n, 3, 3) [m] as a solid; see `load_mesh` for what is checked and noted.

    Raises:
        InvalidValue: not finite, or no triangle has an area.
    """
    triangles = np.ascontiguousarray(triangles, dtype=np.float64) + 0.0
    if triangles.ndim != 3 or triangles.shape[1:] != (3, 3) or not np.isfinite(triangles).all():
        raise InvalidValue("triangles", triangles.shape, "must have shape (n, 3, 3) and be finite")
    flat = ~_have_area(triangles)
    without_area = int(np.count_nonzero(flat))
    if without_area == len(triangles):
        raise InvalidValue("triangles", len(triangles), f"none of its {without_area} triangles has an area")
    notes = []
    if without_area:
        notes.append(f"{without_area} of {len(triangles)} triangles have no area and were dropped")
    # A flat triangle may be the stitch between a long edge and two short ones: it counts for topology.
    points, faces = corner_indices(triangles)
    joints = topology(faces)
    if not joints.is_closed:
        taken_for = weld(points, faces, flat)
        welded = int(np.count_nonzero(taken_for != np.arange(len(points))))
        if welded:
            faces = taken_for[faces]
            triangles, before, joints = points[faces], joints, topology(faces)
            notes.append(_on_welding(points, taken_for, f"which closed {_closed_edges(before, joints)}"))
    known, taken_for = faces, weld_copies(points, faces, flat)
    if (taken_for != np.arange(len(points))).any():
        faces = taken_for[faces]
        notes.append(_on_welding(points, taken_for, "so that triangles repeat"))
    faces, source = alike(points, faces)
    triangles, flat = points[faces], flat[source]
    again = copies(faces)
    repeats = int(np.count_nonzero(again & ~flat))
    if again.any():
        if repeats:
            rule = "repeat another one, in either sense, and were dropped"
            notes.append(f"{repeats} of {len(triangles)} triangles {rule}")
        triangles, faces, flat = triangles[~again], faces[~again], flat[~again]
    if faces is not known:
        joints = topology(faces)
    parts = find_parts(points, faces)
    if parts.turned.any():
        faces = np.where(parts.turned[:, None], faces[:, [0, 2, 1]], faces)
        count = int(np.count_nonzero(parts.turned & ~flat))
        joints = topology(faces)
        notes.append(f"{count} triangles were wound against their neighbours and turned over")
    triangles, kept = points[faces[~flat]], parts._replace(label=parts.label[~flat])
    turned = inside_out(triangles, kept)
    triangles = np.where(turned.faces[:, None, None], triangles[:, [0, 2, 1]], triangles)
    if turned.inside_out:
        notes.append(_on_turning(turned))
    triangles = np.ascontiguousarray(triangles)
    watertight = joints.is_closed
    closing = NO_CAPS
    if not watertight:
        closing = caps(triangles)
        found = openness(triangles, closing)
        closing = closing if found.has_inside else NO_CAPS
        notes.append(_on_openness(joints, found))
    pieces = (_convex_corners(triangles),) if watertight and _is_convex(triangles) else ()
    dropped = without_area + repeats
    return Solid(triangles, pieces=pieces, watertight=watertight, closing=closing, dropped=dropped, notes=tuple(notes))


def _on_welding(points: Floats, taken_for: Integers, effect: str) -> str:
    moved = points - points[taken_for]
    furthest = float(np.sqrt(np.max(np.sum(moved * moved, axis=1))))
    which = count(int(np.count_nonzero(taken_for != np.arange(len(points)))), "corner")
    return f"{which} at most {furthest:.2g} m from another one were taken for it, {effect}"


def _closed_edges(before: Topology, after: Topology) -> str:
    return count(_not_joined(before) - _not_joined(after), "edge")


def _not_joined(joints: Topology) -> int:
    return joints.open_edges + joints.crowded_edges


def _on_turning(turned: Turned) -> str:
    if turned.outermost == 1:
        return "inside out (its volume is negative): the triangles were turned over"
    return f"{turned.inside_out} of {turned.outermost} parts were inside out (of negative volume) and turned over"


def _on_openness(joints: Topology, found: Openness) -> str:
    reasons = []
    if joints.open_edges:
        reasons.append(f"{count(joints.open_edges, 'edge')} {'is' if joints.open_edges == 1 else 'are'} open")
    if joints.crowded_edges:
        verb = "belongs" if joints.crowded_edges == 1 else "belong"
        reasons.append(f"{count(joints.crowded_edges, 'edge')} {verb} to more than two triangles, an odd number")
    if joints.reversed_edges:
        edges = count(joints.reversed_edges, "edge")
        reasons.append(f"neighbouring triangles are wound against each other along {edges}")
    what = f"not watertight: {', '.join(reasons)}; "
    if not found.has_inside:
        return f"{what}it has no inside, only a surface"
    defect = f"{found.largest:.2g}" if found.largest > 1e-9 else "0"
    return f"{what}inside is where the winding number is above 1/2; its largest defect on the surface is {defect}"


def _have_area(triangles: Floats) -> Flags:
    """Return which triangles (n,) are higher than the rounding of their own corners over their longest edge."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    edges = np.stack([b - a, c - b, a - c])
    longest = np.max(np.abs(edges), axis=(0, 2))
    safe = np.where(longest > 0.0, longest, 1.0)[:, None]
    cross = np.cross(edges[0] / safe, edges[2] / safe)
    return np.asarray((longest > 0.0) & (np.max(np.abs(cross), axis=1) > 4.0 * EPSILON))


def _convex_corners(triangles: Floats) -> Floats:
    return extreme_points(distinct_rows(triangles.reshape(-1, 3)).rows)


def _is_convex(triangles: Floats) -> bool:
    """Return whether a closed surface bounds its own hull: no corner lies outside any face's plane, within rounding."""
    local, _, scale = to_unit_box(triangles.reshape(-1, 3))
    slack = ROUNDING * float(np.max(np.abs(triangles))) / scale
    corners = _convex_corners(local.reshape(-1, 3, 3))
    return bool(_all_below(local.reshape(-1, 3, 3), corners, build_tree(corners, corners), slack))


@entry(float64[:, :, ::1], float64[:, ::1], TREE_TYPE, float64)
@kernel
def _all_below(triangles: Floats, points: Floats, tree: Tree, slack: float) -> bool:
    """Return whether no point is further than slack outside the plane of any triangle (all of some area).

    Of a box of points, no point is further out than the corner that is furthest along the normal.
    """
    waiting = np.empty(MAX_DEPTH, np.int64)
    for t in range(len(triangles)):
        ax, ay, az = triangles[t, 0, 0], triangles[t, 0, 1], triangles[t, 0, 2]
        ux, uy, uz = triangles[t, 1, 0] - ax, triangles[t, 1, 1] - ay, triangles[t, 1, 2] - az
        vx, vy, vz = triangles[t, 2, 0] - ax, triangles[t, 2, 1] - ay, triangles[t, 2, 2] - az
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        limit = slack * np.sqrt(nx * nx + ny * ny + nz * nz)
        waiting[0] = 0
        size = 1
        while size > 0:
            size -= 1
            node = waiting[size]
            low, high = tree.lower[node], tree.upper[node]
            x, y, z = high[0] if nx > 0.0 else low[0], high[1] if ny > 0.0 else low[1], high[2] if nz > 0.0 else low[2]
            if nx * (x - ax) + ny * (y - ay) + nz * (z - az) <= limit:
                continue
            if tree.second[node] >= 0:
                waiting[size], waiting[size + 1] = tree.second[node], node + 1
                size += 2
                continue
            for k in range(tree.begin[node], tree.end[node]):
                p = points[tree.order[k]]
                if nx * (p[0] - ax) + ny * (p[1] - ay) + nz * (p[2] - az) > limit:
                    return False
    return True
