"""A run's results on stdout, and the exit code that they are."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from replay.cli import interruption
from replay.cli.exit_codes import ExitCode, worst
from replay.cli.options import note, say
from replay.cli.terminal import put

if TYPE_CHECKING:
    from replay.batch.case import CaseResult
    from replay.batch.judged import Regression
    from replay.batch.run_file import Run


def show(form: str, run: Run) -> None:
    """Write what became of each scenario, and where its recordings are; of several, how many there are of each end."""
    from replay.batch.case import describe

    def text(result: CaseResult) -> list[str]:
        found = result.recordings
        paths = [f"  {path}" for path in (found.mcap, found.rrd) if path] if found else []
        return [*describe(result), *paths]

    interruption.settle()
    say(
        form,
        lambda: [*(line for result in run.results for line in text(result)), *totals(run)],
        lambda: [result.as_json() for result in run.results],
    )


def totals(run: Run) -> list[str]:
    """Return the last line of several scenarios: "30 scenarios: 28 passed, 2 broken (near, far)"."""
    from replay.batch.case import CaseStatus

    ends: dict[CaseStatus, list[str]] = {}
    for result in run.results:
        ends.setdefault(result.status, []).append(result.name)
    parts = []
    for end, names in ends.items():
        which = "" if end in (CaseStatus.PASSED, CaseStatus.INTERRUPTED) else f" ({', '.join(names)})"
        parts.append(f"{len(names)} {end.value}{which}")
    return [f"{len(run.results)} scenarios: {', '.join(parts)}"] if len(run.results) > 1 else []


def exit_code(run: Run) -> ExitCode:
    """Return what the shell is told of a run; nothing but invalid scenarios is invalid input."""
    if run.results and all(result.invalid for result in run.results):
        return ExitCode.INVALID
    interrupted = ExitCode.INTERRUPTED if run.interrupted else ExitCode.FINE
    return worst([interrupted, ExitCode.FINE if run.passed else ExitCode.FAILED])


def report(found: Regression, *, history: Path | None) -> ExitCode:
    """Write a regression's reports and say what became of it; return what the shell is told."""
    from replay.batch.judged import INDEX, RegressVerdict
    from replay.batch.reports import describe, write_reports

    interruption.settle()
    lines = describe(found)
    try:
        write_reports(found, history=history)
        lines.append(f"report: {found.run.directory / INDEX}")
    finally:
        put(lines)
    if found.count(RegressVerdict.MISSING):
        run, baseline = found.run.directory, found.baseline
        note(f"`replay accept {run} --baseline {baseline} --reason WHY` stores what has no baseline yet")
    interrupted = ExitCode.INTERRUPTED if found.run.interrupted else ExitCode.FINE
    invalid = ExitCode.INVALID if any(result.invalid for result in found.run.results) else ExitCode.FINE
    return worst([interrupted, invalid, *(exit_code_of(item.verdict.name) for item in found.judged)])


def exit_code_of(verdict: str) -> ExitCode:
    """Return the exit code of one scenario's verdict."""
    codes = {"DIFFERENT": ExitCode.DIFFERENT, "INTERRUPTED": ExitCode.INTERRUPTED, "UNREADABLE": ExitCode.INVALID}
    fine = ("SAME", "CREATED", "UNCOMPARED", "SKIPPED")
    return ExitCode.FINE if verdict in fine else codes.get(verdict, ExitCode.FAILED)
