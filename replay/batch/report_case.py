"""A scenario's page of a night: what became of it, what differs with drawings, and how to see it again."""

from __future__ import annotations

import os
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from urllib.parse import quote

from replay.batch.case_folder import LOG, is_there, said
from replay.batch.judged import OVERLAY, Judged
from replay.batch.written import RESULT
from replay.comparison import report_html
from replay.comparison.measured import report_html as report_html_measured
from replay.comparison.measured.report_text import summary
from replay.comparison.measured.result import MeasuredComparison
from replay.comparison.plots import Plot
from replay.comparison.runs import Case
from replay.errors import count

FILES = ("{name}.mcap", "{name}.rrd", OVERLAY, LOG, RESULT)
"""What is linked of a scenario's folder."""
_LINES = 30
"""Of a log that are shown on the page."""


def case_page(
    item: Judged,
    case: Case | None,
    drawn: Sequence[Plot],
    machine: MeasuredComparison | None = None,
    *,
    folder: Path,
    again: str,
    undrawn: bool,
) -> str:
    """Return a scenario's page, which needs no other file, no network and no script.

    Args:
        item: the scenario.
        case: its comparison; None without one.
        drawn: drawings of its signals.
        machine: its comparison with the machine; None without one.
        folder: of the scenario.
        again: the command that runs and compares it again.
        undrawn: there are more drawings, for which the night has no room.
    """
    page: str = report_html.template("replay.batch", "case_page.html.j2").render(
        item=item,
        case=case,
        drawn=drawn,
        undrawn=undrawn,
        links=_links(item, folder),
        again=again,
        here=Path.cwd(),
        log=_log(item, folder),
        count=count,
        style=report_html.style(),
        details=report_html.details,
        machine=machine,
        summary=summary,
        beside=report_html_measured.details,
    )
    return page


def again(sources: Mapping[str, Path], baseline: Path, rules: str, model: str, name: str) -> str:
    """Return the command that runs and compares one scenario again.

    Args:
        sources: the file of each scenario, as the user named it.
        baseline: folder.
        rules, model: files, or the model's name; "" for none.
        name: of the scenario.
    """
    parts = ["replay", "regress", str(sources[name]), "--select", name, "--baseline", str(baseline), "-o", "again"]
    return shlex.join([*parts, *(["--rules", rules] if rules else []), *(["--model", model] if model else [])])


def _log(item: Judged, folder: Path) -> str:
    if item.result is None or item.result.status.recorded:
        return ""
    return "\n".join(said(folder)[-_LINES:])


def _links(item: Judged, folder: Path) -> tuple[tuple[str, str], ...]:
    names = [name.format(name=item.name) for name in FILES]
    links = [(name, quote(os.fsencode(name))) for name in names if is_there(folder / name)]
    if item.finding is not None:
        links.append(("baseline", _address(item.finding.baseline.resolve(), folder.resolve())))
    return tuple(links)


def _address(file: Path, folder: Path) -> str:
    """Return a file's address as seen from a page in a folder, so that both can be moved together."""
    try:
        way = Path(os.path.relpath(file, folder))
    except ValueError:  # it is on another drive
        return file.as_uri()
    return "/".join(quote(os.fsencode(part)) for part in way.parts)
