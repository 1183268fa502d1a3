"""Where the files of a description are: `package://` names of ROS and paths beside it, and nothing outside of these."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path, PurePosixPath
from urllib.parse import unquote

from replay import limits
from replay.errors import RobotError
from replay.robots.xml_text import XmlElement

_UP = 4
"""Folders above a description that count as its own tree."""
_SCHEMES = ("package://", "model://")


@dataclass(frozen=True)
class Found:
    """A file, and what had to be assumed to find it, if anything."""

    path: Path
    assumed: str = ""


class Packages:
    """Finds the files that a description names.

    Args:
        description: the file that names them.
        given: folder by name of package.
        environment: ROS_PACKAGE_PATH, AMENT_PREFIX_PATH and COLCON_PREFIX_PATH are looked at.
    """

    def __init__(
        self, description: Path, given: Mapping[str, Path], environment: Mapping[str, str] | None = None
    ) -> None:
        self._folder = _real(description).parent
        self._given = {name: _real(folder) for name, folder in given.items()}
        self._environment = os.environ if environment is None else environment
        self._known: dict[str, tuple[Path, ...]] = {}

    def find(self, written: str, element: XmlElement) -> Found:
        """Return the file that is named.

        Args:
            written: as in the description.
            element: that names it, for errors.

        Raises:
            RobotError: it is not there, with where it was looked for, or it is outside of what belongs to the robot.
        """
        try:
            return self._find(written, element)
        except OSError as error:  # a name that is too long, a folder that may not be looked into
            raise element.wrong(f"{written[:200]!r} cannot be looked for: {error.strerror}") from None

    def _find(self, written: str, element: XmlElement) -> Found:
        text = unquote(written) if "%" in written else written
        if "\\" in text or "\0" in text:
            raise element.wrong(f"{written[:200]!r} is not a path that works everywhere; write / between folders")
        scheme = next((scheme for scheme in _SCHEMES if text.startswith(scheme)), None)
        if scheme is not None:
            return self._in_package(text.removeprefix(scheme), written, element)
        if "://" in text and not text.startswith("file://"):
            raise element.wrong(f"{written[:200]!r} is a URL; only package:// and files are read")
        path = self._folder / text.removeprefix("file://")
        tree = (self._tree, *self._given.values(), *self._search_path)
        for assumed, moved in self._further_up(PurePosixPath(text).parts) if not path.is_file() else ():
            if moved.is_file():
                return Found(self._existing(moved, (self._tree,), written, element), assumed)
        return Found(self._existing(path, tree, written, element))

    def _further_up(self, steps: tuple[str, ...]) -> Iterator[tuple[str, Path]]:
        """Yield what of a path may be which folder above the description, and the file in it.

        Paths may begin in the folder of many robots, with the name of this one's, or in one above the description's.
        """
        if len(steps) < 2 or steps[0] == "/" or ".." in steps:
            return
        for folder in self._above:
            if folder.name == steps[0]:
                yield f"{steps[0]}/ is taken to be {folder}", folder.joinpath(*steps[1:])
        for folder in (folder for folder in self._above[1:] if len(folder.parts) > 1):
            yield f"{steps[0]}/ is taken to be {folder / steps[0]}", folder.joinpath(*steps)

    @cached_property
    def _above(self) -> tuple[Path, ...]:
        """The description's own folder and those above it that count as its tree."""
        return (self._folder, *self._folder.parents)[: _UP + 1]

    @property
    def _tree(self) -> Path:
        inner = [folder for folder in self._above if len(folder.parts) > 1]  # never the whole file system
        return inner[-1] if inner else self._folder

    @cached_property
    def _search_path(self) -> tuple[Path, ...]:
        found: list[Path] = []
        for name, below in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share"), ("COLCON_PREFIX_PATH", "")):
            entries = self._environment.get(name, "").split(os.pathsep)
            found.extend(_real(Path(entry)) / below for entry in entries if entry)
        return tuple(found)

    def _in_package(self, text: str, written: str, element: XmlElement) -> Found:
        name, _, inside = text.lstrip("/").partition("/")
        steps = PurePosixPath(inside).parts
        if not name or not steps or inside.startswith("/") or ".." in (name, *steps):
            raise element.wrong(f"{written[:200]!r} is not of the form package://NAME/path/inside/it")
        roots = self._roots(name)
        for root in roots:
            if (root / inside).is_file():
                return Found(self._existing(root / inside, (root,), written, element))
        for taken, folder, path in self._moved(name, steps) if name not in self._given else ():
            if len(folder.parts) > 1 and path.is_file():
                found = self._existing(path, (self._tree,), written, element)
                return Found(found, f"{taken} is taken to be {folder}")
        deeper = [] if name in self._given else [folder for folder in self._inside(name) if (folder / inside).is_file()]
        if len(deeper) > 1:
            rule = f"is in each of {', '.join(map(str, deeper[:5]))}; say in which with --package {name}=DIR"
            raise element.wrong(f"{written[:200]!r} {rule}")
        if deeper:
            found = self._existing(deeper[0] / inside, (self._tree,), written, element)
            return Found(found, f"package {name} is taken to be {deeper[0]}")
        looked = [root / inside for root in roots]
        if not looked:
            folders = ", ".join(str(folder) for folder in (*self._above, *self._search_path))
            rule = f"no package {name!r} in {folders}"
        else:
            rule = f"looked for {', '.join(map(str, looked))}"
        raise element.wrong(f"{written[:200]!r} is not to be found: {rule}; give its folder with --package {name}=DIR")

    def _moved(self, name: str, steps: tuple[str, ...]) -> Iterator[tuple[str, Path, Path]]:
        """Yield what of a package may be which folder above the description, and the file in it.

        The own tree of a description that was moved has the file all the same: without the name of the package, or
        without the first steps of the way, where one that follows has the name of the folder.
        """
        for folder in self._above:
            yield f"package {name}", folder, folder.joinpath(*steps)
        for folder in self._above:
            for k in (k for k, step in enumerate(steps[:-1]) if step == folder.name):
                yield f"package {'/'.join((name, *steps[: k + 1]))}", folder, folder.joinpath(*steps[k + 1 :])

    def _inside(self, name: str) -> list[Path]:
        """Return the folders of a name anywhere in what the description's folder, or the one above it, holds."""
        return [folder for folder in self._below if folder.name == name]

    @cached_property
    def _below(self) -> tuple[Path, ...]:
        near = [folder for folder in self._above[:2] if len(folder.parts) > 2]  # never a folder of the whole system
        return tuple(dict.fromkeys(_walk(near[-1:], into_packages=True)))

    def _existing(self, path: Path, trees: Iterable[Path], written: str, element: XmlElement) -> Path:
        """Return a path that is a file; RobotError if it is none, or not in one of the trees."""
        found = Path(os.path.normpath(path))
        real = _real(found)
        if not any(real.is_relative_to(tree) for tree in trees):
            rule = "leads out of the robot's own folders; give the folder it is in with --package NAME=DIR"
            raise element.wrong(f"{written[:200]!r} {rule}")
        if not real.is_file():
            raise element.wrong(f"{written[:200]!r} is not to be found; looked for {found}")
        return real

    def _roots(self, name: str) -> tuple[Path, ...]:
        """Return the folders that may be a package, the likeliest first."""
        if name not in self._known:
            self._known[name] = tuple(dict.fromkeys(map(_real, self._candidates(name))))
        return self._known[name]

    def _candidates(self, name: str) -> Iterator[Path]:
        if name in self._given:
            yield self._given[name]
            return
        for folder in (*self._above, *self._search_path):
            if folder.name == name:
                yield folder
            yield from _beside(folder, name)
        yield from (folder for folder, called in self._manifests.items() if called == name)

    @cached_property
    def _manifests(self) -> dict[Path, str]:
        """Name by folder of the packages in the description's tree and on the search path, by their package.xml."""
        found: dict[Path, str] = {}
        near = [folder for folder in self._above if len(folder.parts) > 1]
        folders = [*near, *(child for folder in near for child in _folders(folder)), *_walk(self._search_path)]
        for folder in folders[: limits.ROBOT_FOLDERS]:
            name = _name_in(folder / "package.xml")
            if name:
                found.setdefault(folder, name)
        return found


