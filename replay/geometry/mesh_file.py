"""Mesh files as vertices and faces: OBJ read here, STL, PLY and GLB by trimesh once they are known to be whole."""

from __future__ import annotations

import io
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from replay.errors import MeshError
from replay.geometry import glb_check, obj_file, ply_check, polygons, stl_check

FORMATS: Final = (".stl", ".obj", ".ply", ".glb")
"""File endings that can be read; upper case too."""

_CHECKS: Final[dict[str, Callable[[bytes], int]]] = {
    ".stl": stl_check.check,
    ".ply": ply_check.check,
    ".glb": glb_check.check,
}
"""Each returns how many faces the file announces at least; ValueError where it is not whole, or not wholly read."""

_CORNERS: Final = ("vertex_index", "vertex_indices")
"""What PLY files call the corners of a face."""

_ADVICE = "; open it in a mesh editor and save it again as triangles"


def read_faces(path: Path | str, data: bytes | None = None) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return a file's vertices (v, 3) and triangles (f, 3) as it holds them; a GLB's scene in place.

    Polygons are split into triangles that share their first corner. No index and no number is checked here.

    Args:
        path: names the format, and errors.
        data: the file's content when it has been read already.

    Raises:
        MeshError: another format, a polygon that would be split wrongly, or a file that is not whole: never fewer
            triangles than the file has.
    """
    name, ending = str(path), Path(path).suffix.lower()
    if ending not in FORMATS:
        raise MeshError(name, f"the file ending {Path(path).suffix!r} is not one of {', '.join(FORMATS)}")
    if data is None:
        try:
            data = Path(path).read_bytes()
        except OSError as error:
            raise MeshError(name, error.strerror or "cannot be read") from error
    if not data:
        raise MeshError(name, "is empty")
    try:
        if ending == ".obj":
            return obj_file.read(data)
        announced = _CHECKS[ending](data)
    except ValueError as error:
        raise MeshError(name, f"is not a usable {ending[1:].upper()} file: {error}") from None
    mesh = _by_trimesh(name, ending[1:], data)
    vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    if len(faces) < announced:
        raise MeshError(name, f"announces {announced} faces, of which only {len(faces)} can be read{_ADVICE}")
    if ending == ".ply" and announced:
        _check_polygons(name, mesh)
    return vertices, faces


def _by_trimesh(name: str, kind: str, data: bytes) -> Any:
    """Return a file as one trimesh.Trimesh."""
    import trimesh

    if b"\0" not in data:  # text, whose names and comments may be in any encoding
        data = data.decode(errors="replace").encode()
    try:
        with warnings.catch_warnings():  # trimesh's own doubts become ours through the checks of the mesh
            warnings.simplefilter("ignore")
            return trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False).to_mesh()
    except Exception as error:  # a foreign parser on a foreign file may raise anything
        reason = " ".join(str(error).split()) or type(error).__name__
        if "unexpected length" in reason:  # trimesh's word for binary PLY whose lists differ in length
            reason = "it is cut, or its faces differ in their number of corners, which is read of text PLY only"
        raise MeshError(name, f"is not a usable {kind.upper()} file: {reason[:200]}{_ADVICE}") from error


def _check_polygons(name: str, mesh: Any) -> None:
    """Refuse a PLY file's polygons that are not convex, which trimesh splits all the same, and faces that it drops."""
    raw = mesh.metadata["_ply_raw"]
    listed = raw["face"]["data"]  # of a text, lists of any length by name; else rows with fields, lists of one length
    names = tuple(listed) if isinstance(listed, dict) else listed.dtype.names
    corners = listed[next((name for name in _CORNERS if name in names), names[0])]
    corners = corners if isinstance(listed, dict) else corners["f1"]
    if np.shape(corners)[1:] == (3,):
        return
    points = np.column_stack([raw["vertex"]["data"][axis] for axis in "xyz"]).astype(np.float64)
    triangles, sizes = polygons.split(corners)
    if not sizes.all():
        raise MeshError(name, f"face {int(np.argmin(sizes)) + 1} has fewer than three corners{_ADVICE}")
    if triangles.min() >= 0 and triangles.max() < len(points):  # else the mesh's own checks say so
        folded = polygons.first_folded(points[triangles], sizes)
        if folded is not None:
            raise MeshError(name, f"the polygon of face {folded + 1} {polygons.NOT_CONVEX}")
