"""What a benchmark leaves behind: bench.json, tables as text, and one self-contained HTML page with plots."""

from __future__ import annotations

import base64
import html
import io
import json
import math
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any

from replay.bench.measure import Goal, Row
from replay.logs.part_file import write_file

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
class Plot:
    """A log-log plot: one line (or cloud) of (x, y) per name.

    Attributes:
        title, x_label, y_label: texts.
        lines: points by name; an error of 0 is drawn at `LEAST_ERROR`.
        joined: whether the points of a name are joined by a line.
        front: whether the Pareto front is drawn: the points that no other beats in x and in y.
        crossed: points of methods that missed something, drawn with a cross; they are not on the front.
    """

    title: str
    x_label: str
    y_label: str
    lines: dict[str, list[tuple[float, float]]]
    joined: bool = False
    front: bool = False
    crossed: list[tuple[float, float]] = field(default_factory=list)


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
    """One run of a benchmark: tables of rows by title, goals, and plots."""

    name: str
    tables: dict[str, list[Row]] = field(default_factory=dict)
    grids: dict[str, Grid] = field(default_factory=dict)
    goals: list[Goal] = field(default_factory=list)
    plots: list[Plot] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    def as_json(self) -> dict[str, Any]:
        """Return the report as JSON values; NaN and infinities are written as null."""
        return {
            "benchmark": self.name,
            "machine": machine(),
            "tables": {title: [_finite(asdict(row)) for row in rows] for title, rows in self.tables.items()},
            "grids": {title: grid.lines for title, grid in self.grids.items()},
            "goals": [_finite({**asdict(goal), "verdict": goal.verdict}) for goal in self.goals],
            "notes": self.notes,
        }

    def as_text(self) -> str:
        """Return the tables and goals as plain text."""
        parts = []
        for title, rows in self.tables.items():
            parts.append(f"{title}\n" + _align([_HEADINGS, *(_cells(row) for row in rows)]))
        for title, grid in self.grids.items():
            parts.append(f"{title}\n" + _align(grid.cells()))
        if self.goals:
            cells = [("goal", "target", "measured", "verdict"), *(_goal_cells(goal) for goal in self.goals)]
            parts.append("goals\n" + _align(cells))
        parts.extend(self.notes)
        return "\n\n".join(parts)

    def write(self, directory: Path) -> tuple[Path, Path]:
        """Write `<name>.json` and `<name>.html` into a directory and return their paths."""
        data, page = directory / f"{self.name}.json", directory / f"{self.name}.html"
        write_file(data, json.dumps(self.as_json(), indent=1) + "\n")
        write_file(page, self.as_html())
        return data, page

    def as_html(self) -> str:
        """Return one HTML page that needs no other file."""
        facts = "".join(f"<li>{html.escape(f'{key}: {value}')}</li>" for key, value in machine().items())
        goals = [("goal", "target", "measured", "verdict"), *(_goal_cells(goal) for goal in self.goals)]
        tables = "".join(
            f"<h2>{html.escape(title)}</h2>{_html_table([_HEADINGS, *(_cells(row) for row in rows)])}"
            for title, rows in self.tables.items()
        )
        tables += "".join(
            f"<h2>{html.escape(title)}</h2>{_html_table(grid.cells())}" for title, grid in self.grids.items()
        )
        pictures = "".join(
            f'<figure><img alt="{html.escape(plot.title)}" src="data:image/png;base64,{_png(plot)}"></figure>'
            for plot in self.plots
        )
        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        return _PAGE.format(
            title=html.escape(self.name),
            facts=facts,
            goals=_html_table(goals) if self.goals else "",
            tables=tables,
            pictures=pictures,
            notes=notes,
        )


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


