"""run.json: what became of each scenario of a run, true at any moment, also of a run that is killed or out of space."""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import platform
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import psutil

import replay
from replay.batch.case import CaseResult, CaseStatus
from replay.comparison.run_folder import RUN
from replay.errors import NoSpaceError
from replay.logs.part_file import write_file

_SPARE = 4096
"""Bytes of blanks at its end while the run goes on: room for the last words when the disk is full by then."""
_SHARE = 0.05
"""Of the time that may go into writing it again and again."""


@dataclass(frozen=True)
class Run:
    """What became of a run.

    Attributes:
        directory: the run folder.
        results: of each scenario, in the order in which they were given.
        interrupted: it was ended before all scenarios were.
        started: when.
        seconds: wall time.
        workers: number of processes.
    """

    directory: Path
    results: tuple[CaseResult, ...]
    interrupted: bool
    started: datetime.datetime
    seconds: float
    workers: int

    @property
    def passed(self) -> bool:
        """Whether every scenario was recorded and kept its expectations."""
        return all(result.status is CaseStatus.PASSED for result in self.results)


class RunFile:
    """Keeps run.json up to date while a run goes on.

    Until the end it says that the run was interrupted, so that one that is killed is never taken for whole.
    """

    def __init__(self, directory: Path, names: Sequence[str], *, workers: int) -> None:
        self._directory = directory
        self._names = names
        self._workers = workers
        self._started = datetime.datetime.now(datetime.UTC)
        self._results: dict[str, CaseResult] = {}
        self._next = 0.0

    def __contains__(self, name: str) -> bool:
        return name in self._results

    def begin(self, results: Iterable[CaseResult]) -> None:
        """Write the file for the first time, with the results that are known already; errors as of `add`."""
        self._results = {result.name: result for result in results}
        self._write(self._now("it had not ended when this was written"))

    def add(self, result: CaseResult) -> None:
        """Take what became of a scenario, and write the file, unless that would take too much time or there is no room.

        Raises:
            WriteError: it cannot be written.
        """
        self._results[result.name] = result
        if time.monotonic() >= self._next:
            with contextlib.suppress(NoSpaceError):  # the recordings will notice it too
                self._write(self._now("it had not ended when this was written"))

    def end(self, *, interrupted: bool, whole: bool = True) -> Run:
        """Write the file for the last time, and return what it says.

        Args:
            interrupted: the run was ended before all scenarios were.
            whole: nothing is left to be done in the run folder; otherwise the file goes on saying "interrupted".

        Raises:
            WriteError: it cannot be written.
        """
        run = replace(self._now("the run was ended before this scenario was"), interrupted=interrupted)
        text = _text(run if whole else replace(run, interrupted=True))
        try:
            write_file(self._directory / RUN, text)
        except NoSpaceError:
            if not _overwritten(self._directory / RUN, text.encode()):
                raise
        return run

    def _now(self, missing: str) -> Run:
        lost = (CaseResult(name, CaseStatus.INTERRUPTED, error=missing) for name in self._names)
        results = tuple(self._results.get(result.name, result) for result in lost)
        seconds = (datetime.datetime.now(datetime.UTC) - self._started).total_seconds()
        return Run(self._directory, results, True, self._started, seconds, self._workers)

    def _write(self, run: Run) -> None:
        begin = time.monotonic()
        write_file(self._directory / RUN, _text(run) + " " * _SPARE + "\n")
        end = time.monotonic()
        self._next = end + (end - begin) / _SHARE


def as_json(run: Run) -> dict[str, object]:
    """Return what run.json holds: what belongs to this machine and this moment, which recordings do not know."""
    return {
        "replay": replay.__version__,
        "host": platform.node(),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "memory": psutil.virtual_memory().total,
        "workers": run.workers,
        "started": run.started.isoformat(timespec="seconds"),
        "seconds": round(run.seconds, 3),
        "interrupted": run.interrupted,
        "planned": len(run.results),
        "scenarios": {
            result.name: {
                "status": result.status.value,
                "seconds": round(result.seconds, 3),
                "memory": result.memory,
                **({"error": result.error} if result.error else {}),
                **({"reused": True} if result.reused else {}),
            }
            for result in run.results
        },
    }


def _text(run: Run) -> str:
    return json.dumps(as_json(run), indent=1) + "\n"


def _overwritten(file: Path, data: bytes) -> bool:
    """Write over what a file holds, in the room that it has, and return whether that was possible."""
    with contextlib.suppress(OSError), file.open("r+b") as stream:
        room = stream.seek(0, os.SEEK_END)
        if len(data) <= room and not file.is_symlink():
            stream.seek(0)
            stream.write(data.ljust(room - 1) + b"\n")
            stream.flush()
            os.fsync(stream.fileno())
            return True
    return False
