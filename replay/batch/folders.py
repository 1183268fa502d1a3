"""Folders of scenarios, looked through with everything behind links to other folders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

SUFFIXES = (".yaml", ".yml")
"""What names of YAML files end in, in upper or lower case."""


@dataclass(frozen=True)
class FolderFiles:
    """What a folder holds: YAML files, sorted by path, and a line for each place that cannot be looked at."""

    files: list[Path]
    left_out: list[str]


def look_through(folder: Path) -> FolderFiles:
    """Return the YAML files of a folder and of all below, links to files and folders included, each folder once.

    Hidden files and folders are passed over. A link to no file that is named as one is among the files, so that reading
    it says what is wrong.
    """
    search = _Search()
    pending = [folder]
    while pending:  # folders as they are come before links to them, so that files have their shortest names
        for start in pending:
            search.below(start)
        pending, search.links = sorted(search.links), []
    return FolderFiles(sorted(search.files), search.left_out)


class _Search:
    def __init__(self) -> None:
        self.files: list[Path] = []
        self.left_out: list[str] = []
        self.links: list[Path] = []
        self._seen: set[Path] = set()

    def below(self, folder: Path) -> None:
        """Look through a folder, unless that has been done; links to others are kept for later."""
        here = folder.resolve()
        if here in self._seen:
            return
        self._seen.add(here)
        try:
            for path in sorted(folder.iterdir()):
                if not path.name.startswith("."):
                    self._looked_at(path, here)
        except OSError as error:
            self.left_out.append(f"{folder} is left out: it cannot be looked through: {error.strerror}")

    def _looked_at(self, path: Path, here: Path) -> None:
        try:
            self._entry(path, here)
        except OSError as error:  # a link into a folder that may not be looked into
            self.left_out.append(f"{path} is left out: it cannot be looked at: {error.strerror}")

    def _entry(self, path: Path, here: Path) -> None:
        if path.is_dir():
            if not path.is_symlink():
                self.below(path)
            elif path.resolve() in here.parents:
                self.left_out.append(f"{path} is left out: it is a link to a folder that it stands in")
            else:
                self.links.append(path)
        elif path.name.lower().endswith(SUFFIXES):
            if path.is_file() or not path.exists():
                self.files.append(path)
            else:
                self.left_out.append(f"{path} is left out: it is a pipe or a device")
        elif path.is_symlink() and not path.exists():
            self.left_out.append(f"{path} is left out: it is a link to nothing that is there")
