"""Numbers over nights: a curve for each measure of each scenario, with the nights at which a baseline was accepted."""

from __future__ import annotations

import functools
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

from replay.batch.history import Night, nights
from replay.batch.sparkline import sparkline
from replay.comparison import quantities, report_html
from replay.language.globs import any_of

SHOWN = 60
"""Nights of a sparkline."""
_WIDTH, _HEIGHT = 640.0, 120.0
PLOTS = 500
"""Curves that a page draws."""


@dataclass(frozen=True)
class NightCurve:
    """A measure of a scenario over nights.

    Attributes:
        values: one a night, None where the scenario was not run or had none; in `unit`.
    """

    scenario: str
    measure: str
    unit: str
    values: tuple[float | None, ...]

    @property
    def known(self) -> tuple[float, ...]:
        """The values that there are."""
        return tuple(value for value in self.values if value is not None)


@dataclass(frozen=True)
class Trend:
    """Curves over the nights of a history.

    Attributes:
        times: of the nights, in ISO 8601.
        accepted: whether a baseline was accepted since the night before.
        failing: scenarios that needed attention, by night.
        curves: by scenario, then by measure.
    """

    times: tuple[str, ...]
    accepted: tuple[bool, ...]
    failing: tuple[frozenset[str], ...]
    curves: tuple[NightCurve, ...]

    @functools.cached_property
    def nights(self) -> tuple[str, ...]:
        """What people call the nights."""
        return tuple(time[:16].replace("T", " ") for time in self.times)


def read_trend(history: Path, *, measures: Iterable[str] = (), scenarios: Iterable[str] = ()) -> Trend:
    """Return what a history says.

    Args:
        history: the file.
        measures, scenarios: globs of names; all when there are none.

    Raises:
        WriteError: the file cannot be read.
    """
    measure, scenario = (any_of(tuple(globs) or ("*",)) for globs in (measures, scenarios))
    found: list[Night] = list(nights(history, lambda name: measure.match(name) is not None))
    units = {name: unit for night in found for name, unit in night.units.items()}
    names = {
        (name, of) for night in found for of, values in night.results.items() for name in values if scenario.match(name)
    }
    curves = tuple(
        NightCurve(name, of, units.get(of, ""), tuple(night.results.get(of, {}).get(name) for night in found))
        for name, of in sorted(names)
    )
    accepted = [b.accepted != a.accepted and bool(b.accepted) for a, b in pairwise(found)]
    return Trend(
        tuple(night.time for night in found),
        (False, *accepted)[: len(found)],
        tuple(night.failing for night in found),
        curves,
    )


def table(trend: Trend) -> list[str]:
    """Return the curves as lines of a table: scenario, measure, first, last, smallest, largest, and a sparkline."""
    heads = ("scenario", "measure", "first", "last", "smallest", "largest")
    rows: list[tuple[str, ...]] = [heads]
    bars = [f"last {min(len(trend.times), SHOWN)} of {len(trend.times)} nights"]
    for curve in trend.curves:
        known = curve.known
        numbers = (known[0], known[-1], min(known), max(known))
        rows.append(
            (curve.scenario, curve.measure, *(quantities.shown(value, curve.unit, digits=4) for value in numbers))
        )
        bars.append(sparkline(curve.values[-SHOWN:]))
    widths = [max(len(row[k]) for row in rows) for k in range(len(heads))]
    lines = [
        "  ".join([*(f"{text:<{width}}" for text, width in zip(row, widths, strict=True)), bar])
        for row, bar in zip(rows, bars, strict=True)
    ]
    marks = "".join("^" if accepted else " " for accepted in trend.accepted[-SHOWN:])
    if "^" in marks:
        lines.append(" " * (sum(widths) + 2 * len(widths)) + marks.rstrip() + " accepted")
    return lines


def as_json(trend: Trend) -> dict[str, Any]:
    """Return JSON values."""
    return {
        "nights": [
            {"time": time, "accepted": accepted, "failing": sorted(failing)}
            for time, accepted, failing in zip(trend.times, trend.accepted, trend.failing, strict=True)
        ],
        "curves": [
            {"scenario": curve.scenario, "name": curve.measure, "unit": curve.unit, "values": list(curve.values)}
            for curve in trend.curves
        ],
    }


def page(trend: Trend) -> str:
    """Return a page with a plot of each curve, which needs no other file, no network and no script."""
    drawn = [(curve, _drawing(trend, curve)) for curve in trend.curves[:PLOTS]]
    text: str = report_html.template("replay.batch", "trend.html.j2").render(
        trend=trend,
        drawn=drawn,
        width=_WIDTH,
        height=_HEIGHT,
        left=len(trend.curves) - len(drawn),
        style=report_html.style(),
    )
    return text


@dataclass(frozen=True)
class _Drawing:
    """A curve on the page: its line, a point for each night, and x of the nights at which one was accepted."""

    line: str
    points: tuple[tuple[float, float, str, bool], ...]
    accepted: tuple[float, ...]
    low: str
    high: str


def _drawing(trend: Trend, curve: NightCurve) -> _Drawing:
    low, high = min(curve.known), max(curve.known)
    span = 0.5 * high - 0.5 * low or max(abs(high), 1.0)  # halves: the difference of two numbers may be none
    middle = 0.0 if high > low else 0.5
    step = _WIDTH / max(len(trend.times) - 1, 1)
    points, line, pen = [], [], "M"
    for k, value in enumerate(curve.values):
        if value is None:
            pen = "M"
            continue
        x, y = k * step, _HEIGHT * (1.0 - (0.5 * value - 0.5 * low) / span - middle)
        line.append(f"{pen}{x:.1f} {y:.1f}")
        points.append(
            (
                x,
                y,
                f"{trend.nights[k]}: {quantities.shown(value, curve.unit, digits=6)}",
                curve.scenario in trend.failing[k],
            )
        )
        pen = "L"
    accepted = tuple(k * step for k, mark in enumerate(trend.accepted) if mark)
    return _Drawing(
        "".join(line),
        tuple(points),
        accepted,
        *(quantities.shown(value, curve.unit, digits=4) for value in (low, high)),
    )
