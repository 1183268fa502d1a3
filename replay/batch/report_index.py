"""A regression as one page: counts, then scenarios, failing ones first, each with what differs and how to see it."""

from __future__ import annotations

import os
import platform
import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import replay
from replay.batch.case_folder import LOG, said
from replay.batch.judged import OVERLAY, Judged, Regression, RegressVerdict
from replay.comparison import report_html
from replay.errors import count

_FILES = ("{name}.mcap", "{name}.rrd", OVERLAY, LOG, "result.json")
_ORDER = sorted(RegressVerdict, key=lambda verdict: verdict.fine)
_LINES = 30
"""Of a log that are shown on the page."""
_OPEN = 3
"""As many failing scenarios are shown open; more of them would hide one another."""


@dataclass(frozen=True)
class IndexRow:
    """One scenario on the page.

    Attributes:
        item: the scenario.
        since: when the row of failing nights began; "" when this is the first.
        links: text and address of its files.
        command: what reproduces it, for a shell.
        log: the end of what it said, when that is all that there is.
    """

    item: Judged
    since: str
    links: tuple[tuple[str, str], ...]
    command: str
    log: str


def index(found: Regression, since: Mapping[str, str]) -> str:
    """Return the page; it needs no other file, no network and no script.

    Args:
        found: the regression.
        since: when the row of failing nights began, by scenario.
    """
    ordered = sorted(found.judged, key=lambda item: (_ORDER.index(item.verdict), item.name))
    rows = [
        IndexRow(item, since.get(item.name, ""), _links(found, item), command(found, item), _log(found, item))
        for item in ordered
    ]
    failing = [row for row in rows if not row.item.verdict.fine]
    page: str = report_html.template("replay.batch", "index.html.j2").render(
        found=found,
        rows=rows,
        failing=len(failing),
        counts=[(verdict, found.count(verdict)) for verdict in _ORDER if found.count(verdict)],
        open=len(failing) <= _OPEN,
        count=count,
        style=report_html.style(),
        details=report_html.details,
        folder=Path.cwd(),
        version=replay.__version__,
        host=platform.node(),
    )
    return page


def command(found: Regression, item: Judged) -> str:
    """Return the command that runs and compares one scenario again."""
    parts = ["replay", "regress", item.source, "--select", item.name]
    parts += ["--baseline", str(found.baseline), "-o", "again"]
    parts += [*(["--rules", found.rules] if found.rules else []), *(["--model", found.model] if found.model else [])]
    return shlex.join(parts)


def _log(found: Regression, item: Judged) -> str:
    if item.result is None or item.result.status.recorded:
        return ""
    return "\n".join(said(found.run.directory / item.name)[-_LINES:])


def _links(found: Regression, item: Judged) -> tuple[tuple[str, str], ...]:
    folder = found.run.directory / item.name
    names = [name.format(name=item.name) for name in _FILES]
    home = quote(os.fsencode(item.name))
    links = [(name, f"{home}/{quote(os.fsencode(name))}") for name in names if _is_there(folder / name)]
    if item.comparison is not None:
        links.append(("baseline", _address(Path(item.comparison.baseline).resolve(), found.run.directory.resolve())))
    return tuple(links)


def _is_there(file: Path) -> bool:
    try:
        return file.is_file()
    except OSError:
        return False


def _address(file: Path, folder: Path) -> str:
    """Return a file's address as seen from a page in a folder, so that both can be moved together."""
    try:
        way = Path(os.path.relpath(file, folder))
    except ValueError:  # it is on another drive
        return file.as_uri()
    return "/".join(quote(os.fsencode(part)) for part in way.parts)
