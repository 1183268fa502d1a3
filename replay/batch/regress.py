"""The nightly regression: run scenarios, compare each with its accepted recording, and say what became of it."""

from __future__ import annotations

import datetime
import enum
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from replay.batch.baseline import Baseline, Entry
from replay.batch.case import CaseResult, Status
from replay.batch.run import Execution, Run, Watch, run_all
from replay.batch.select import Selection
from replay.comparison import wording
from replay.comparison.difference import Verdict as DiffVerdict
from replay.comparison.overlay import write_overlay
from replay.comparison.plots import Plot, plots
from replay.comparison.rules import Rules
from replay.comparison.runs import Case, diff_pair, read_pair
from replay.errors import RecordingError
from replay.scenario.methods import Model
from replay.scenario.model import Scenario

MissingBaseline = Literal["fail", "create", "skip"]
Rrd = Literal["failing", "all", "none"]


class Verdict(enum.Enum):
    """What the regression says of a scenario."""

    SAME = "same"
    CREATED = "created"  # it had no baseline, and has one now
    DIFFERENT = "different"
    BROKEN = "broken"  # an expectation does not hold
    FAILED = "failed"
    CRASHED = "crashed"
    TIMEOUT = "timeout"
    MEMORY = "memory"
    INTERRUPTED = "interrupted"
    MISSING = "missing baseline"
    UNREADABLE = "unreadable baseline"
    UNCOMPARED = "no baseline"  # and that is accepted
    SKIPPED = "skipped"

    @property
    def fine(self) -> bool:
        """Whether there is nothing to be done about it."""
        return self in (Verdict.SAME, Verdict.CREATED, Verdict.UNCOMPARED, Verdict.SKIPPED)

    @property
    def left_out(self) -> bool:
        """Whether it says nothing about the scenario's results."""
        return self in (Verdict.UNCOMPARED, Verdict.SKIPPED)


@dataclass(frozen=True, eq=False)
class Judged:
    """A scenario and what is said of it.

    Attributes:
        name: of the scenario.
        verdict: what became of it.
        message: one line that says why; "" when it is the same.
        result: of its run; None when it was skipped.
        comparison: with its baseline; None when there was none to make.
        drawings: of its signals that differ.
        source: file that it was read from, as the user named it; "" when that is not known.
    """

    name: str
    verdict: Verdict
    message: str = ""
    result: CaseResult | None = None
    comparison: Case | None = None
    drawings: tuple[Plot, ...] = ()
    source: str = ""


@dataclass(frozen=True, eq=False)
class Regression:
    """A run with its verdicts.

    Attributes:
        run: what was run.
        baseline: folder.
        rules: file of tolerances; "" for none.
        model: file or name of the model that replaces the scenarios' own; "" for none.
        judged: all scenarios, in the order in which they were given, and then those that were skipped.
        unused: scenarios that have a baseline and were not among those given.
    """

    run: Run
    baseline: Path
    rules: str
    model: str
    judged: tuple[Judged, ...]
    unused: tuple[str, ...]

    def count(self, *verdicts: Verdict) -> int:
        """Return how many scenarios have one of some verdicts."""
        return sum(item.verdict in verdicts for item in self.judged)


