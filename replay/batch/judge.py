"""One scenario of a night judged: compared with its baseline while both are in memory, told on a page of its own."""

from __future__ import annotations

import contextlib
import dataclasses
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Literal

from replay.batch.baseline import Baseline
from replay.batch.case import CaseResult, CaseStatus
from replay.batch.case_folder import LOG
from replay.batch.drawings import Album
from replay.batch.finding import Finding
from replay.batch.judged import OVERLAY, PAGE, Judged, RegressVerdict
from replay.batch.raised import told
from replay.batch.report_case import case_page
from replay.comparison import wording
from replay.comparison.causes import Causes, causes
from replay.comparison.difference import DiffVerdict
from replay.comparison.effects import effects, headline
from replay.comparison.measured.effects import effects_of, worst
from replay.comparison.measured.report_text import lines
from replay.comparison.measured.result import MeasuredComparison
from replay.comparison.measured.source import MeasuredSource, compare_scenario
from replay.comparison.overlay import write_overlay
from replay.comparison.plots import Plot, plots
from replay.comparison.report_text import text
from replay.comparison.rules import Rules
from replay.comparison.runs import Case, RecordingPair, RunDifference, diff_pair, read_pair
from replay.errors import NoSpaceError, RecordingError, ReplayError, printable
from replay.logs.part_file import append_lines, write_file
from replay.scenario.expectation_check import clearance_limits
from replay.scenario.model import Scenario

MissingBaseline = Literal["fail", "create", "skip"]
_KNOWN = (
    RegressVerdict.SAME,
    RegressVerdict.DIFFERENT,
    RegressVerdict.CREATED,
    RegressVerdict.MISSING,
    RegressVerdict.UNCOMPARED,
)
"""Verdicts beside which a broken expectation is what matters."""


