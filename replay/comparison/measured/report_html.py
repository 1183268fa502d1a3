"""A comparison with the machine as one HTML page that needs no other file, no network and no script."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from typing import Any

from replay.comparison import wording
from replay.comparison.measured.drawings import SCATTER, plot, scatter
from replay.comparison.measured.report_text import of_clock, of_signal, summary, verdict
from replay.comparison.measured.result import MeasuredComparison
from replay.comparison.plots import SHOWN, WIDTH
from replay.comparison.report_html import draw, style, template

SIDES = ("measured", "simulated")
"""What the lines of drawings are called."""


def html(found: Sequence[MeasuredComparison]) -> str:
    """Return the page of one scenario, or of several."""
    title = ", ".join(f"{one.difference.name}: {one.verdict.value}" for one in found)
    page: str = _template("page.html.j2").render(
        all=found, title=title, style=style(), summary=summary, details=functools.partial(details, all_open=True)
    )
    return page


def details(found: MeasuredComparison, *, all_open: bool = False) -> Any:
    """Return clocks and signals, those that are off first, with drawings, as markup that is safe to put into a page."""
    from markupsafe import Markup

    ordered = sorted(found.signals, key=lambda signal: not signal.decides)
    drawn = [signal.covered and k < SHOWN for k, signal in enumerate(ordered)]
    signals = [
        (signal, plot(signal) if shown else None, scatter(signal, found) if shown else None)
        for signal, shown in zip(ordered, drawn, strict=True)
    ]
    text = _template("details.html.j2").render(
        found=found,
        signals=signals,
        all_open=all_open,
        of_clock=of_clock,
        of_signal=of_signal,
        verdict=verdict,
        wording=wording,
        draw=functools.partial(draw, runs=SIDES),
        width=WIDTH,
        height=SCATTER,
        shown=SHOWN,
    )
    return Markup(text)  # rendered with autoescape


def _template(name: str) -> Any:
    return template("replay.comparison.measured", name)
