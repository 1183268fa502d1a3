"""The difference as one HTML page that needs no other file, no network and no script."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import Any

from replay.comparison import wording
from replay.comparison.difference import Difference, DiffVerdict, SignalDifference
from replay.comparison.effects import effects
from replay.comparison.plots import HEIGHT, LOWER, SHOWN, WIDTH, Plot
from replay.comparison.runs import Case, RunDifference
from replay.errors import count, printable


def html(found: RunDifference, plots: Mapping[str, Sequence[Plot]]) -> str:
    """Return the page, cases that differ first; `plots` holds the drawings of each case, by its name."""
    ordered = sorted(found.cases, key=lambda case: case.difference.verdict is not DiffVerdict.DIFFERENT)
    cases = [(case, plots.get(case.name, ())) for case in ordered]
    page: str = _template("report.html.j2").render(
        found=found, cases=cases, wording=wording, details=details, style=style()
    )
    return page


def style() -> Any:
    """Return the style sheet of pages that show cases."""
    from markupsafe import Markup

    return Markup(resources.files("replay.comparison").joinpath("style.css").read_text(encoding="utf-8"))


def details(case: Case, plots: Sequence[Plot]) -> Any:
    """Return what differs in one case, with drawings, as markup that is safe to put into a page."""
    from markupsafe import Markup

    drawings = {plot.signal: plot for plot in plots}
    text = _template("case.html.j2").render(
        case=case,
        drawings=drawings,
        wording=wording,
        draw=draw,
        shown=SHOWN,
        folded=folded(case.difference),
        count=count,
    )
    return Markup(text)  # rendered with autoescape


def folded(found: Difference) -> list[tuple[SignalDifference, list[SignalDifference]]]:
    """Return the signals that decide, the worst first: of each effect the one it is about, and what follows from it."""
    known = {item.signal.full_name: item for item in found.deciding}
    told = [[known[name] for name in effect.signals if name in known] for effect in effects(found)]
    return [(items[0], items[1:]) for items in told if items]


def draw(plot: Plot, runs: tuple[str, str] = wording.RUNS) -> Any:
    """Return a drawing as markup that is safe to put into a page; `runs` are what the two sides are called."""
    from markupsafe import Markup

    text = _template("plot.svg.j2").render(plot=plot, runs=runs, width=WIDTH, height=HEIGHT, lower=LOWER)
    return Markup(text)  # rendered with autoescape


@cache
def template(package: str, name: str) -> Any:
    """Return a page's template; whatever is put into it is escaped for HTML, and control characters are shown."""
    from jinja2 import Environment, StrictUndefined

    environment = Environment(
        autoescape=True, trim_blocks=True, lstrip_blocks=True, undefined=StrictUndefined, finalize=_shown
    )
    return environment.from_string(resources.files(package).joinpath(name).read_text(encoding="utf-8"))


def _shown(value: object) -> object:
    return value if hasattr(value, "__html__") else printable(str(value), keep="\n\t")


def _template(name: str) -> Any:
    return template("replay.comparison", name)
