"""What a run of benchmarks leaves: bench.json, bench.html, bench.png, and text that ends with the goals."""

from __future__ import annotations

import json
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from replay.bench import goals
from replay.bench.page import page, png
from replay.bench.report import Report, align, machine
from replay.json_text import read_json_file, typed
from replay.logs.part_file import write_file

_JSON = "bench.json"


def as_text(reports: Sequence[Report]) -> str:
    """Return tables and notes of all benchmarks, and the goals."""
    parts = [f"{report.name}\n{'=' * len(report.name)}\n\n{report.as_text()}" for report in reports]
    several = _goals(reports)
    if several:
        parts.append("goals\n" + align([goals.HEADINGS, *(goal.cells() for goal in several)]))
    return "\n\n\n".join(parts)


def as_json(reports: Sequence[Report]) -> dict[str, Any]:
    """Return everything as JSON values."""
    return {
        "machine": facts(reports),
        "goals": [goal.as_json() for goal in _goals(reports)],
        "benchmarks": {report.name: report.as_json() for report in reports},
    }


def facts(reports: Sequence[Report]) -> dict[str, str]:
    """Return what the times belong to: machine, versions, and how much times varied within the run."""
    spreads = [
        row.high / row.low
        for report in reports
        for rows in report.tables.values()
        for row in rows
        if row.rounds > 1 and row.low > 0.0
    ]
    found = machine()
    if spreads:
        middle, most = statistics.median(spreads), max(spreads)
        found["noise"] = f"slowest over fastest round of a method: median {middle:.2f}, at most {most:.2f}"
    return found


def write(reports: Sequence[Report], directory: Path) -> list[Path]:
    """Write bench.json, bench.html and, of plots that stand for the run, bench.png; return their paths.

    Raises:
        WriteError: it cannot be written.
    """
    files = {
        _JSON: (json.dumps(as_json(reports), indent=1) + "\n").encode(),
        "bench.html": page(reports, facts(reports)).encode(),
    }
    headlines = [plot for report in reports for plot in report.plots if plot.headline]
    if headlines:
        files["bench.png"] = png(*headlines)
    return [write_file(directory / name, content) for name, content in files.items()]


def earlier_seconds(directory: Path) -> dict[str, float]:
    """Return what each benchmark took in the run whose report is in a folder [s]; none if there is no report."""
    try:
        found = typed(read_json_file(directory / _JSON), _WrittenBench)["benchmarks"]
    except (OSError, ValueError):
        return {}
    return {name: report["seconds"] for name, report in found.items()}


class _Timed(TypedDict):
    seconds: float


class _WrittenBench(TypedDict):
    benchmarks: dict[str, _Timed]


def _goals(reports: Sequence[Report]) -> list[goals.Goal]:
    return goals.in_order(goal for report in reports for goal in report.goals)
