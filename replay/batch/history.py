"""One line a night: what became of each scenario, so that a report can say since when one fails."""

from __future__ import annotations

import stat
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from replay import limits
from replay.batch.written import read_night
from replay.errors import WriteError
from replay.logs.part_file import append_lines, json_line


@dataclass(frozen=True)
class Night:
    """One run: when, by which version, whether each scenario was fine, and its results as numbers.

    Attributes:
        time: when it was started, in ISO 8601.
        version: of replay.
        verdicts: of each scenario.
        failing: scenarios that need attention.
        results: numbers by the name of the measure, then by scenario; see `scenario.measures`.
        units: of the results, by the name of the measure.
        accepted: when a baseline was accepted last before this night; "" when nobody knows.
    """

    time: str
    version: str
    verdicts: Mapping[str, str]
    failing: frozenset[str]
    results: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    accepted: str = ""
    units: Mapping[str, str] = field(default_factory=dict)


def nights(path: Path, wanted: Callable[[str], bool] = lambda name: False) -> Iterator[Night]:
    """Yield the nights in the order of the file; lines that cannot be read, as a crash leaves them, are left out.

    A pipe or a device has none: what is appended to it is gone.

    Args:
        path: the history.
        wanted: whether the results of a measure of this name are wanted; of none when left out.

    Raises:
        WriteError: it cannot be read, or is larger than is read.
    """
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
            return
        if found.st_size > limits.HISTORY:
            raise WriteError(str(path), f"it has more than {limits.HISTORY} bytes: begin a new one")
        with path.open(encoding="utf-8") as lines:
            for line in lines:
                try:
                    entry = read_night(line)
                except ValueError:
                    continue
                results = {name: values for name, values in entry.get("results", {}).items() if wanted(name)}
                failing = frozenset(entry["failing"])
                accepted = entry.get("accepted", "")
                yield Night(
                    entry["time"],
                    entry["version"],
                    entry["verdicts"],
                    failing,
                    results,
                    accepted,
                    entry.get("units", {}),
                )
    except (FileNotFoundError, NotADirectoryError):
        return
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise WriteError(str(path), f"it cannot be read before it is appended to: {reason}") from None


def read_history(path: Path) -> list[Night]:
    """Return all nights without their results; errors as of `nights`."""
    return list(nights(path))


class Past:
    """What the nights before this one say of scenarios, without keeping them: since when they fail, and curves.

    Attributes:
        since: when the unbroken row of nights in which a scenario failed began, by scenario; nights in which it was not
            run say nothing about it.
    """

    CURVE = 30

    def __init__(self, history: Iterable[Night], measure: str) -> None:
        self.since: dict[str, str] = {}
        recent: deque[Mapping[str, float]] = deque(maxlen=self.CURVE)
        for night in history:
            recent.append(night.results.get(measure, {}))
            for name in night.verdicts:
                if name in night.failing:
                    self.since.setdefault(name, night.time)
                else:
                    self.since.pop(name, None)
        self._recent = tuple(recent)

    def curve(self, scenario: str) -> list[float | None]:
        """Return the values of the last nights, None where there is none."""
        return [night.get(scenario) for night in self._recent]


def check_history(path: Path | None) -> None:
    """Raise the WriteError now, before the night, that reading or appending would raise after it."""
    if path is not None:
        for _ in nights(path):
            pass
        append_lines(path, [], named=True)


def append_night(path: Path, night: Night, *, named: bool = False) -> None:
    """Append a night; WriteError when that is not possible. `named` as of `append_lines`."""
    entry = {
        "time": night.time,
        "version": night.version,
        "failing": sorted(night.failing),
        "verdicts": dict(night.verdicts),
        "accepted": night.accepted,
        "units": dict(night.units),
        "results": {name: dict(values) for name, values in night.results.items()},
    }
    append_lines(path, [json_line(entry)], named=named)


def failing_since(history: Iterable[Night], name: str) -> str | None:
    """Return when the unbroken row of nights in which a scenario failed began; None when it did not fail in the last.

    Nights in which it was not run say nothing about it.
    """
    return Past(history, "").since.get(name)
