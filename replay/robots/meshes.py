"""The mesh files of a robot: named where they are, copied beside the part, or written there anew as STL."""

from __future__ import annotations

import importlib.util
import os
import shutil
import sysconfig
from dataclasses import dataclass, field
from pathlib import Path, PurePosixPath

import numpy as np

from replay import limits
from replay.errors import RobotError, WriteError
from replay.geometry.mesh_file import FORMATS
from replay.lfs_pointer import LFS_POINTER, is_lfs_pointer
from replay.numerics.arrays import Floats
from replay.robots import dae_file
from replay.robots.description import RobotChange
from replay.robots.names import RobotNames
from replay.robots.packages import Packages
from replay.robots.xml_text import XmlElement

_CONVERTED = ".dae"


@dataclass
class RobotMeshes:
    """What each mesh file of a robot is called in the part.

    Attributes:
        packages: finds the files.
        part: the file that the part is written to.
        copied: whether files are copied beside it.
        turned: whether COLLADA files are turned to z up by what they say is up.
        written: bytes to write, or the file to copy, by the path in which they will be.
        sources: file by its name in the part.
        changes: what a reader should know.
    """

    packages: Packages
    part: Path
    copied: bool
    turned: bool = True
    written: dict[Path, bytes | Path] = field(default_factory=dict)
    sources: dict[str, Path | bytes] = field(default_factory=dict)
    changes: list[RobotChange] = field(default_factory=list)
    _known: dict[Path, str] = field(default_factory=dict)
    _names: RobotNames = field(default_factory=RobotNames)

    def name(self, written: str, element: XmlElement) -> str:
        """Return what the part calls a file that a description names.

        Raises:
            RobotError: it is not to be found, or of a format that is not read.
            MissingPackageError: as of `dae_file.read`.
        """
        found = self.packages.find(written, element)
        if found.assumed:
            self.changes.append(RobotChange("meshes", found.assumed))
        if found.path not in self._known:
            ending = found.path.suffix.lower()
            if ending not in (*FORMATS, _CONVERTED):
                known = ", ".join((*FORMATS, _CONVERTED))
                raise element.wrong(f"{written[:200]!r} ends in {found.path.suffix!r}; meshes are read from {known}")
            try:
                size = found.path.stat().st_size
                if size > limits.FILE:
                    raise element.wrong(f"{written[:200]!r} has {size} bytes; at most {limits.FILE} are read")
                with found.path.open("rb") as file:
                    if is_lfs_pointer(file.read(1024)):
                        raise element.wrong(f"{written[:200]!r} {LFS_POINTER}")
                self._known[found.path] = self._placed(found.path, ending)
            except OSError as error:
                raise element.wrong(f"{written[:200]!r} cannot be read: {error.strerror}") from None
        return self._known[found.path]

    def save(self) -> None:
        """Write the files that stand beside the part; WriteError if one cannot be written."""
        for path, content in self.written.items():
            try:
                path.parent.mkdir(parents=True, exist_ok=True)
                if isinstance(content, bytes):
                    path.write_bytes(content)
                elif not (path.exists() and path.samefile(content)):
                    shutil.copyfile(content, path)
            except OSError as error:
                raise WriteError(str(path), error.strerror or str(error)) from None

    def _placed(self, path: Path, ending: str) -> str:
        content: bytes | Path = path
        if ending == _CONVERTED:
            found = dae_file.read(path, path.read_bytes(), turned=self.turned)
            content, ending = _stl(path, found.triangles), ".stl"
            turned = "" if found.up == "Z_UP" else _on_turning(found.up, self.turned)
            unit = "" if found.unit == 1.0 else f", from units of {found.unit:g} m to metres"
            self.changes.append(RobotChange(f"mesh {path.name}", f"is written as STL{unit}{turned}"))
        if not self.copied and content is path:
            name = self._in_place(path)
            self.sources[name] = path
            return name
        target = self.part.parent / self.part.stem / (self._names.take(path.stem) + ending)
        self.written[target] = content
        name = PurePosixPath(self.part.stem, target.name).as_posix()
        self.sources[name] = content
        return name

    def _in_place(self, path: Path) -> str:
        """Return a file's path from the part on, or its name in a Python package that holds it."""
        folder = self.part.resolve().parent
        if not path.is_relative_to(folder):
            packaged = _in_python_package(path)
            if packaged is not None:
                return packaged
            top = Path(os.path.commonpath([folder, path]))
            rule = f"scenarios that include this part must stand in {top}, or above; --copy-meshes copies the files"
            note = RobotChange("meshes", f"lie outside the part's folder: {rule}")
            if note not in self.changes:
                self.changes.append(note)
        return PurePosixPath(os.path.relpath(path, folder)).as_posix()


def _on_turning(up: str, turned: bool) -> str:
    if turned:
        return f", turned from {up} to z up; RViz, MoveIt and pinocchio leave it as it is, which --up-axis ignore does"
    return f", not turned although it says {up}, as RViz, MoveIt and pinocchio read it"


def _in_python_package(path: Path) -> str | None:
    """Return `package://NAME/path` of a file of an installed Python package, or None."""
    for folder in {Path(sysconfig.get_path(kind)).resolve() for kind in ("purelib", "platlib")}:
        if path.is_relative_to(folder):
            package, *inside = path.relative_to(folder).parts
            if inside and package.isidentifier() and importlib.util.find_spec(package) is not None:
                return f"package://{package}/{'/'.join(inside)}"
    return None


def _stl(path: Path, triangles: Floats) -> bytes:
    """Return triangles (n, 3, 3) [m] as a binary STL file, in single precision."""
    if float(np.max(np.abs(triangles))) > float(np.finfo(np.float32).max):
        raise RobotError(str(path), "has coordinates beyond what STL holds")
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
    rows = np.zeros(len(triangles), record)
    rows["corners"] = triangles
    normal = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.sqrt(np.sum(normal * normal, axis=1))
    rows["normal"] = np.divide(normal, length[:, None], out=np.zeros_like(normal), where=length[:, None] > 0.0)
    return b"written by replay import".ljust(80) + len(rows).to_bytes(4, "little") + rows.tobytes()
