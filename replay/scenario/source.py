"""Where the files of a scenario come from: a folder tree and installed packages, or a recording's attachments.

Every file has a name: its path relative to the scenario's folder with "/", or `package://PYTHON_PACKAGE/path`.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import posixpath
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Final, Protocol

from replay import limits
from replay.errors import Problem
from replay.language.node import KeyPath, Node, Place
from replay.lfs_pointer import LFS_POINTER, is_lfs_pointer

if TYPE_CHECKING:
    from replay.kinematics.motion import FreeTrack, Track

PACKAGE: Final = "package://"

_INSTALL: Final = {"pyskindose": "pip install --no-deps pyskindose"}
"""How to get the packages that are known; what else brings a package of some name, only its user knows."""


class SourceRule(Exception):
    """A file cannot be used; the text goes on after the file's name in a message."""


class Library(Protocol):
    """Files by name."""

    main: str

    def shown(self, name: str) -> str:
        """Return what messages call the file of this name."""

    def read(self, name: str) -> bytes:
        """Return the file's bytes; raises SourceRule."""


@dataclass
class ScenarioProvenance:
    """Where a scenario was read from.

    Attributes:
        main: name of the scenario file itself.
        sources: every file the scenario needs, by name.
        meshes: name of the mesh file of each mesh shape, by (link, shape).
        tracks: recorded motion by joint, read from a log, of which an excerpt is among the sources.
        free_tracks: recorded poses by free joint.
        measured: name of the log of the real machine among the sources; "" for none.
        originals: name and SHA-256 of the file that an excerpt among the sources was cut out of, by the source's name;
            and its `use`, of one that no reading depends on.
        log_notes: what a reader should know of the log although it is read.
        root: the text's tree, includes merged.
    """

    main: str = ""
    sources: dict[str, bytes] = field(default_factory=dict)
    meshes: dict[tuple[str, str], str] = field(default_factory=dict)
    tracks: dict[str, Track] = field(default_factory=dict, compare=False)
    free_tracks: dict[str, FreeTrack] = field(default_factory=dict, compare=False)
    measured: str = ""
    originals: dict[str, dict[str, str]] = field(default_factory=dict)
    log_notes: list[Problem] = field(default_factory=list, compare=False)
    root: Node | None = field(default=None, compare=False)

    @cached_property
    def sha256(self) -> dict[str, str]:
        """The SHA-256 of each source, in hexadecimal."""
        return {name: hashlib.sha256(data).hexdigest() for name, data in sorted(self.sources.items())}

    def place(self, path: KeyPath) -> Place | None:
        """Return where a path of the language is written; None for a scenario that was not read from text."""
        return None if self.root is None else locate(self.root, path)

    def problem(self, path: KeyPath, rule: str) -> Problem:
        """Return what is wrong with the value at a path, with its place."""
        if self.root is None:
            return Problem(f"{dotted(path)} {rule}")
        return problem_at(self.root, path, rule)


def locate(root: Node, path: KeyPath) -> Place:
    """Return where the value at a path is written: a scalar itself, a collection's key; or what comes nearest above."""
    node, place = root, root.place
    for step in path:
        below = node.child(step)
        if below is None:
            break
        collection = isinstance(below.value, dict | list)
        place = node.keys[step] if collection and isinstance(step, str) else below.place
        node = below
    return place


def find(root: Node, path: KeyPath) -> Node | None:
    """Return the node at a path, or None."""
    node: Node | None = root
    for step in path:
        node = None if node is None else node.child(step)
    return node


def problem_at(root: Node, path: KeyPath, rule: str, *, kind: bool = False) -> Problem:
    """Return `path = value rule` with its place; of a collection its kind, where that is what is wrong."""
    node = find(root, path)
    value = ""
    if node is not None and not isinstance(node.value, dict | list):
        value = f" = {node.shown()}"
    elif node is not None and kind:
        value = f" ({node.shown()})"
    name = dotted(path)
    return locate(root, path).problem(f"{name}{value} {rule}" if name else rule)


def dotted(path: KeyPath) -> str:
    """Return a path as people write it: `links.arm.shapes.box.size[2]`."""
    text = ""
    for step in path:
        if isinstance(step, int):
            text += f"[{step}]"
        else:
            shown = (
                step if re.fullmatch(r"[\w.\-]{1,100}", step) else repr(step if len(step) <= 60 else f"{step[:60]}...")
            )
            text += f".{shown}" if text else shown
    return text


