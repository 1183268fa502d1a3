"""A regression in Markdown, for mails and the summaries of CI: counts, causes, and the worst scenarios."""

from __future__ import annotations

from collections.abc import Iterator

import replay
from replay.batch.groups import groups
from replay.batch.judged import Regression
from replay.errors import count, printable

_GROUPS = 20
_ROWS = 20
_TEXT = 200


def summary(found: Regression) -> str:
    """Return the summary, ending in a newline; a night of any size is some kilobytes."""
    return "".join(f"{line}\n" for line in _lines(found))


def _lines(found: Regression) -> Iterator[str]:
    failing = sorted((item for item in found.judged if not item.verdict.fine), key=lambda item: item.order)
    total = count(len(found.judged), "scenario")
    yield f"# {len(failing)} of {total} need{'s' if len(failing) == 1 else ''} attention"
    yield ""
    if found.run.interrupted:
        yield "**Interrupted**: the reports are partial."
        yield ""
    counts = {item.verdict: found.count(item.verdict) for item in found.judged}
    yield f"{', '.join(f'{number} {verdict.value}' for verdict, number in counts.items())};"
    yield f"replay {replay.__version__}, {found.run.started.isoformat(timespec='seconds')}, {found.run.seconds:.0f} s."
    found_groups = groups(failing)
    if found_groups:
        yield from ("", "| scenarios | what has changed | at worst |", "|---|---|---|")
        for group in found_groups[:_GROUPS]:
            worst = group.members[0].message or group.members[0].verdict.value
            yield f"| {len(group.members)} | {_cell(group.name)} | {_cell(worst)} |"
        yield from _more(len(found_groups) - _GROUPS, "group")
        yield from ("", "| scenario | verdict | at worst |", "|---|---|---|")
        for item in failing[:_ROWS]:
            yield f"| {_cell(item.name)} | {item.verdict.value} | {_cell(item.message)} |"
        yield from _more(len(failing) - _ROWS, "scenario")
    if found.unused:
        yield ""
        yield f"{count(len(found.unused), 'unused baseline')}: {', '.join(map(_cell, found.unused[:_ROWS]))}"


def _more(number: int, what: str) -> Iterator[str]:
    if number > 0:
        yield ""
        yield f"and {count(number, f'more {what}')}"


def _cell(text: str) -> str:
    """Return text as it is shown in a table's cell: what Markdown or HTML would take for markup is escaped."""
    line = printable(" ".join(text.split()))
    cut = line if len(line) <= _TEXT else f"{line[:_TEXT]}..."
    for letter, instead in (("\\", "\\\\"), ("&", "&amp;"), ("<", "&lt;"), (">", "&gt;")):
        cut = cut.replace(letter, instead)
    for letter in "|*_`[]#!~@":
        cut = cut.replace(letter, f"\\{letter}")
    return cut
