"""The folder of accepted recordings: slim ones by scenario, meshes once, and a log of what was accepted and why."""

from __future__ import annotations

import contextlib
import datetime
import json
import shutil
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from replay.batch.claim import claim
from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.part_file import append_lines, write_error, write_file
from replay.recording.reader import read_provenance
from replay.recording.slim import OBJECTS, write_slim

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
        one or wholly the new one. What was all written when a process was killed is put in place by the next one that
        stores. Meshes that nothing needs any more are removed.

        Raises:
            BusyError: another process writes the folder.
            RecordingError: a recording cannot be read; nothing is changed then.
            WriteError: the folder cannot be written.
        """
        with claim(self.directory):
            try:
                if self._all_is_staged():
                    self._put_in_place()
                shutil.rmtree(self._staging, ignore_errors=True)
                self._stage(entries, reason, now)
                self._put_in_place()
            except OSError as error:
                raise write_error(self.directory, error) from None
            finally:
                if not self._all_is_staged():
                    shutil.rmtree(self._staging, ignore_errors=True)
                self._remove_unneeded()
                with contextlib.suppress(OSError):
                    (self.directory / OBJECTS).rmdir()

    @property
    def _staging(self) -> Path:
        return self.directory / ".staging"

    def _all_is_staged(self) -> bool:
        return (self._staging / LOG).is_file()

    def _stage(self, entries: Mapping[str, Entry], reason: str, now: datetime.datetime) -> None:
        """Write all that is to be put in place, and the line for the log last."""
        self._staging.mkdir()
        codes: set[str] = set()
        for name, entry in entries.items():
            staged = self._staging / f"{name}.mcap"
            write_slim(entry.recording, staged, self.directory / OBJECTS)
            with McapLog(staged) as log:
                codes.add(read_provenance(log).code)
        for name in entries:
            self._path(name).parent.mkdir(exist_ok=True)
        line = {
            "time": now.isoformat(timespec="seconds"),
            "reason": reason,
            "code": sorted(codes),
            "scenarios": {name: entry.what for name, entry in entries.items()},
        }
        write_file(self._staging / LOG, json.dumps(line, ensure_ascii=False) + "\n")

    def _put_in_place(self) -> None:
        """Do what is staged, or the rest of it."""
        line = (self._staging / LOG).read_text(encoding="utf-8").rstrip("\n")
        log = self.directory / LOG
        if not (log.is_file() and log.read_text(encoding="utf-8").endswith(f"{line}\n")):
            append_lines(log, [line])
        for file in self._staging.glob("*.mcap"):
            file.replace(self._path(file.stem))
        (self._staging / LOG).unlink()

    def _path(self, name: str) -> Path:
        return self.directory / name / f"{name}.mcap"

    def _remove_unneeded(self) -> None:
        """Remove the meshes that no recording needs; all stay when one cannot be read, which may need any."""
        needed: set[str] = set()
        for recording in (*map(self._path, self.names()), *self._staging.glob("*.mcap")):
            try:
                with McapLog(recording) as log:
                    needed.update(read_provenance(log).files.values())
            except RecordingError:
                return
        for file in (self.directory / OBJECTS).glob("*"):
            if file.name not in needed:
                with contextlib.suppress(OSError):
                    file.unlink()
