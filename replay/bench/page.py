"""Benchmarks as one HTML page that needs no other file: the goals first, then tables and log-log plots."""

from __future__ import annotations

import base64
import html
import io
from collections.abc import Mapping, Sequence
from typing import Any

from replay.bench import goals
from replay.bench.report import LEAST_ERROR, LogLogPlot, Report, cells_of, pareto_front


def page(reports: Sequence[Report], facts: Mapping[str, str]) -> str:
    """Return the page of some benchmarks.

    Args:
        reports: in the order in which they are shown.
        facts: about the machine and the run.
    """
    listed = "".join(f"<li>{html.escape(f'{key}: {value}')}</li>" for key, value in facts.items())
    several = goals.in_order(goal for report in reports for goal in report.goals)
    table = _table([goals.HEADINGS, *(goal.cells() for goal in several)]) if several else "<p>none in this run</p>"
    return _PAGE.format(
        title=html.escape(", ".join(report.name for report in reports)),
        facts=listed,
        goals=table,
        body="".join(map(_section, reports)),
    )


def _section(report: Report) -> str:
    tables = "".join(f"<h3>{html.escape(title)}</h3>{_table(cells_of(rows))}" for title, rows in report.tables.items())
    tables += "".join(f"<h3>{html.escape(title)}</h3>{_table(grid.cells())}" for title, grid in report.grids.items())
    pictures = "".join(
        f'<figure><img alt="{html.escape(plot.title)}" src="data:image/png;base64,{_base64(plot)}"></figure>'
        for plot in report.plots
    )
    notes = "".join(f"<p>{html.escape(note)}</p>" for note in report.notes)
    if report.said:
        said = html.escape("\n".join(report.said))
        notes += f"<details><summary>said on standard error meanwhile</summary><pre>{said}</pre></details>"
    return f"<h2>{html.escape(report.name)}</h2>{tables}{pictures}{notes}"


def _table(rows: Sequence[Sequence[str]]) -> str:
    head = "".join(f"<th>{html.escape(cell)}</th>" for cell in rows[0])
    body = "".join(
        "<tr>" + "".join(f'<td class="{_MARKED.get(cell, "")}">{html.escape(cell)}</td>' for cell in row) + "</tr>"
        for row in rows[1:]
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


_MARKED = {"met": "met", "missed": "missed", "wrong": "missed"}


def _base64(plot: LogLogPlot) -> str:
    return base64.b64encode(png(plot)).decode("ascii")


def png(*plots: LogLogPlot) -> bytes:
    """Return plots side by side as a PNG picture."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.5 * len(plots), 5.0), layout="constrained")
    for number, plot in enumerate(plots, 1):
        _draw(plot, figure.add_subplot(1, len(plots), number, xscale="log", yscale="log"))
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return buffer.getvalue()


def _draw(plot: LogLogPlot, axes: Any) -> None:
    axes.set(xlabel=plot.x_label, ylabel=plot.y_label, title=plot.title)
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


_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>replay bench {title}</title><style>
body {{ font: 14px/1.45 system-ui, sans-serif; margin: 2rem auto; max-width: 75rem; padding: 0 1rem; color: #1d2329; }}
table {{ border-collapse: collapse; margin: .5rem 0 1.5rem; }}
th, td {{ border-bottom: 1px solid #d7dce1; padding: .2rem .7rem; text-align: left; }}
td {{ font-variant-numeric: tabular-nums; }}
.met {{ color: #1a7f37; font-weight: 600; }} .missed {{ color: #cf222e; font-weight: 600; }}
img {{ max-width: 100%; }} ul {{ color: #56616c; }}
</style></head><body><h1>replay bench</h1><h2>goals</h2>{goals}<ul>{facts}</ul>{body}</body></html>
"""
