"""The folder of accepted recordings: slim ones by scenario, meshes once, and a log of what was accepted and why."""

from __future__ import annotations

import contextlib
import datetime
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from replay.errors import InvalidValue, RecordingError
from replay.language.fields import is_title
from replay.logs.mcap_reader import McapLog
from replay.logs.part_file import append_lines, json_line, refuse_link, write_error
from replay.recording.reader import read_provenance
from replay.recording.slim import OBJECTS, is_digest, write_slim

LOG = "accepted.jsonl"


@dataclass(frozen=True)
class Entry:
    """One recording to be stored: where it is, and what is said of it in the log."""

    recording: Path
    what: str


class Baseline:
    """A baseline folder: DIR/NAME/NAME.mcap, DIR/objects/SHA256, DIR/accepted.jsonl; it need not be there yet."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def recording(self, name: str) -> Path | None:
        """Return a scenario's accepted recording, or None."""
        path = self._path(name)
        return path if path.is_file() else None

    def names(self) -> list[str]:
        """Return the names of all scenarios that have one."""
        return sorted(path.stem for path in self.directory.glob("*/*.mcap") if path.parent.name == path.stem)

    def store(self, entries: Mapping[str, Entry], *, reason: str, now: datetime.datetime) -> None:
        """Store recordings by scenario and append what and why to the log.

        All are written first and put in place then, each in one step: at any moment every baseline is wholly the old
        one or wholly the new one. Meshes that nothing needs any more are removed; nothing outside the folder is.

        Raises:
            InvalidValue: a scenario's name is none; nothing is changed then.
            RecordingError: a recording cannot be read, or is of another scenario; nothing is changed then.
            WriteError: the folder cannot be written, or a place in it is a link.
        """
        for name in entries:
            check_name(name)
        for place in (OBJECTS, LOG, *entries):
            refuse_link(self.directory / place)
        new, stored = not self.directory.exists(), False
        try:
            self.directory.mkdir(parents=True, exist_ok=True)
            staging = Path(tempfile.mkdtemp(prefix=".staging-", dir=self.directory))
        except OSError as error:
            raise write_error(self.directory, error) from None
        try:
            staged: dict[str, Path] = {}
            codes: set[str] = set()
            for name, entry in entries.items():
                staged[name] = staging / f"{len(staged)}.mcap"
                check_scenario(entry.recording, name)
                write_slim(entry.recording, staged[name], self.directory / OBJECTS)
                with McapLog(staged[name]) as log:
                    codes.add(read_provenance(log).code)
            for name, file in staged.items():
                self._path(name).parent.mkdir(exist_ok=True)
                file.replace(self._path(name))
            line = {
                "time": now.isoformat(timespec="seconds"),
                "reason": reason,
                "code": sorted(codes),
                "scenarios": {name: entry.what for name, entry in entries.items()},
            }
            append_lines(self.directory / LOG, [json_line(line)])
            stored = True
        except OSError as error:
            raise write_error(self.directory, error) from None
        finally:
            shutil.rmtree(staging, ignore_errors=True)
            if not stored:
                self._undo(new)
        self._remove_unneeded()

    def _path(self, name: str) -> Path:
        return self.directory / name / f"{name}.mcap"

    def _undo(self, new: bool) -> None:
        """Remove the meshes of recordings that were not stored, and the folders that are empty without them."""
        self._remove_unneeded()
        with contextlib.suppress(OSError):
            (self.directory / OBJECTS).rmdir()
        if new:
            with contextlib.suppress(OSError):
                self.directory.rmdir()

    def _remove_unneeded(self) -> None:
        """Remove the meshes that no recording needs; all stay when one cannot be read, which may need any.

        Only what has been put there is removed: files named by a SHA-256.
        """
        if (self.directory / OBJECTS).is_symlink():
            return
        needed: set[str] = set()
        for name in self.names():
            try:
                with McapLog(self._path(name)) as log:
                    needed.update(read_provenance(log).files.values())
            except RecordingError:
                return
        for file in (self.directory / OBJECTS).glob("*"):
            if file.name not in needed and is_digest(file.name) and file.is_file() and not file.is_symlink():
                with contextlib.suppress(OSError):
                    file.unlink()


def check_name(name: str) -> None:
    """Raise InvalidValue unless a name, as a run.json may hold any, is one that scenarios and their folders have."""
    if not is_title(name) or name == LOG:
        raise InvalidValue("scenario", repr(name), "is no scenario's name, which is that of a folder and no path")


def check_scenario(recording: Path, name: str) -> None:
    """Raise RecordingError unless a recording is a file, not a link to one, and of the scenario of that name."""
    if recording.is_symlink() or recording.parent.is_symlink():
        raise RecordingError(str(recording), "is a link, or in a folder that is one, and not a file of the run")
    with McapLog(recording) as log:
        found = read_provenance(log).scenario
    if found != name:
        raise RecordingError(str(recording), f"is a recording of the scenario {found!r}, not of {name!r}")
