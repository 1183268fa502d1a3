"""What one benchmark found: tables of timed rows, tables of another shape, goals and plots; as text and as JSON."""

from __future__ import annotations

import math
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from replay.bench.goals import Goal
from replay.bench.measure import Row

PACKAGES = (
    "numpy",
    "numba",
    "llvmlite",
    "scipy",
    "trimesh",
    "python-fcl",
    "coal",
    "mujoco",
    "embreex",
    "rerun-sdk",
    "mcap",
)


@dataclass(frozen=True)
class LogLogPlot:
    """A log-log plot: one line (or cloud) of (x, y) per name.

    Attributes:
        title, x_label, y_label: texts.
        lines: points by name; an error of 0 is drawn at `LEAST_ERROR`.
        joined: whether the points of a name are joined by a line.
        front: whether the Pareto front is drawn: the points that no other beats in x and in y.
        crossed: points of methods that missed something, drawn with a cross; they are not on the front.
        headline: whether it is among those that stand for the whole run.
    """

    title: str
    x_label: str
    y_label: str
    lines: dict[str, list[tuple[float, float]]]
    joined: bool = False
    front: bool = False
    crossed: list[tuple[float, float]] = field(default_factory=list)
    headline: bool = False


LEAST_ERROR = 1e-17
"""Where plots draw an error of 0, and what is smaller."""


@dataclass(frozen=True)
class Grid:
    """A table of another shape than timed rows: one dictionary a line, all with the same keys."""

    lines: list[dict[str, Any]]

    def cells(self) -> list[list[str]]:
        """Return headings and lines as texts."""
        return [list(self.lines[0]), *([str(value) for value in line.values()] for line in self.lines)]


@dataclass
class Report:
    """One run of a benchmark: tables of rows by title, goals, plots, notes, and what was said on standard error.

    Attributes:
        seconds: what it took [s].
    """

    name: str
    tables: dict[str, list[Row]] = field(default_factory=dict)
    grids: dict[str, Grid] = field(default_factory=dict)
    goals: list[Goal] = field(default_factory=list)
    plots: list[LogLogPlot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    said: list[str] = field(default_factory=list)
    seconds: float = 0.0

    def as_json(self) -> dict[str, Any]:
        """Return the report as JSON values; NaN and infinities are written as null."""
        return {
            "tables": {title: [_finite(asdict(row)) for row in rows] for title, rows in self.tables.items()},
            "grids": {title: grid.lines for title, grid in self.grids.items()},
            "goals": [goal.as_json() for goal in self.goals],
            "notes": self.notes,
            "said": self.said,
            "seconds": round(self.seconds, 1),
        }

    def as_text(self) -> str:
        """Return tables and notes as plain text."""
        parts = []
        for title, rows in self.tables.items():
            parts.append(f"{title}\n" + align(cells_of(rows)))
        for title, grid in self.grids.items():
            parts.append(f"{title}\n" + align(grid.cells()))
        parts.extend(self.notes)
        return "\n\n".join(parts)


def machine() -> dict[str, str]:
    """Return what the times belong to: processor, core count, system, versions of the packages that took part."""
    versions = []
    for package in PACKAGES:
        try:
            versions.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{package} not installed")
    return {
        "processor": _processor(),
        "cores": str(os.cpu_count()),
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": ", ".join(versions),
    }


def _processor() -> str:
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()


def pareto_plot(
    title: str, rows: Sequence[Row], error: str, groups: dict[str, str] | None = None, *, headline: bool = False
) -> LogLogPlot:
    """Return error over time per query for the rows that did not fail, the Pareto front marked.

    Args:
        title, error: texts; `error` says what the error is measured in.
        rows: of one case.
        groups: name of the line a method belongs to; its own name where it is not listed.
        headline: see `LogLogPlot`.
    """
    lines: dict[str, list[tuple[float, float]]] = {}
    crossed = []
    for row in rows:
        if row.rounds and not row.failed:
            name = (groups or {}).get(row.method, row.method)
            lines.setdefault(name, []).append((row.median, row.worst_error))
            if row.missed:
                crossed.append((row.median, row.worst_error))
    return LogLogPlot(title, "s per query", error, lines, joined=True, front=True, crossed=crossed, headline=headline)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points that no other point beats in both coordinates, by growing x."""
    front: list[tuple[float, float]] = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front


_HEADINGS = ("case", "method", "us/query", "fastest", "slowest", "worst error", "mean error", "wrong", "note")


def cells_of(rows: Sequence[Row]) -> list[tuple[str, ...]]:
    """Return headings and timed rows as texts."""
    return [_HEADINGS, *(_cells(row) for row in rows)]


def _cells(row: Row) -> tuple[str, ...]:
    if row.rounds == 0:
        return (row.case, row.method, "", "", "", "", "", "", row.note)
    missed = f"{row.missed} missed" if row.missed else ""
    note = "FAILED: wrong answers" if row.failed else row.note or missed
    times = (f"{1e6 * value:.4g}" for value in (row.median, row.low, row.high))
    mean = "" if math.isnan(row.mean_error) else f"{row.mean_error:.2g}"
    return (row.case, row.method, *times, f"{row.worst_error:.2g}", mean, f"{row.wrong}/{row.queries}", note)


def align(rows: Sequence[Sequence[str]]) -> str:
    """Return rows of cells as lines of text in columns."""
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()}
