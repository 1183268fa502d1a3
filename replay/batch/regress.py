"""The nightly regression: run scenarios, compare each with its accepted recording, and say what became of it."""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from replay.batch.baseline import Baseline
from replay.batch.claim import claim
from replay.batch.create import create_baselines, recording_of
from replay.batch.history import check_history
from replay.batch.judge import Judge, MissingBaseline, unjudged
from replay.batch.judged import OVERLAY, PAGE, PICTURE, REPORTS, Judged, Regression, RegressVerdict
from replay.batch.report_case import again
from replay.batch.run import Execution, run_all
from replay.batch.run_file import Run
from replay.batch.select import Selection
from replay.batch.watch import Unwatched, Watch
from replay.comparison.log_changes import same_messages
from replay.comparison.rules import Rules
from replay.errors import InvalidValue, count
from replay.logs.part_file import remove_folder
from replay.scenario.methods import Model
from replay.scenario.model import Scenario


@dataclass(frozen=True)
class Rrd:
    """Which scenarios get rerun recordings: those that fail, the worst `most` of them; all; or none."""

    kind: Literal["failing", "all", "none"] = "failing"
    most: int = sys.maxsize


FAILING = Rrd()
_AGAIN = ".rrd"
"""Folder in which failing scenarios are recorded for eyes."""


def regress(
    selection: Selection,
    directory: Path,
    baseline: Path,
    *,
    rules: Rules | None = None,
    rules_file: str = "",
    missing: MissingBaseline = "fail",
    rrd: Rrd = FAILING,
    pictures: int = 0,
    model: Model | None = None,
    model_name: str = "",
    history: Path | None = None,
    resume: bool = False,
    execution: Execution | None = None,
    watch: Watch | None = None,
) -> Regression:
    """Run the chosen scenarios into a folder and compare each with its baseline; nothing of an earlier run is kept.

    Until the reports are written, run.json says that the run was interrupted.

    Args:
        selection: what to run, and what was filtered out.
        directory: the run folder.
        baseline: the baseline folder.
        rules: tolerances; without them everything must be equal.
        rules_file: where they come from, for reports.
        missing: what a scenario without a baseline is: a failure, a new baseline, or left out.
        rrd: which scenarios get rerun recordings; those that differ also get one that shows both runs.
        pictures: of how many scenarios that differ the worst moment is rendered; needs what shows both runs.
        model: replaces the scenarios' own models.
        model_name: how the user named it, for reports.
        history: file that the reports will append to, to find out now that it cannot be.
        resume: keep the results of an earlier run that are still valid, such as those of a night that was cut.
        execution, watch: as of `run_all`.

    Raises:
        BusyError: another process writes the run folder.
        InvalidValue: the baseline is a file.
        WriteError: a folder cannot be written.
        WorkerError: worker processes cannot be started.
    """
    if baseline.is_file():
        raise InvalidValue("--baseline", baseline, "is a file; give the folder that `replay accept` writes")
    check_history(history)
    with claim(directory):
        accepted, watch, rules = Baseline(baseline), watch or Unwatched(), rules or Rules()
        names = [*(scenario.name for scenario in selection.chosen), *selection.invalid]
        _forget(directory, names, drawings=not (resume and rrd.kind == "all"))
        run = run_all(
            selection.chosen,
            directory,
            model=model,
            rrd=rrd.kind == "all",
            overwrite=not resume,
            resume=resume,
            whole=False,
            failed=selection.failed,
            execution=execution,
            watch=watch,
        )
        if run.interrupted:
            watch = Unwatched()  # it has told its request; another one ends the comparison too
        judged: dict[str, Judged] = {}
        judge = Judge(
            directory,
            accepted,
            rules,
            missing=missing,
            overlays=0 if rrd.kind == "none" else rrd.most,
            again=functools.partial(again, selection.sources, baseline, rules_file, model_name),
        )
        ran = list(zip(selection.chosen, run.results, strict=False))  # those that failed before come after these
        try:
            for scenario, result in ran:
                watch.compare(scenario.name)
                judged[scenario.name] = judge.judge(scenario, result)
            with watch.undisturbed():
                judged |= create_baselines(judged, accepted)
            if rrd.kind == "failing" and not run.interrupted:
                attention = sorted((item for item in judged.values() if not item.verdict.fine), key=lambda i: i.order)
                recorded = [item.name for item in attention if item.result and item.result.status.recorded]
                failing = set(recorded[: rrd.most])
                _show(selection.chosen, failing, run, model=model, execution=execution, watch=watch)
            if pictures and not run.interrupted:
                from replay.batch.pictures import take_pictures

                take_pictures(sorted(judged.values(), key=lambda item: item.order), directory, pictures, watch)
        except KeyboardInterrupt:
            run = dataclasses.replace(run, interrupted=True)
            unstored = [
                name for name, item in judged.items() if item.verdict is RegressVerdict.CREATED and not item.message
            ]
            judged = {name: item for name, item in judged.items() if name not in unstored}
    ended = [judged.get(scenario.name) or unjudged(scenario.name, result) for scenario, result in ran]
    ended += [judge.failed(result) for result in selection.failed]
    ended += [Judged(name, RegressVerdict.SKIPPED, why) for name, why in selection.skipped.items()]
    ended = [dataclasses.replace(item, source=str(selection.sources[item.name])) for item in ended]
    unused = _unused(selection, accepted, {item.name for item in ended})
    ended = [_renamed(item, accepted, unused) for item in ended]
    return Regression(run, baseline, rules_file, model_name, tuple(ended), tuple(unused))


def _renamed(item: Judged, accepted: Baseline, unused: Sequence[str]) -> Judged:
    """Say of a scenario without a baseline which unused one is byte by byte the same: it may have been renamed."""
    if item.verdict is not RegressVerdict.MISSING:
        return item
    for name in unused:
        with contextlib.suppress(Exception):  # whatever is odd about that one
            if same_messages(accepted.directory / name / f"{name}.mcap", recording_of(item)):
                message = f"{item.message}; the unused baseline {name} has exactly the same readings: renamed?"
                return dataclasses.replace(item, message=message)
    return item


def _forget(directory: Path, names: Sequence[str], *, drawings: bool) -> None:
    """Remove an earlier night's reports and pictures, which would stand beside recordings of this one."""
    own = [name for name in names if not (directory / name).is_symlink()]
    kinds = (*(("{name}.rrd",) if drawings else ()), OVERLAY, PAGE, PICTURE)
    shown = [directory / name / kind.format(name=name) for name in own for kind in kinds]
    for file in (*(directory / report for report in REPORTS), *shown):
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)
    remove_folder(directory / _AGAIN)


def _unused(selection: Selection, accepted: Baseline, told: set[str]) -> list[str]:
    """Return which baselines are of no scenario of the folders; a sweep that is not valid may still be of its cases."""
    sweeps = tuple(f"{name}[" for name in selection.invalid)
    names = accepted.names() if selection.of_folders else []
    return [name for name in names if name not in told and not name.startswith(sweeps)]


class _Asked(Unwatched):
    """Follows nothing, but passes on that the run is to end."""

    def __init__(self, watch: Watch) -> None:
        self.check = watch.check  # type: ignore[method-assign]
        self.undisturbed = watch.undisturbed  # type: ignore[method-assign]


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
    again = run.directory / _AGAIN
    if again.is_symlink() or not again.is_dir():
        again.unlink(missing_ok=True)
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
        remove_folder(again)