def pareto_plot(title: str, rows: Sequence[Row], error: str, groups: dict[str, str] | None = None) -> Plot:
    """Return error over time per query for the rows that did not fail, the Pareto front marked.

    Args:
        title, error: texts; `error` says what the error is measured in.
        rows: of one case.
        groups: name of the line a method belongs to; its own name where it is not listed.
    """
    lines: dict[str, list[tuple[float, float]]] = {}
    crossed = []
    for row in rows:
        if row.rounds and not row.failed:
            name = (groups or {}).get(row.method, row.method)
            lines.setdefault(name, []).append((row.median, row.worst_error))
            if row.missed:
                crossed.append((row.median, row.worst_error))
    return Plot(title, "s per query", error, lines, joined=True, front=True, crossed=crossed)


def pareto_front(points: Sequence[tuple[float, float]]) -> list[tuple[float, float]]:
    """Return the points that no other point beats in both coordinates, by growing x."""
    front: list[tuple[float, float]] = []
    for point in sorted(points):
        if not front or point[1] < front[-1][1]:
            front.append(point)
    return front


_HEADINGS = ("case", "method", "us/query", "fastest", "slowest", "worst error", "mean error", "wrong", "note")


def _cells(row: Row) -> tuple[str, ...]:
    if row.rounds == 0:
        return (row.case, row.method, "", "", "", "", "", "", row.note)
    missed = f"{row.missed} missed" if row.missed else ""
    note = "FAILED: wrong answers" if row.failed else row.note or missed
    times = (f"{1e6 * value:.4g}" for value in (row.median, row.low, row.high))
    mean = "" if math.isnan(row.mean_error) else f"{row.mean_error:.2g}"
    return (row.case, row.method, *times, f"{row.worst_error:.2g}", mean, f"{row.wrong}/{row.queries}", note)


def _goal_cells(goal: Goal) -> tuple[str, ...]:
    measured = "" if math.isnan(goal.measured) else f"{goal.measured:.3g} {goal.unit}"
    return (goal.what, goal.target, measured, goal.verdict)


def _align(rows: Sequence[Sequence[str]]) -> str:
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows
    )


def _html_table(rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in rows[0])
    body = "".join("<tr>" + "".join(f"<td>{html.escape(c)}</td>" for c in row) + "</tr>" for row in rows[1:])
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _finite(values: dict[str, Any]) -> dict[str, Any]:
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in values.items()}


def _png(plot: Plot) -> str:
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5, 5.0), layout="constrained")
    axes = figure.add_subplot(xscale="log", yscale="log", xlabel=plot.x_label, ylabel=plot.y_label, title=plot.title)
    drawn = {
        name: sorted((point[0], max(point[1], LEAST_ERROR)) for point in points) for name, points in plot.lines.items()
    }
    for name, line in drawn.items():
        axes.plot(*zip(*line, strict=True), "o-" if plot.joined else "o", label=name, markersize=5)
    if plot.front and drawn:
        crossed = {(x, max(y, LEAST_ERROR)) for x, y in plot.crossed}
        front = pareto_front([point for line in drawn.values() for point in line if point not in crossed])
        if front:
            axes.step(*zip(*front, strict=True), "k--", where="post", linewidth=1, label="Pareto front")
            axes.plot(*zip(*front, strict=True), "ko", markersize=11, fillstyle="none")
        if crossed:
            axes.plot(*zip(*crossed, strict=True), "kx", markersize=10, label="misses something")
    axes.grid(visible=True, which="major", alpha=0.3)
    if drawn:
        axes.legend(fontsize=8)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>replay bench {title}</title><style>
body {{ font: 14px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 70rem; padding: 0 1rem; color: #1d2329; }}
table {{ border-collapse: collapse; margin: .5rem 0 1.5rem; }}
th, td {{ border-bottom: 1px solid #d7dce1; padding: .2rem .7rem; text-align: left; }}
td {{ font-variant-numeric: tabular-nums; }}
img {{ max-width: 100%; }} ul {{ color: #56616c; }}
</style></head><body><h1>replay bench {title}</h1><ul>{facts}</ul>{goals}{tables}{pictures}{notes}</body></html>
"""
