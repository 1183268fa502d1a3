"""A scenario's folder in a run folder: what is in it at each moment is of one run, and says what became of it."""

from __future__ import annotations

import contextlib
import dataclasses
import json
from pathlib import Path

from replay import limits
from replay.batch.case import CaseResult, CaseStatus, describe
from replay.batch.written import RESULT
from replay.errors import NoSpaceError, WriteError, printable
from replay.logs.part_file import UNFINISHED, append_lines, refuse_link, write_file

KINDS = (".mcap", ".rrd")
LOG = "log.txt"
"""Name of the file that holds what a scenario said."""


def begin(folder: Path) -> None:
    """Remove the result of an earlier run, lest it stands beside a recording of this one, and what was left unfinished.

    The earlier recording stays until this one is whole.
    """
    for file in (folder / RESULT, *folder.glob(f"*{UNFINISHED}")):
        with contextlib.suppress(OSError):
            if file.is_file() and not file.is_symlink():
                file.unlink()


def finish(result: CaseResult, folder: Path) -> CaseResult:
    """Leave the folder as the result says: no recording of an earlier run beside the failure of this one.

    Returns:
        The result, or that the folder cannot be written.
    """
    try:
        refuse_link(folder)
    except WriteError as error:
        return unwritable(result, error)
    if result.status.recorded:
        result = _told(result, folder)
    if not result.status.recorded:
        for kind in KINDS:
            with contextlib.suppress(OSError):
                (folder / f"{result.name}{kind}").unlink(missing_ok=True)
        result = _told(result, folder)
    return result


def said(folder: Path) -> list[str]:
    """Return the last lines of a scenario's log; none where it cannot be read."""
    log = folder / LOG
    with contextlib.suppress(OSError):
        if log.is_file():
            with log.open("rb") as stream:
                stream.seek(max(log.stat().st_size - limits.LOG_SHOWN, 0))
                return stream.read(limits.LOG_SHOWN).decode(errors="replace").splitlines()
    return []


def is_there(file: Path) -> bool:
    """Return whether a file is in a scenario's folder; no where that cannot be looked into."""
    try:
        return file.is_file()
    except OSError:
        return False


def unwritable(result: CaseResult, error: WriteError) -> CaseResult:
    """Return the result of a scenario whose folder cannot be written."""
    failed = CaseResult(result.name, CaseStatus.FAILED, error=result.error or str(error), invalid=result.invalid)
    full = result.no_space or isinstance(error, NoSpaceError)
    return dataclasses.replace(failed, seconds=result.seconds, memory=result.memory, no_space=full)


def remove_unfinished(folder: Path) -> None:
    """Remove what a scenario that was ended has written; what an earlier run left stays."""
    for file in (*folder.glob(f"*{UNFINISHED}"), folder / LOG) if not folder.is_symlink() else ():
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)


def _told(result: CaseResult, folder: Path) -> CaseResult:
    try:
        write_file(folder / RESULT, json.dumps(result.as_json(), indent=1) + "\n")
        append_lines(folder / LOG, map(printable, describe(result)))
    except WriteError as error:
        return unwritable(result, error)
    return result
