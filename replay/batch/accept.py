"""A run's recordings become the baseline: what that would change, and doing it."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from pathlib import Path

from replay.batch.baseline import Baseline, Entry, check_name, check_scenario
from replay.batch.case import CaseStatus
from replay.comparison import wording
from replay.comparison.difference import Difference, DiffVerdict
from replay.comparison.provenance import FILES
from replay.comparison.run_folder import read_run
from replay.comparison.runs import diff
from replay.errors import InvalidValue, RecordingError


@dataclass(frozen=True)
class Acceptance:
    """What accepting a run would change.

    Attributes:
        baseline: folder.
        entries: recordings to store, by scenario, each with what is new about it.
        unchanged: scenarios whose baseline says the same already; it stays.
    """

    baseline: Baseline
    entries: dict[str, Entry]
    unchanged: tuple[str, ...]

    def describe(self) -> list[str]:
        """Return it as lines for people."""
        lines = [f"{name}: {entry.what}" for name, entry in self.entries.items()]
        counts = f"{len(self.entries)} to be accepted, {len(self.unchanged)} unchanged"
        return [*lines, f"{counts}; baseline {self.baseline.directory}"]

    def commit(self, *, reason: str, now: datetime.datetime) -> None:
        """Store the recordings; errors as of `Baseline.store`."""
        if self.entries:
            self.baseline.store(self.entries, reason=reason, now=now)


def plan_acceptance(directory: Path, baseline: Path) -> Acceptance:
    """Return what accepting a run folder would change.

    Raises:
        InvalidValue: it is no run folder, the run was interrupted, or a scenario of it failed or broke an expectation,
            or has a name that is none.
        RecordingError: a recording of the run cannot be read, is a link, or is of another scenario.
    """
    try:
        run = read_run(directory)
        statuses = {name: CaseStatus(entry["status"]) for name, entry in run["scenarios"].items()}
    except (OSError, ValueError):
        raise InvalidValue("RUNDIR", directory, "is no run folder: it has no run.json of replay") from None
    if run["interrupted"]:
        rule = "holds a run that was interrupted; run it again (`replay run --resume` keeps what is done)"
        raise InvalidValue("RUNDIR", directory, rule)
    failed = [f"{name} ({status.value})" for name, status in statuses.items() if status is not CaseStatus.PASSED]
    if failed:
        rule = (
            f"holds scenarios that did not pass: {', '.join(failed)}; run without them (--select) to accept the others"
        )
        raise InvalidValue("RUNDIR", directory, rule)
    accepted = Baseline(baseline)
    entries, unchanged = {}, []
    for name in statuses:
        check_name(name)
        recording = directory / name / f"{name}.mcap"
        check_scenario(recording, name)
        what = _news(accepted.recording(name), recording)
        if what:
            entries[name] = Entry(recording, what)
        else:
            unchanged.append(name)
    return Acceptance(accepted, entries, tuple(unchanged))


def _news(before: Path | None, recording: Path) -> str:
    """Return what is new about a recording; "" when its baseline says the same already."""
    if before is None:
        return "new"
    try:
        found = diff(before, recording)
    except RecordingError as error:
        if error.file != str(before):
            raise
        return f"replaces a baseline that cannot be read: {error.reason}"
    return "" if _same(found) else wording.summary(found)


def _same(found: Difference) -> bool:
    """Return whether nothing but versions differs: not the results, nor the texts and the model that they are of."""
    inputs = (FILES, "model", "root")
    return found.verdict is DiffVerdict.SAME and not any(change.name.startswith(inputs) for change in found.provenance)
