"""The files of a regression: junit.xml, index.html, run.json, and a line of history."""

from __future__ import annotations

import json
from pathlib import Path

import replay
from replay.batch.history import Night, append_night, failing_since, read_history
from replay.batch.judged import INDEX, JUNIT, Regression, verdicts
from replay.batch.report_index import index
from replay.batch.report_junit import junit
from replay.batch.run import as_json
from replay.errors import WriteError, count
from replay.logs.part_file import write_file

HISTORY = "history.jsonl"


def write_reports(found: Regression, *, history: Path | None = None) -> None:
    """Write all files into the run folder; a run that was interrupted is no night of the history.

    Args:
        found: the regression.
        history: where nights are kept; RUNDIR/history.jsonl when left out.

    Raises:
        WriteError: a file cannot be written; when it is the history, the others have been.
    """
    named, history = history is not None, history or found.run.directory / HISTORY
    unknown: WriteError | None = None
    try:
        nights = read_history(history)
    except WriteError as error:  # the night itself is not lost for it
        nights, unknown = [], error
    failing = frozenset(item.name for item in found.judged if not item.verdict.fine)
    earlier = {name: failing_since(nights, name) for name in failing}
    since = {name: time for name, time in earlier.items() if time is not None}
    started = found.run.started.isoformat(timespec="seconds")
    directory = found.run.directory
    summary = {
        **as_json(found.run),
        "baseline": str(found.baseline),
        "rules": found.rules,
        "model": found.model,
        "verdicts": {
            item.name: {
                "verdict": item.verdict.value,
                **({"message": item.message} if item.message else {}),
                **({"since": since.get(item.name, started)} if item.name in failing else {}),
            }
            for item in found.judged
        },
        "unused_baselines": list(found.unused),
    }
    write_file(directory / "run.json", json.dumps(summary, indent=1) + "\n")
    write_file(directory / JUNIT, junit(found))
    write_file(directory / INDEX, index(found, since))
    if unknown is not None:
        raise unknown
    if not found.run.interrupted:
        append_night(history, Night(started, replay.__version__, verdicts(found), failing), named=named)


def describe(found: Regression) -> list[str]:
    """Return the outcome as lines for people: what needs attention, then counts."""
    failing = [item for item in found.judged if not item.verdict.fine]
    lines = [f"{item.name}: {item.verdict.value}: {item.message}" for item in failing]
    if found.unused:
        number = count(len(found.unused), "unused baseline")
        lines.append(f"{number}, of no scenario given: {', '.join(found.unused)}; delete the folder of what is gone")
    lines += ["interrupted: the reports are partial"] if found.run.interrupted else []
    counts = {verdict: found.count(verdict) for verdict in dict.fromkeys(item.verdict for item in found.judged)}
    parts = [f"{number} {verdict.value}" for verdict, number in counts.items()]
    lines.append(f"{count(len(found.judged), 'scenario')}: {', '.join(parts)}")
    return lines