def _real(path: Path) -> Path:
    """Return where a path leads; of links that go in a circle the path itself, which is no file."""
    return Path(os.path.realpath(path))


def _beside(folder: Path, name: str) -> Iterator[Path]:
    """Yield the folders in which workspaces and install trees keep a package of a name."""
    for root in (folder / name, folder / "share" / name, folder / name / "share" / name, folder / "src" / name):
        if root.is_dir():
            yield root


def _walk(roots: Iterable[Path], *, into_packages: bool = False) -> Iterator[Path]:
    """Yield folders and what is in them, breadth first, down to packages, and no more than are looked into."""
    waiting = list(roots)
    for number, folder in enumerate(waiting):
        if number >= limits.ROBOT_FOLDERS:
            return
        yield folder
        if into_packages or not (folder / "package.xml").is_file():
            waiting.extend(_folders(folder))


def _folders(folder: Path) -> list[Path]:
    try:
        return sorted(child for child in folder.iterdir() if child.is_dir() and not child.is_symlink())[:1000]
    except OSError:
        return []


def _name_in(manifest: Path) -> str | None:
    """Return the name of the package that a package.xml is of; None if it is none."""
    try:
        with manifest.open("rb") as file:
            text = file.read(1 << 16).decode(errors="replace")
    except OSError:
        return None
    found = re.search(r"<name>\s*([^<\s]{1,200})\s*</name>", text)
    return found[1] if found else None


def given(pairs: Iterable[str]) -> dict[str, Path]:
    """Return the folders of packages that are given as NAME=DIR.

    Raises:
        RobotError: one is not of this form, or names no folder.
    """
    found = {}
    for pair in pairs:
        name, _, folder = pair.partition("=")
        if not name or not folder:
            raise RobotError("--package", f"{pair!r} is not NAME=DIR")
        try:
            there = Path(folder).is_dir()
        except OSError:  # a name that is too long, a folder that may not be looked into
            there = False
        if not there:
            raise RobotError("--package", f"{pair[:200]!r} names no folder")
        found[name] = Path(folder)
    return found
