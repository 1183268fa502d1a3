"""One line a night: what became of each scenario, so that a report can say since when one fails."""

from __future__ import annotations

import stat
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from replay import limits
from replay.batch.written import read_night
from replay.errors import WriteError
from replay.logs.part_file import append_lines, json_line


@dataclass(frozen=True)
class Night:
    """One run: when, by which version, and whether each scenario was fine."""

    time: str
    version: str
    verdicts: Mapping[str, str]
    failing: frozenset[str]


def read_history(path: Path) -> list[Night]:
    """Return all nights in the order of the file; lines that cannot be read, as a crash leaves them, are left out.

    A pipe or a device has none: what is appended to it is gone.
    """
    nights = []
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
            return []
        if found.st_size > limits.HISTORY:
            raise WriteError(str(path), f"it has more than {limits.HISTORY} bytes: begin a new one")
        lines = path.read_text(encoding="utf-8").splitlines()
    except (FileNotFoundError, NotADirectoryError):
        return []
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise WriteError(str(path), f"it cannot be read before it is appended to: {reason}") from None
    for line in lines:
        try:
            entry = read_night(line)
        except ValueError:
            continue
        nights.append(Night(entry["time"], entry["version"], entry["verdicts"], frozenset(entry["failing"])))
    return nights


def check_history(path: Path | None) -> None:
    """Raise the WriteError now, before the night, that reading or appending would raise after it."""
    if path is not None:
        read_history(path)
        append_lines(path, [], named=True)


def append_night(path: Path, night: Night, *, named: bool = False) -> None:
    """Append a night; WriteError when that is not possible. `named` as of `append_lines`."""
    entry = {
        "time": night.time,
        "version": night.version,
        "failing": sorted(night.failing),
        "verdicts": dict(night.verdicts),
    }
    append_lines(path, [json_line(entry)], named=named)


def failing_since(nights: list[Night], name: str) -> str | None:
    """Return when the unbroken row of nights in which a scenario failed began; None when it did not fail in the last.

    Nights in which it was not run say nothing about it.
    """
    since = None
    for night in reversed(nights):
        if name not in night.verdicts:
            continue
        if name not in night.failing:
            break
        since = night.time
    return since
