"""A regression as one page: causes first, then scenarios, the worst first; what differs in one is a page of its own.

The page holds every row, packed, and a script shows those that are asked for: it stays small and quick whatever the
night. Without scripts it still tells the causes, with links to the first scenarios of each.
"""

from __future__ import annotations

import base64
import hashlib
import json
import os
import platform
import zlib
from collections.abc import Sequence
from importlib import resources
from typing import Any
from urllib.parse import quote

import replay
from replay.batch.case_folder import is_there
from replay.batch.groups import CauseGroup, groups
from replay.batch.history import Past
from replay.batch.judged import PAGE, PICTURE, Judged, Regression, RegressVerdict
from replay.batch.metrics import MAIN
from replay.batch.sparkline import sparkline
from replay.comparison import report_html
from replay.comparison.effects import Severity
from replay.errors import count, printable

_ORDER = sorted(RegressVerdict, key=lambda verdict: verdict.fine)
_MESSAGE = 300
"""Characters of a message that a row has room for; the scenario's page has all of it."""
_FIRST, _LISTED = 10, 200
"""Groups that are open to see, and that are listed at all; a night has few causes, or one for each scenario."""


def index(found: Regression, past: Past) -> str:
    """Return the page: it needs the scenarios' own pages when they are opened, no network, and no other file.

    Args:
        found: the regression.
        past: what the nights before say.
    """
    ordered = sorted(found.judged, key=lambda item: item.order)
    grouped = groups(ordered)
    failing = sum(not item.verdict.fine for item in ordered)
    script = resources.files("replay.batch").joinpath("index.js").read_text(encoding="utf-8")
    page: str = report_html.template("replay.batch", "index.html.j2").render(
        found=found,
        groups=grouped[:_LISTED],
        more=grouped[_LISTED:],
        first=_FIRST,
        address=address,
        failing=failing,
        total=len(ordered),
        counts=[(verdict, found.count(verdict)) for verdict in _ORDER if found.count(verdict)],
        severities=[one for one in Severity if any(not i.verdict.fine and i.severity is one for i in ordered)],
        tags=sorted({tag for item in ordered for tag in item.tags}),
        data=_packed(_data(found, ordered, grouped, past)),
        script=_markup(script),
        allowed=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        count=count,
        style=report_html.style(),
        version=replay.__version__,
        host=platform.node(),
    )
    return page


def address(item: Judged, file: str = PAGE) -> str:
    """Return the address of a scenario's page, or of another file of its, as seen from the night's."""
    return f"{quote(os.fsencode(item.name))}/{file}"


def _data(found: Regression, ordered: Sequence[Judged], grouped: Sequence[CauseGroup], past: Past) -> dict[str, Any]:
    """Return what the script shows: lists of texts, and rows that refer to them by number."""
    number = {item.name: k for k, group in enumerate(grouped) for item in group.members}
    tags = sorted({tag for item in ordered for tag in item.tags})
    rows = []
    for item in ordered:
        curve = [*past.curve(item.name), _value(item)]
        rows.append(
            [
                printable(item.name),
                address(item) if item.verdict is not RegressVerdict.SKIPPED else "",
                _ORDER.index(item.verdict),
                item.severity,
                number.get(item.name, -1),
                printable(item.message[:_MESSAGE]),
                "" if item.verdict.fine else past.since.get(item.name, ""),
                [tags.index(tag) for tag in item.tags],
                address(item, PICTURE) if is_there(found.run.directory / item.name / PICTURE) else "",
                sparkline(curve) if len([value for value in curve if value is not None]) > 1 else "",
            ]
        )
    return {
        "verdicts": [[verdict.name, verdict.value, verdict.fine, verdict.left_out] for verdict in _ORDER],
        "tags": tags,
        "rows": rows,
    }


def _value(item: Judged) -> float | None:
    measures = item.result.measures if item.result is not None else ()
    return next((measure.value for measure in measures if measure.name == MAIN), None)


def _packed(data: dict[str, Any]) -> str:
    """Return data as text that stands in a page as it is: JSON, deflated, in base 64."""
    text = json.dumps(data, ensure_ascii=True, separators=(",", ":"))
    return base64.b64encode(zlib.compress(text.encode(), 9)).decode()


def _markup(text: str) -> Any:
    from markupsafe import Markup

    return Markup(text)  # a file of the package
