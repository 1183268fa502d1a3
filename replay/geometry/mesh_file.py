"""Mesh files as vertices and faces: binary STL, OBJ and PLY read here, others by trimesh once they are whole."""

from __future__ import annotations

import io
import logging
import stat
import warnings
from pathlib import Path
from typing import Any, Final

import numpy as np

from replay import limits
from replay.errors import MeshError
from replay.geometry import stl_check
from replay.lfs_pointer import LFS_POINTER, is_lfs_pointer
from replay.numerics.arrays import Floats, Integers

FORMATS: Final = (".stl", ".obj", ".ply", ".glb")
"""File endings that can be read; upper case too."""

_HEAD = 1 << 16  # bytes among which a binary file has a zero
_ADVICE = "; open it in a mesh editor and save it again as triangles"
_UTF_8, _UTF_16 = b"\xef\xbb\xbf", (b"\xff\xfe", b"\xfe\xff")
"""How texts may begin."""


def read_faces(path: Path | str, data: bytes | None = None) -> tuple[Floats, Integers]:
    """Return a file's vertices (v, 3) and triangles (f, 3) as it holds them; a GLB's scene in place.

    Polygons are split into triangles, see `polygons`. Pictures and materials are never loaded, and no index and no
    number is checked here.

    Args:
        path: names the format, and errors.
        data: the file's content when it has been read already.

    Raises:
        MeshError: another format, or a file that is not whole: never fewer triangles than the file has.
    """
    name, ending = str(path), Path(path).suffix.lower()
    if ending not in FORMATS:
        raise MeshError(name, f"the file ending {Path(path).suffix!r} is not one of {', '.join(FORMATS)}")
    if data is None:
        try:
            found = Path(path).stat()
            if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
                raise MeshError(name, "is a pipe or a device; meshes are read from files")
            if found.st_size > limits.FILE:
                raise MeshError(name, f"has {found.st_size} bytes; at most {limits.FILE} are read")
            data = Path(path).read_bytes()
        except OSError as error:
            raise MeshError(name, error.strerror or "cannot be read") from error
    if not data:
        raise MeshError(name, "is empty")
    if len(data) > limits.FILE:
        raise MeshError(name, f"has {len(data)} bytes; at most {limits.FILE} are read")
    if len(data) > limits.TEXT_MESH and b"\0" not in data[:_HEAD]:
        raise MeshError(name, f"is text of {len(data)} bytes; at most {limits.TEXT_MESH} are read")
    if is_lfs_pointer(data):
        raise MeshError(name, LFS_POINTER)
    data = data.removeprefix(_UTF_8)
    if _is_utf_16(data):
        raise MeshError(name, "is UTF-16 text; save it as UTF-8")
    try:
        if ending == ".obj":
            from replay.geometry import obj_file

            return obj_file.read(data)
        if ending == ".ply":
            from replay.geometry import ply_file

            return ply_file.read(data)
        announced = 0
        if ending == ".stl":
            announced = stl_check.check(data)
            if stl_check.is_binary(data):
                return stl_check.triangles(data)
        else:
            from replay.geometry import glb_file

            data = glb_file.bare(data)
    except ValueError as error:
        raise MeshError(name, f"is not a usable {ending[1:].upper()} file: {error}") from None
    mesh = _by_trimesh(name, ending[1:], data)
    vertices = np.asarray(mesh.vertices, dtype=np.float64).reshape(-1, 3)
    faces = np.asarray(mesh.faces, dtype=np.int64).reshape(-1, 3)
    if len(faces) < announced:
        raise MeshError(name, f"announces {announced} faces, of which only {len(faces)} can be read{_ADVICE}")
    return vertices, faces


def _is_utf_16(data: bytes) -> bool:
    """Return whether a file is text of two bytes a letter: by its first two, or as every second one is 0."""
    odd, even = data[1:64:2], data[0:64:2]
    return data.startswith(_UTF_16) or (len(odd) > 8 and any(odd) != any(even) and (all(odd) or all(even)))


def _by_trimesh(name: str, kind: str, data: bytes) -> Any:
    """Return a file as one trimesh.Trimesh."""
    import trimesh

    if b"\0" not in data:  # text, whose names and comments may be in any encoding
        data = data.decode(errors="replace").encode()
    log = logging.getLogger("trimesh.util")  # it tells of its attempts with tracebacks
    told, log.disabled = log.disabled, True
    try:
        with warnings.catch_warnings():  # trimesh's own doubts become ours through the checks of the mesh
            warnings.simplefilter("ignore")
            return trimesh.load_scene(io.BytesIO(data), file_type=kind, process=False).to_mesh()
    except Exception as error:  # a foreign parser on a foreign file may raise anything
        reason = " ".join(str(error).split())
        if not reason or type(error).__module__ == "builtins":  # Python's words are none for people
            reason = "what it holds does not fit together"
        raise MeshError(name, f"is not a usable {kind.upper()} file: {reason[:200]}{_ADVICE}") from error
    finally:
        log.disabled = told
