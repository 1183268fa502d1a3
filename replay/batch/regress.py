"""The nightly regression: run scenarios, compare each with its accepted recording, and say what became of it."""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Literal

from replay.batch.baseline import Baseline, Entry
from replay.batch.case import CaseResult, Status
from replay.batch.drawings import Album
from replay.batch.history import check_history
from replay.batch.judged import INDEX, JUNIT, OVERLAY, Judged, Regression, Verdict
from replay.batch.run import Execution, Run, run_all
from replay.batch.select import Selection
from replay.batch.watch import Unwatched, Watch
from replay.comparison import wording
from replay.comparison.difference import Verdict as DiffVerdict
from replay.comparison.log_changes import same_messages
from replay.comparison.overlay import write_overlay
from replay.comparison.plots import Plot, plots
from replay.comparison.rules import Rules
from replay.comparison.runs import Case, Pair, diff_pair, read_pair
from replay.errors import InvalidValue, NoSpaceError, RecordingError, WriteError, count
from replay.scenario.methods import Model
from replay.scenario.model import Scenario

MissingBaseline = Literal["fail", "create", "skip"]
Rrd = Literal["failing", "all", "none"]


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
    history: Path | None = None,
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
        history: file that the reports will append to, to find out now that it cannot be.
        execution, watch: as of `run_all`.

    Raises:
        InvalidValue: the baseline is a file.
        WriteError: a folder cannot be written.
        WorkerError: worker processes cannot be started.
    """
    if baseline.is_file():
        raise InvalidValue("--baseline", baseline, "is a file; give the folder that `replay accept` writes")
    check_history(history)
    accepted, watch, rules = Baseline(baseline), watch or Unwatched(), rules or Rules()
    _forget(directory, [*(scenario.name for scenario in selection.chosen), *selection.invalid])
    run = run_all(
        selection.chosen,
        directory,
        model=model,
        rrd=rrd == "all",
        overwrite=True,
        failed=selection.failed,
        execution=execution,
        watch=watch,
    )
    if run.interrupted:
        watch = Unwatched()  # it has told its request; another one ends the comparison too
    judged: dict[str, Judged] = {}
    album = Album()
    ran = list(zip(selection.chosen, run.results, strict=False))  # those that failed before come after these
    try:
        for scenario, result in ran:
            watch.compare(scenario.name)
            item = _judge(scenario, result, accepted, rules, missing, overlay=rrd != "none")
            judged[scenario.name] = album.keep(item)
        judged |= _created(judged, accepted)
        if rrd == "failing" and not run.interrupted:
            failing = {j.name for j in judged.values() if not j.verdict.fine and j.result and j.result.status.recorded}
            _show(selection.chosen, failing, run, model=model, execution=execution, watch=watch)
    except KeyboardInterrupt:
        run = dataclasses.replace(run, interrupted=True)
    for name in [name for name, item in judged.items() if item.verdict is Verdict.CREATED]:
        if accepted.recording(name) is None:  # ended before it was stored
            del judged[name]
    ended = [judged.get(scenario.name) or _unjudged(scenario.name, result) for scenario, result in ran]
    ended += [_unjudged(result.name, result) for result in selection.failed]
    ended += [Judged(name, Verdict.SKIPPED, why) for name, why in selection.skipped.items()]
    ended = [dataclasses.replace(item, source=str(selection.sources[item.name])) for item in ended]
    unused = _unused(selection, accepted, {item.name for item in ended})
    ended = [_renamed(item, accepted, unused) for item in ended]
    return Regression(run, baseline, rules_file, model_name, tuple(ended), tuple(unused))


def _renamed(item: Judged, accepted: Baseline, unused: Sequence[str]) -> Judged:
    """Say of a scenario without a baseline which unused one is byte by byte the same: it may have been renamed."""
    if item.verdict is not Verdict.MISSING:
        return item
    for name in unused:
        with contextlib.suppress(RecordingError):
            if same_messages(accepted.directory / name / f"{name}.mcap", _mcap(item)):
                message = f"{item.message}; the unused baseline {name} has exactly the same readings: renamed?"
                return dataclasses.replace(item, message=message)
    return item


def _forget(directory: Path, names: Sequence[str]) -> None:
    """Remove an earlier night's reports and pictures, which would stand beside recordings of this one."""
    own = [name for name in names if not (directory / name).is_symlink()]
    shown = [directory / name / kind.format(name=name) for name in own for kind in ("{name}.rrd", OVERLAY)]
    for file in (directory / JUNIT, directory / INDEX, *shown):
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)