def resolve_name(written: str, base: str) -> str:
    """Return the name of a file as written in the file named `base`.

    Raises:
        SourceRule: the path leaves the scenario's folder tree, or is not a relative path with "/".
    """
    if written.startswith(PACKAGE):
        package, _, path = written.removeprefix(PACKAGE).partition("/")
        steps = path.split("/")
        if not package.isidentifier() or any(step in ("", ".", "..") for step in steps) or "\\" in path:
            raise SourceRule("is not of the form package://PYTHON_PACKAGE/path/inside/it")
        return written
    if "://" in written:
        raise SourceRule("is a URL; write a path inside the scenario's folder, or package://PYTHON_PACKAGE/path")
    if "\\" in written or "\0" in written:
        raise SourceRule("is not a path that works everywhere; write / between folders")
    if written.startswith("/") or re.match(r"[A-Za-z]:", written):
        raise SourceRule("is an absolute path; write one relative to the file that names it")
    if base.startswith(PACKAGE):
        raise SourceRule("is named inside a package; only the scenario's own files may name files")
    name = posixpath.normpath(posixpath.join(posixpath.dirname(base), written))
    if name.split("/")[0] == "..":
        raise SourceRule("leads out of the scenario's folder; keep its files in that folder, or below it")
    return name


class Folder:
    """The folder tree of a scenario file, and installed packages."""

    def __init__(self, path: Path) -> None:
        self.main = path.name
        self.folder = path.parent

    def shown(self, name: str) -> str:
        """Return the path as given by the user, or the package:// name."""
        return name if name.startswith(PACKAGE) else (self.folder / name).as_posix()

    def read(self, name: str) -> bytes:
        """Return the file's bytes; a link that leads out of the folder tree is refused."""
        if name.startswith(PACKAGE):
            return _read(_in_package(name))
        path = self.folder / name
        if name != self.main and not _real(path).is_relative_to(_real(self.folder)):
            raise SourceRule("is a link that leads out of the scenario's folder; copy the file there")
        return _read(path)


class Attached:
    """Files held in memory, as attached to a recording."""

    def __init__(self, main: str, sources: Mapping[str, bytes]) -> None:
        self.main = main
        self._sources = sources

    def shown(self, name: str) -> str:
        """Return the name itself."""
        return name

    def read(self, name: str) -> bytes:
        """Return the attachment's bytes."""
        if name not in self._sources:
            raise SourceRule(f"is not attached; attached are {', '.join(sorted(self._sources)) or 'no files'}")
        return self._sources[name]


class Remembered:
    """Another library, each of whose files is read once: the cases of a sweep share their meshes in memory."""

    def __init__(self, library: Library) -> None:
        self.main = library.main
        self._library = library
        self._files: dict[str, bytes] = {}

    def shown(self, name: str) -> str:
        """Return what messages call the file of this name."""
        return self._library.shown(name)

    def read(self, name: str) -> bytes:
        """Return the file's bytes; raises SourceRule."""
        if name not in self._files:
            self._files[name] = self._library.read(name)
        return self._files[name]


def _real(path: Path) -> Path:
    """Return where a path leads; of links that go in a circle the path itself, and reading it says so."""
    return Path(os.path.realpath(path))


def _may_be(path: Path) -> bool:
    """Return whether a path is there, or cannot be looked for: reading it says why."""
    try:
        return path.exists()
    except OSError:
        return True


def _read(path: Path) -> bytes:
    try:
        if path.is_dir():
            raise SourceRule("is a folder; name a file")
        if path.exists() and not path.is_file():
            raise SourceRule("is not a regular file")
        size = path.stat().st_size
        if size > limits.FILE:
            raise SourceRule(f"has {size} bytes; at most {limits.FILE} are read")
        data = path.read_bytes()
        if is_lfs_pointer(data):
            raise SourceRule(LFS_POINTER)
        return data
    except FileNotFoundError:
        if path.is_symlink():
            raise SourceRule("is a link to a file that does not exist") from None
        raise SourceRule(f"does not exist{_similar(path)}") from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise SourceRule(f"cannot be read: {reason}") from None


def _similar(path: Path) -> str:
    import difflib

    try:
        names = sorted(entry.name for entry in path.parent.iterdir())
    except OSError:
        return f"; there is no folder {path.parent.as_posix()}"
    close = difflib.get_close_matches(path.name, names, n=1)
    return f"; did you mean {close[0]!r}?" if close else ""


def _in_package(name: str) -> Path:
    """Return the path of a file of an installed package, found without importing the package."""
    package, _, path = name.removeprefix(PACKAGE).partition("/")
    try:
        spec = importlib.util.find_spec(package)
    except (ImportError, ValueError):
        spec = None
    if spec is None:
        missing = f"needs the Python package {package!r}, which is not installed"
        if package in _INSTALL:
            raise SourceRule(f"{missing}; get it with: {_INSTALL[package]}")
        raise SourceRule(
            f"{missing}; install what brings it or, where {package!r} is a ROS package, copy the file into the"
            " scenario's folder and write its path"
        )
    folders = [Path(folder) for folder in spec.submodule_search_locations or ()]
    for folder in folders:
        file = folder / path
        if _may_be(file):
            if not _real(file).is_relative_to(_real(folder)):
                raise SourceRule(f"is a link that leads out of the package {package!r}")
            return file
    if not folders:
        raise SourceRule(f"names {package!r}, which is a single module without files")
    raise SourceRule(f"does not exist in the package {package!r}{_similar(folders[0] / path)}")
