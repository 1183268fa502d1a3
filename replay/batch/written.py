"""What commands have written beside recordings and read again, value by value: whoever may have changed it since."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, NotRequired

from pydantic import Field, FiniteFloat
from typing_extensions import TypedDict

from replay.json_text import read_json, read_json_file, typed

RESULT = "result.json"
"""Name of the file that says what became of a scenario, in its folder."""

_Count = Annotated[int, Field(ge=0, lt=1 << 53)]


class WrittenOutcome(TypedDict):
    """What became of an expectation."""

    expectation: str
    passed: bool
    detail: str


class WrittenMeasure(TypedDict):
    """A number among the results; see `scenario.measures.Measure`."""

    scenario: str
    name: str
    value: FiniteFloat | None
    unit: str
    time: FiniteFloat | None
    subject: str
    limit: FiniteFloat | None
    margin: FiniteFloat | None


class WrittenResult(TypedDict):
    """result.json."""

    scenario: str
    status: str
    frames: _Count
    error: str
    expectations: list[WrittenOutcome]
    counters: dict[str, _Count]
    notes: list[str]
    between_frames: NotRequired[list[str]]
    results: NotRequired[list[WrittenMeasure]]
    guards: NotRequired[list[dict[str, Any]]]
    reactions: NotRequired[list[str]]


class WrittenNight(TypedDict):
    """A line of a history."""

    time: str
    version: str
    verdicts: dict[str, str]
    failing: list[str]
    accepted: NotRequired[str]
    units: NotRequired[dict[str, str]]
    results: NotRequired[dict[str, dict[str, FiniteFloat]]]


def read_result(path: Path) -> WrittenResult:
    """Return what a result.json says; OSError or ValueError when it is none that replay wrote."""
    return typed(read_json_file(path), WrittenResult)


def read_night(line: str) -> WrittenNight:
    """Return what a line of a history says; ValueError when it is none that replay wrote."""
    return typed(read_json(line, surrogates=True), WrittenNight)