def _unused(selection: Selection, accepted: Baseline, told: set[str]) -> list[str]:
    """Return which baselines are of no scenario of the folders; a sweep that is not valid may still be of its cases."""
    sweeps = tuple(f"{name}[" for name in selection.invalid)
    names = accepted.names() if selection.of_folders else []
    return [name for name in names if name not in told and not name.startswith(sweeps)]


def _unjudged(name: str, result: CaseResult) -> Judged:
    """Return the verdict of a scenario that has not been compared, because it failed or the run was ended."""
    if result.status.recorded:
        message = "the run was ended before it was compared"
        return Judged(name, Verdict.INTERRUPTED, message, result)
    return Judged(name, Verdict(result.status.value), result.error, result)


def _created(judged: Mapping[str, Judged], accepted: Baseline) -> dict[str, Judged]:
    """Store the baselines that are to be created; return the scenarios whose baseline cannot be."""
    created = {name: Entry(_mcap(item), "new") for name, item in judged.items() if item.verdict is Verdict.CREATED}
    try:
        if created:
            reason = "created by regress --missing-baseline create"
            accepted.store(created, reason=reason, now=datetime.datetime.now(datetime.UTC))
    except NoSpaceError:
        raise
    except WriteError as error:
        return {
            name: dataclasses.replace(judged[name], verdict=Verdict.MISSING, message=str(error)) for name in created
        }
    return {}


def _judge(
    scenario: Scenario,
    result: CaseResult,
    baseline: Baseline,
    rules: Rules,
    missing: MissingBaseline,
    *,
    overlay: bool,
) -> Judged:
    if not result.status.recorded or result.recordings is None:
        return _unjudged(scenario.name, result)
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
            pair = read_pair(accepted, result.recordings.mcap, rules=rules)
        except RecordingError as error:
            verdict, message = Verdict.UNREADABLE, str(error)
        else:
            found = diff_pair(pair, rules=rules)
            comparison = Case(scenario.name, accepted, result.recordings.mcap, found)
            if found.verdict is DiffVerdict.DIFFERENT:
                verdict, message, drawings = Verdict.DIFFERENT, wording.summary(found), plots(found, pair)
                if overlay:
                    message += _overlay(result.recordings.mcap.parent, comparison, pair)
    if result.status is Status.BROKEN and verdict is not Verdict.UNREADABLE:
        broken = [f"{o.expectation} ({o.detail})" for o in result.outcomes if not o.passed]
        verdict, message = Verdict.BROKEN, "; ".join([*broken, *([message] if message else [])])
    return Judged(scenario.name, verdict, message, result, comparison, drawings)


def _overlay(folder: Path, comparison: Case, pair: Pair) -> str:
    """Write the recording that shows both runs; return what to add to the message when that is not possible."""
    try:
        write_overlay(folder / OVERLAY.format(name=comparison.name), comparison, pair)
    except NoSpaceError:
        raise
    except WriteError as error:
        return f"; {error}"
    return ""


class _Asked(Unwatched):
    """Follows nothing, but passes on that the run is to end."""

    def __init__(self, watch: Watch) -> None:
        self.check = watch.check  # type: ignore[method-assign]


def _show(
    scenarios: Sequence[Scenario],
    failing: set[str],
    run: Run,
    *,
    model: Model | None,
    execution: Execution | None,
    watch: Watch,
) -> None:
    """Record the failing scenarios once more, for eyes; the first recordings and what is said of them stay.

    Raises:
        KeyboardInterrupt: it was ended.
    """
    again = run.directory / ".rrd"
    if again.is_symlink():
        again.unlink()
    try:
        chosen = [scenario for scenario in scenarios if scenario.name in failing]
        if not chosen:
            return
        watch.tell(f"recording {count(len(chosen), 'scenario')} once more, for eyes (--rrd none leaves it out)")
        if run_all(chosen, again, model=model, overwrite=True, execution=execution, watch=_Asked(watch)).interrupted:
            raise KeyboardInterrupt
        for name in failing:
            file = again / name / f"{name}.rrd"
            if file.is_file():
                with contextlib.suppress(OSError):  # a folder that cannot be written has been told of
                    file.replace(run.directory / name / file.name)
    finally:
        shutil.rmtree(again, ignore_errors=True)


def _mcap(item: Judged) -> Path:
    assert item.result is not None
    assert item.result.recordings is not None
    return item.result.recordings.mcap