class Judge:
    """Gives each scenario its verdict; of what it compares only what reports need is kept."""

    def __init__(
        self,
        directory: Path,
        baseline: Baseline,
        rules: Rules,
        *,
        missing: MissingBaseline,
        overlays: int,
        again: Callable[[str], str],
    ) -> None:
        """Choose what to compare with.

        Args:
            directory: the run folder.
            baseline: where accepted recordings may be.
            rules: tolerances.
            missing: what a scenario without one is; `CREATED` says that one is still to be stored.
            overlays: of how many scenarios that differ to write a recording that shows both runs.
            again: returns the command that runs and compares a scenario again, by its name.
        """
        self._directory = directory
        self._baseline = baseline
        self._rules = rules
        self._missing = missing
        self._overlays = overlays
        self._again = again
        self._album = Album()

    def judge(self, scenario: Scenario, result: CaseResult) -> Judged:
        """Return the verdict of a scenario that was run, and write its page.

        Raises:
            NoSpaceError: the disk is full.
        """
        if not result.status.recorded or result.recordings is None:
            return self.failed(result, scenario.tags)
        item, case, drawn = self._compared(scenario, result)
        item, machine = self._beside_machine(scenario, item)
        if result.status is CaseStatus.BROKEN and item.verdict in _KNOWN:
            if case is not None and item.finding is not None and not item.finding.count:  # it may be expected anew
                item = dataclasses.replace(item, finding=Finding(case.baseline, causes=_why(case)[0]))
            broken = [f"{o.expectation} ({o.detail})" for o in result.outcomes if not o.passed]
            message = "; ".join([*broken, *([item.message] if item.message else [])])
            item = dataclasses.replace(item, verdict=RegressVerdict.BROKEN, message=message)
        return self._with_page(dataclasses.replace(item, tags=scenario.tags), case, drawn, machine)

    def _beside_machine(self, scenario: Scenario, item: Judged) -> tuple[Judged, MeasuredComparison | None]:
        """Return the verdict with what the machine's log says, if the scenario names one; a failure stays one."""
        source = MeasuredSource.of_scenario(scenario)
        if source is None or item.result is None or item.result.recordings is None:
            return item, None
        found: MeasuredComparison | None = None
        try:
            found = compare_scenario(item.result.recordings.mcap, scenario, source, rules=self._rules)
        except ReplayError as error:
            verdict, told = RegressVerdict.FAILED, str(error)
        else:
            if found.verdict is not DiffVerdict.DIFFERENT:
                return item, found
            verdict, told = RegressVerdict.DIFFERENT, f"beside the machine: {worst(found)}"
            if item.finding is not None:
                report = "\n".join([*filter(None, [item.finding.report]), *lines(found)])
                item = dataclasses.replace(item, finding=item.finding.with_effects(effects_of(found), report))
        message = "; ".join(filter(None, [item.message, told]))
        kept = item.verdict if not item.verdict.fine and item.verdict is not RegressVerdict.DIFFERENT else verdict
        return dataclasses.replace(item, verdict=kept, message=message), found

    def failed(self, result: CaseResult, tags: tuple[str, ...] = ()) -> Judged:
        """Return the verdict of a scenario that has no recording, and write its page; NoSpaceError as `judge`."""
        return self._with_page(dataclasses.replace(unjudged(result.name, result), tags=tags), None, ())

    def _compared(self, scenario: Scenario, result: CaseResult) -> tuple[Judged, Case | None, tuple[Plot, ...]]:
        assert result.recordings is not None
        name = scenario.name
        accepted, candidate = self._baseline.recording(name), result.recordings.mcap
        if accepted is None:
            verdict = {
                "fail": RegressVerdict.MISSING,
                "create": RegressVerdict.CREATED,
                "skip": RegressVerdict.UNCOMPARED,
            }[self._missing]
            message = "" if self._missing == "create" else f"{self._baseline.directory} holds no baseline of it"
            return Judged(name, verdict, message, result), None, ()
        try:
            pair = read_pair(accepted, candidate, rules=self._rules)
            case = Case(name, accepted, candidate, diff_pair(pair, rules=self._rules))
        except RecordingError as error:
            ours = error.file == str(candidate)
            verdict = RegressVerdict.FAILED if ours else RegressVerdict.UNREADABLE
            return Judged(name, verdict, f"its own recording: {error}" if ours else str(error), result), None, ()
        except Exception as error:
            message = _odd("it cannot be compared with its baseline", error, candidate)
            return Judged(name, RegressVerdict.FAILED, message, result), None, ()
        if case.difference.verdict is not DiffVerdict.DIFFERENT:
            return Judged(name, RegressVerdict.SAME, "", result, Finding(accepted)), case, ()
        limits = clearance_limits(scenario.expect, pair.candidate.layout.pairs)
        return self._different(case, pair, result, limits)

    def _different(
        self, case: Case, pair: RecordingPair, result: CaseResult, limits: Mapping[str, float]
    ) -> tuple[Judged, Case, tuple[Plot, ...]]:
        found = case.difference
        told = effects(found, limits)
        why, problems = _why(case)
        drawn: tuple[Plot, ...] = ()
        try:
            drawn = plots(found, pair, limits)
        except Exception as error:
            problems.append(_odd("it cannot be drawn", error, case.candidate))
        if self._overlays > 0:
            self._overlays -= 1
            problems += self._overlay(case, pair)
        report = text(RunDifference(str(self._baseline.directory), str(self._directory), (case,)))
        finding = Finding.of(case.baseline, told, why, report)
        message = "; ".join([headline(told) or wording.summary(found), *problems])
        return Judged(case.name, RegressVerdict.DIFFERENT, message, result, finding), case, drawn

    def _overlay(self, case: Case, pair: RecordingPair) -> list[str]:
        """Write the recording that shows both runs; return what to add to the message when that is not possible."""
        try:
            write_overlay(case.candidate.with_name(OVERLAY.format(name=case.name)), case, pair)
        except NoSpaceError:
            raise
        except Exception as error:
            return [_odd("both runs cannot be shown", error, case.candidate)]
        return []

    def _with_page(
        self, item: Judged, case: Case | None, drawn: tuple[Plot, ...], machine: MeasuredComparison | None = None
    ) -> Judged:
        """Write a scenario's page; return the scenario, with what went wrong."""
        folder = self._directory / item.name
        shown, all_shown = self._album.keep(drawn)
        try:
            again, undrawn = self._again(item.name), not all_shown
            page = case_page(item, case, shown, machine, folder=folder, again=again, undrawn=undrawn)
            write_file(folder / PAGE, page)
        except NoSpaceError:
            raise
        except ReplayError as error:
            item = dataclasses.replace(item, message="; ".join(filter(None, [item.message, str(error)])))
        return item if item.finding is None else dataclasses.replace(item, finding=item.finding.told())


def _why(case: Case) -> tuple[Causes, list[str]]:
    """Return what has changed beside the results, and what to add to the message when that cannot be told."""
    try:
        return causes(case.baseline, case.candidate), []
    except Exception as error:
        why = _odd("its causes cannot be told", error, case.candidate)
        return Causes(unknown="its causes cannot be told"), [why]


def unjudged(name: str, result: CaseResult) -> Judged:
    """Return the verdict of a scenario that has not been compared, because it failed or the run was ended."""
    if result.status.recorded:
        message = "the run was ended before it was compared"
        return Judged(name, RegressVerdict.INTERRUPTED, message, result)
    return Judged(name, RegressVerdict(result.status.value), result.error, result)


def _odd(what: str, error: Exception, candidate: Path) -> str:
    """Return what went wrong as one line; of what nobody has foreseen, the log of the scenario gets the trace."""
    if isinstance(error, ReplayError):
        return str(error)
    with contextlib.suppress(ReplayError):
        trace = "".join(traceback.format_exception(error)).splitlines()
        append_lines(candidate.with_name(LOG), map(printable, trace))
    return f"{what}: {told(error)}"