def regress(
    selection: Selection,
    directory: Path,
    baseline: Path,
    *,
    rules: Rules | None = None,
    rules_file: str = "",
    missing: MissingBaseline = "fail",
    rrd: Rrd = "failing",
    model: Model | None = None,
    model_name: str = "",
    execution: Execution | None = None,
    watch: Watch | None = None,
) -> Regression:
    """Run the chosen scenarios into a folder and compare each with its baseline; nothing of an earlier run is kept.

    Args:
        selection: what to run, and what was filtered out.
        directory: the run folder.
        baseline: the baseline folder.
        rules: tolerances; without them everything must be equal.
        rules_file: where they come from, for reports.
        missing: what a scenario without a baseline is: a failure, a new baseline, or left out.
        rrd: which scenarios get rerun recordings; those that differ also get one that shows both runs.
        model: replaces the scenarios' own models.
        model_name: how the user named it, for reports.
        execution, watch: as of `run_all`.

    Raises:
        WriteError: a folder cannot be written.
        WorkerError: worker processes cannot be started.
    """
    accepted = Baseline(baseline)
    run = run_all(
        selection.chosen,
        directory,
        model=model,
        rrd=rrd == "all",
        overwrite=True,
        execution=execution,
        watch=watch,
    )
    judged = []
    for scenario, result in zip(selection.chosen, run.results, strict=True):
        overlay = directory / scenario.name / f"{scenario.name}.difference.rrd"
        overlay.unlink(missing_ok=True)
        judged.append(_judge(scenario, result, accepted, rules or Rules(), missing, None if rrd == "none" else overlay))
    created = {j.name: Entry(_mcap(j), "new") for j in judged if j.verdict is Verdict.CREATED}
    if created:
        reason = "created by regress --missing-baseline create"
        accepted.store(created, reason=reason, now=datetime.datetime.now(datetime.UTC))
    if rrd == "failing" and not run.interrupted:
        failing = {j.name for j in judged if not j.verdict.fine and j.result and j.result.status.recorded}
        _show(selection.chosen, failing, run, model=model, execution=execution)
    judged += [Judged(name, Verdict.SKIPPED, why) for name, why in selection.skipped.items()]
    unused = sorted(set(accepted.names()) - {item.name for item in judged})
    return Regression(run, baseline, rules_file, model_name, tuple(judged), tuple(unused))


def _judge(
    scenario: Scenario,
    result: CaseResult,
    baseline: Baseline,
    rules: Rules,
    missing: MissingBaseline,
    overlay: Path | None,
) -> Judged:
    source = scenario.main_source if scenario.provenance.root is None else scenario.provenance.root.place.file
    if not result.status.recorded or result.recordings is None:
        return Judged(scenario.name, Verdict(result.status.value), result.error, result, source=source)
    accepted = baseline.recording(scenario.name)
    verdict, message = Verdict.SAME, ""
    comparison: Case | None = None
    drawings: tuple[Plot, ...] = ()
    if accepted is None:
        verdict, message = {
            "fail": (Verdict.MISSING, f"{baseline.directory} holds no baseline of it"),
            "create": (Verdict.CREATED, "its baseline is new"),
            "skip": (Verdict.UNCOMPARED, f"{baseline.directory} holds no baseline of it"),
        }[missing]
    else:
        try:
            pair = read_pair(accepted, result.recordings.mcap)
        except RecordingError as error:
            verdict, message = Verdict.UNREADABLE, str(error)
        else:
            found = diff_pair(pair, rules=rules)
            comparison = Case(scenario.name, accepted, result.recordings.mcap, found)
            if found.verdict is DiffVerdict.DIFFERENT:
                verdict, message, drawings = Verdict.DIFFERENT, wording.summary(found), plots(found, pair)
                if overlay is not None:
                    write_overlay(overlay, comparison, pair)
    if result.status is Status.BROKEN and verdict is not Verdict.UNREADABLE:
        broken = [f"{o.expectation} ({o.detail})" for o in result.outcomes if not o.passed]
        verdict, message = Verdict.BROKEN, "; ".join([*broken, *([message] if message else [])])
    return Judged(scenario.name, verdict, message, result, comparison, drawings, source)


def _show(
    scenarios: Sequence[Scenario], failing: set[str], run: Run, *, model: Model | None, execution: Execution | None
) -> None:
    """Record the failing scenarios once more, for eyes; the first recordings and what is said of them stay."""
    again = run.directory / ".rrd"
    try:
        chosen = [scenario for scenario in scenarios if scenario.name in failing]
        if chosen:
            run_all(chosen, again, model=model, overwrite=True, execution=execution)
        for name in failing:
            file = again / name / f"{name}.rrd"
            if file.is_file():
                file.replace(run.directory / name / file.name)
    finally:
        shutil.rmtree(again, ignore_errors=True)


def _mcap(item: Judged) -> Path:
    assert item.result is not None
    assert item.result.recordings is not None
    return item.result.recordings.mcap


def verdicts(found: Regression) -> Mapping[str, str]:
    """Return each scenario that was run with its verdict, for the history."""
    return {item.name: item.verdict.value for item in found.judged if not item.verdict.left_out}
