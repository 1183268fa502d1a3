"""The files of a regression: junit.xml, index.html, summary.md, metrics.parquet, run.json, and a line of history."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator
from pathlib import Path

import replay
from replay.batch.accepted import last_accepted
from replay.batch.groups import CauseGroup, groups
from replay.batch.history import Night, Past, append_night, nights
from replay.batch.judged import INDEX, JUNIT, METRICS, SUMMARY, Judged, Regression, verdicts
from replay.batch.metrics import MAIN, for_history, write_metrics
from replay.batch.report_index import index
from replay.batch.report_junit import junit
from replay.batch.report_summary import summary
from replay.batch.run_file import as_json
from replay.comparison.run_folder import RUN
from replay.errors import count
from replay.logs.part_file import write_file

HISTORY = "history.jsonl"
_LINES = 30
"""Scenarios, or groups of them, that are told one by one on the terminal."""


def write_reports(found: Regression, *, history: Path | None = None) -> None:
    """Write all files into the run folder; a run that was interrupted is no night of the history.

    Args:
        found: the regression.
        history: where nights are kept; RUNDIR/history.jsonl when left out.

    Raises:
        WriteError: a file cannot be written; the others have been.
    """
    named, history = history is not None, history or found.run.directory / HISTORY
    problems: list[Exception] = []
    past = Past((), MAIN)
    with _kept(problems):  # the night itself is not lost for its history
        past = Past(nights(history, MAIN.__eq__), MAIN)
    readable = not problems
    failing = frozenset(item.name for item in found.judged if not item.verdict.fine)
    causes = {item.name: group.name for group in groups(found.judged) for item in group.members}
    started = found.run.started.isoformat(timespec="seconds")
    directory = found.run.directory
    told = {
        **as_json(found.run),
        "baseline": str(found.baseline),
        "rules": found.rules,
        "model": found.model,
        "verdicts": {
            item.name: {
                "verdict": item.verdict.value,
                **({"message": item.message} if item.message else {}),
                **({"cause": causes[item.name]} if item.name in causes else {}),
                **({"finding": item.finding.as_json()} if item.finding is not None and item.finding.told_of else {}),
                **({"tags": list(item.tags)} if item.tags else {}),
                "source": item.source,
                **({"since": past.since.get(item.name, started)} if item.name in failing else {}),
            }
            for item in found.judged
        },
        "unused_baselines": list(found.unused),
    }
    with _kept(problems):
        write_file(directory / JUNIT, junit(found))
    with _kept(problems):
        write_file(directory / INDEX, index(found, past))
    with _kept(problems):
        write_file(directory / SUMMARY, summary(found))
    with _kept(problems):
        write_metrics(directory / METRICS, found.run.results)
    with _kept(problems):  # the last of them: until it is there, the run counts as interrupted
        write_file(directory / RUN, json.dumps(told, indent=1) + "\n")
    if readable and not found.run.interrupted:
        with _kept(problems):
            numbers, units = for_history(found.run.results)
            accepted = last_accepted(found.baseline)
            night = Night(started, replay.__version__, verdicts(found), failing, numbers, accepted, units)
            append_night(history, night, named=named)
    if problems:
        raise problems[0]


@contextlib.contextmanager
def _kept(problems: list[Exception]) -> Iterator[None]:
    """Keep what goes wrong in a `with` block, so that what comes after it is done all the same."""
    try:
        yield
    except Exception as error:
        problems.append(error)


def _line(item: Judged) -> str:
    return f"{item.name}: {item.verdict.value}: {item.message}"


def _called(group: CauseGroup) -> str:
    """Return what begins the line of a group; one scenario alone is its own line."""
    alone = len(group.members) == 1
    return "" if alone else f"{count(len(group.members), 'scenario')}: {group.name}; at worst "


def describe(found: Regression) -> list[str]:
    """Return the outcome as lines for people: what needs attention, the worst first, then counts.

    Of many scenarios each group is a line, with its worst one.
    """
    failing = sorted((item for item in found.judged if not item.verdict.fine), key=lambda item: item.order)
    if len(failing) <= _LINES:
        lines = [_line(item) for item in failing]
    else:
        grouped = groups(failing)
        lines = [f"{_called(group)}{_line(group.members[0])}" for group in grouped[:_LINES]]
        left = len(grouped) - _LINES
        lines += [f"and {count(left, 'more group')}"] if left > 0 else []
    if found.unused:
        number = count(len(found.unused), "unused baseline")
        lines.append(f"{number}, of no scenario given: {', '.join(found.unused)}; delete the folder of what is gone")
    lines += ["interrupted: the reports are partial"] if found.run.interrupted else []
    counts = {verdict: found.count(verdict) for verdict in dict.fromkeys(item.verdict for item in found.judged)}
    parts = [f"{number} {verdict.value}" for verdict, number in counts.items()]
    lines.append(f"{count(len(found.judged), 'scenario')}: {', '.join(parts)}")
    return lines
