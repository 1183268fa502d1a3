"""Mesh files as solids: what they hold is checked, with every repair and shortcoming told in the solid's notes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from numba import float64

from replay.errors import InvalidValue, MeshError, count
from replay.geometry.closing import NO_CAPS, Openness, caps, openness
from replay.geometry.convexity import convex_piece
from replay.geometry.copies import copies
from replay.geometry.facets import alike
from replay.geometry.mesh_file import read_faces
from replay.geometry.outward import Turned, inside_out
from replay.geometry.parts import find_parts
from replay.geometry.solid import Solid
from replay.geometry.weld import weld, weld_copies
from replay.geometry.winding import Topology, corner_indices, sides, topology
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.constants import EPSILON
from replay.numerics.jit import entry, kernel
from replay.numerics.kept import kept

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
    read = _load if data is None else kept(_load)  # a file may change meanwhile
    return read(str(path), _along_axes(scale), data)


def _load(name: str, scales: Floats, data: bytes | None) -> Solid:
    """Return the body in a mesh file, its coordinates multiplied by scales (3,); see `load_mesh`."""
    vertices, faces = read_faces(name, data)
    if len(faces) == 0:
        raise MeshError(name, "holds no triangles")
    wrong = faces[(faces < 0) | (faces >= len(vertices))]
    if len(wrong):
        raise MeshError(name, f"a triangle refers to vertex {wrong[0]}; there are 0 to {len(vertices) - 1}")
    if not np.isfinite(vertices).all() and (bad := _not_finite(vertices[faces])):
        raise MeshError(name, f"{bad} of {len(faces)} triangles have a corner that is not finite")
    with np.errstate(over="ignore", under="ignore", invalid="ignore"):  # vertices of no triangle may be anything
        triangles = (vertices * scales)[faces]
    if np.prod(np.sign(scales)) < 0.0:
        triangles = triangles[:, [0, 2, 1]]
    if np.max(np.abs(triangles)) > _LARGEST:
        scale = float(scales[0]) if (scales == scales[0]).all() else scales.tolist()
        raise MeshError(name, f"coordinates times scale = {scale} reach beyond {_LARGEST} m")
    try:
        return solid_from_triangles(triangles)
    except InvalidValue as error:
        raise MeshError(name, error.rule) from error


def _not_finite(triangles: Floats) -> int:
    return int(np.count_nonzero(~np.isfinite(triangles).all(axis=(1, 2))))


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
    found = sides(faces)
    joints = topology(found)
    if not joints.is_closed:
        taken_for = weld(points, faces, flat)
        welded = int(np.count_nonzero(taken_for != np.arange(len(points))))
        if welded:
            faces = taken_for[faces]
            found, before = sides(faces), joints
            joints = topology(found)
            notes.append(_on_welding(points, taken_for, f"which closed {_closed_edges(before, joints)}"))
    known, taken_for = faces, weld_copies(points, faces, flat, closed=joints.is_closed)
    if (taken_for != np.arange(len(points))).any():
        faces = taken_for[faces]
        notes.append(_on_welding(points, taken_for, "so that triangles repeat"))
    faces, source = alike(points, faces, found if faces is known else None)
    flat = flat[source]
    again = copies(faces, found if faces is known else None)
    repeats = int(np.count_nonzero(again & ~flat))
    if again.any():
        if repeats:
            rule = "repeat another one, in either sense, and were dropped"
            notes.append(f"{repeats} of {len(faces)} triangles {rule}")
        faces, flat = faces[~again], flat[~again]
    if faces is not known:
        found = sides(faces)
        joints = topology(found)
    parts = find_parts(points, faces, found)
    if parts.turned.any():
        faces = np.where(parts.turned[:, None], faces[:, [0, 2, 1]], faces)
        count = int(np.count_nonzero(parts.turned & ~flat))
        joints = topology(sides(faces))
        notes.append(f"{count} triangles were wound against their neighbours and turned over")
    faces = faces[~flat]
    if not len(faces):
        rule = "have no area that is not lost beside the largest of their coordinates"
        raise InvalidValue("triangles", len(triangles), rule)
    turned = inside_out(points[faces], parts._replace(label=parts.label[~flat]))
    if turned.inside_out:
        faces = np.where(turned.faces[:, None], faces[:, [0, 2, 1]], faces)
        notes.append(_on_turning(turned))
    triangles = np.ascontiguousarray(points[faces])
    watertight = joints.is_closed
    closing = NO_CAPS
    if not watertight:
        closing = caps(triangles)
        seen = openness(triangles, closing)
        closing = closing if seen.has_inside else NO_CAPS
        notes.append(_on_openness(joints, seen))
    convex = convex_piece(points, faces, None if flat.any() else found) if watertight else None
    return Solid(
        triangles,
        pieces=() if convex is None else (convex.corners,),
        strictly_convex=convex is not None and convex.strictly,
        watertight=watertight,
        closing=closing,
        dropped=without_area + repeats,
        notes=tuple(notes),
    )


def _on_welding(points: Floats, taken_for: Integers, effect: str) -> str:
    moved = points - points[taken_for]
    furthest = float(np.sqrt(np.max(np.sum(moved * moved, axis=1))))
    number = int(np.count_nonzero(taken_for != np.arange(len(points))))
    verb = "was" if number == 1 else "were"
    return f"{count(number, 'corner')} at most {furthest:.2g} m from another one {verb} taken for it, {effect}"


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


@entry(float64[:, :, ::1])
@kernel
def _have_area(triangles: Floats) -> Flags:
    """Return which triangles (n,) are higher than the rounding of their own corners over their longest edge."""
    result = np.zeros(len(triangles), np.bool_)
    for k in range(len(triangles)):
        a, b, c = triangles[k]
        ux, uy, uz, vx, vy, vz = b[0] - a[0], b[1] - a[1], b[2] - a[2], a[0] - c[0], a[1] - c[1], a[2] - c[2]
        wx, wy, wz = c[0] - b[0], c[1] - b[1], c[2] - b[2]
        longest = max(abs(ux), abs(uy), abs(uz), abs(vx), abs(vy), abs(vz), abs(wx), abs(wy), abs(wz))
        if longest > 0.0:
            ux, uy, uz, vx, vy, vz = ux / longest, uy / longest, uz / longest, vx / longest, vy / longest, vz / longest
            height = max(abs(uy * vz - uz * vy), abs(uz * vx - ux * vz), abs(ux * vy - uy * vx))
            result[k] = height > 4.0 * EPSILON
    return result
