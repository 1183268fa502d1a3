"""What commands have written beside recordings and read again, value by value: whoever may have changed it since."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field
from typing_extensions import TypedDict

from replay import limits
from replay.json_text import read_json, typed

RUN, RESULT = "run.json", "result.json"
"""Names of what a run folder, and a scenario's folder in it, hold."""

_Count = Annotated[int, Field(ge=0, lt=1 << 53)]


class RunScenario(TypedDict):
    """What run.json says of one scenario, as far as it is read."""

    status: str


class WrittenRun(TypedDict):
    """run.json, as far as it is read."""

    scenarios: dict[str, RunScenario]
    interrupted: bool


class WrittenOutcome(TypedDict):
    """What became of an expectation."""

    expectation: str
    passed: bool
    detail: str


class WrittenResult(TypedDict):
    """result.json."""

    scenario: str
    status: str
    frames: _Count
    error: str
    expectations: list[WrittenOutcome]
    counters: dict[str, _Count]
    notes: list[str]


class WrittenNight(TypedDict):
    """A line of a history."""

    time: str
    version: str
    verdicts: dict[str, str]
    failing: list[str]


def read_run(directory: Path) -> WrittenRun:
    """Return what a run folder's run.json says; OSError or ValueError when there is none that replay wrote."""
    return typed(_document(directory / RUN), WrittenRun)


def read_result(path: Path) -> WrittenResult:
    """Return what a result.json says; OSError or ValueError when it is none that replay wrote."""
    return typed(_document(path), WrittenResult)


def read_night(line: str) -> WrittenNight:
    """Return what a line of a history says; ValueError when it is none that replay wrote."""
    return typed(read_json(line), WrittenNight)


def _document(path: Path) -> Any:
    if not path.is_file():
        raise FileNotFoundError(str(path))
    if path.stat().st_size > limits.RECORD_JSON:
        raise ValueError(f"it has more than {limits.RECORD_JSON} bytes")
    return read_json(path.read_bytes())
