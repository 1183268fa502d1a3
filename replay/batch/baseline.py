"""The folder of accepted recordings: slim ones by scenario, meshes once, and a log of what was accepted and why."""

from __future__ import annotations

import contextlib
import datetime
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from replay.batch.claim import claim
from replay.errors import InvalidValue, RecordingError
from replay.json_text import read_json_file
from replay.language.fields import is_title
from replay.logs.mcap_reader import McapLog
from replay.logs.part_file import append_lines, json_line, refuse_link, remove_folder, write_error, write_file
from replay.recording.reader import read_provenance
from replay.recording.slim import OBJECTS, is_digest, write_slim

LOG = "accepted.jsonl"
STAGING = ".staging"
"""Name of the folder in which recordings are written before they are put in place."""


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
        """Return a scenario's accepted recording, or None; also one that may not be looked for, and cannot be read."""
        path = self._path(name)
        try:
            return path if path.is_file() else None
        except OSError:
            return path

    def names(self) -> list[str]:
        """Return the names of all scenarios that have one."""
        return sorted(folder.name for folder in self.directory.glob("*") if _may_be(self._path(folder.name)))

    def store(self, entries: Mapping[str, Entry], *, reason: str, now: datetime.datetime) -> None:
        """Store recordings by scenario and append what and why to the log.

        All are written first and put in place then, each in one step: at any moment every baseline is wholly the old
        one or wholly the new one. What was all written when a process was killed is put in place by the next one that
        stores. Meshes that nothing needs any more are removed; nothing outside the folder is.

        Raises:
            BusyError: another process writes the folder.
            InvalidValue: a scenario's name is none; nothing is changed then.
            RecordingError: a recording cannot be read, or is of another scenario; nothing is changed then.
            WriteError: the folder cannot be written, or a place in it is a link.
        """
        for name in entries:
            check_name(name)
        with claim(self.directory):
            for place in (OBJECTS, LOG, STAGING, *entries):
                refuse_link(self.directory / place)
            try:
                if line := self._staged_line():
                    self._put_in_place(line)
                remove_folder(self._staging)
                self._put_in_place(self._stage(entries, reason, now))
            except OSError as error:
                named = Path(error.filename) if isinstance(error.filename, str) else self.directory
                raise write_error(named, error) from None
            finally:
                if not self._staged_line():
                    remove_folder(self._staging)
                self._remove_unneeded()
                with contextlib.suppress(OSError):
                    (self.directory / OBJECTS).rmdir()

    @property
    def _staging(self) -> Path:
        return self.directory / STAGING

    def _staged_line(self) -> str:
        """Return the line for the log when all that is to be put in place is staged, else ""."""
        file = self._staging / LOG
        try:
            return "" if file.is_symlink() else json_line(read_json_file(file, surrogates=True))
        except (OSError, ValueError):
            return ""

    def _stage(self, entries: Mapping[str, Entry], reason: str, now: datetime.datetime) -> str:
        """Write all that is to be put in place, and the line for the log last; return that."""
        self._staging.mkdir()
        codes: set[str] = set()
        for name, entry in entries.items():
            staged = self._staging / f"{name}.mcap"
            check_scenario(entry.recording, name)
            write_slim(entry.recording, staged, self.directory / OBJECTS)
            with McapLog(staged) as log:
                codes.add(read_provenance(log).code)
        for name in entries:
            self._path(name).parent.mkdir(exist_ok=True)
        said = {
            "time": now.isoformat(timespec="seconds"),
            "reason": reason,
            "code": sorted(codes),
            "scenarios": {name: entry.what for name, entry in entries.items()},
        }
        line = json_line(said)
        write_file(self._staging / LOG, f"{line}\n")
        return line

    def _put_in_place(self, line: str) -> None:
        """Do what is staged, or the rest of it.

        It may be of another process, so that it is looked at like everything that others have written.
        """
        staged = sorted(self._staging.glob("*.mcap"))
        for file in staged:
            check_name(file.stem)
            check_scenario(file, file.stem)
            refuse_link(self.directory / file.stem)
        log = self.directory / LOG
        if not _ends_in(log, f"{line}\n".encode()):
            append_lines(log, [line])
        for file in staged:
            file.replace(self._path(file.stem))
        (self._staging / LOG).unlink()

    def _path(self, name: str) -> Path:
        return self.directory / name / f"{name}.mcap"

    def _remove_unneeded(self) -> None:
        """Remove the meshes that no recording needs; all stay when one cannot be read, which may need any.

        Only what has been put there is removed: files named by a SHA-256.
        """
        if (self.directory / OBJECTS).is_symlink():
            return
        needed: set[str] = set()
        for recording in (*map(self._path, self.names()), *self._staging.glob("*.mcap")):
            try:
                with McapLog(recording) as log:
                    needed.update(read_provenance(log).files.values())
            except RecordingError:
                return
        for file in (self.directory / OBJECTS).glob("*"):
            if file.name not in needed and is_digest(file.name) and file.is_file() and not file.is_symlink():
                with contextlib.suppress(OSError):
                    file.unlink()


def _may_be(path: Path) -> bool:
    """Return whether there is something at a path, or nobody knows."""
    try:
        path.lstat()
    except (FileNotFoundError, NotADirectoryError):
        return False
    except OSError:
        pass
    return True


def _ends_in(file: Path, data: bytes) -> bool:
    if not file.is_file():
        return False
    with file.open("rb") as stream:
        stream.seek(max(stream.seek(0, os.SEEK_END) - len(data), 0))
        return stream.read() == data


def check_name(name: str) -> None:
    """Raise InvalidValue unless a name, as a run.json may hold any, is one that scenarios and their folders have."""
    if not is_title(name):
        raise InvalidValue("scenario", repr(name), "is no scenario's name, which is that of a folder and no path")


def check_scenario(recording: Path, name: str) -> None:
    """Raise RecordingError unless a recording is a file, not a link to one, and of the scenario of that name."""
    try:
        linked = recording.is_symlink() or recording.parent.is_symlink()
    except OSError as error:
        raise RecordingError(str(recording), f"cannot be read: {error.strerror}") from None
    if linked:
        raise RecordingError(str(recording), "is a link, or in a folder that is one, and not a file of the run")
    with McapLog(recording) as log:
        found = read_provenance(log).scenario
    if found != name:
        raise RecordingError(str(recording), f"is a recording of the scenario {found!r}, not of {name!r}")
