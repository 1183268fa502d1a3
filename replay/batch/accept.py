"""A run's recordings become the baseline: what that would change, and doing it."""

from __future__ import annotations

import datetime
from dataclasses import dataclass
from pathlib import Path

from replay.batch.baseline import Baseline, Entry, check_name, check_scenario
from replay.batch.case import CaseStatus
from replay.comparison import wording
from replay.comparison.difference import Difference, DiffVerdict
from replay.comparison.effects import effects, headline
from replay.comparison.provenance import FILES
from replay.comparison.run_folder import read_run
from replay.comparison.runs import diff
from replay.errors import InvalidValue, RecordingError
from replay.language.globs import fits


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


@dataclass(frozen=True)
class Accepted:
    """Which scenarios of a run are accepted: those that fit all that is asked for.

    Attributes:
        select: names or globs of which one has to fit; all scenarios when there are none.
        leave_out: names or globs of which none may fit.
        group: name or glob of the cause that the night's page groups them by; "" for any.
    """

    select: tuple[str, ...] = ()
    leave_out: tuple[str, ...] = ()
    group: str = ""

    def __call__(self, name: str, cause: str) -> bool:
        """Return whether a scenario with a cause is accepted."""
        return (
            (not self.select or _fits_any(name, self.select))
            and not _fits_any(name, self.leave_out)
            and (not self.group or _fits_any(cause, (self.group,)))
        )

    def __bool__(self) -> bool:
        return bool(self.select or self.leave_out or self.group)


ALL = Accepted()


def _fits_any(name: str, globs: tuple[str, ...]) -> bool:
    return any(name == glob or fits(name, glob) for glob in globs)


def plan_acceptance(directory: Path, baseline: Path, chosen: Accepted = ALL) -> Acceptance:
    """Return what accepting a run folder, or a part of it, would change.

    Raises:
        InvalidValue: it is no run folder, the run was interrupted, or a scenario of it failed or broke an expectation,
            or has a name that is none; what is not chosen may have.
        RecordingError: a recording of the run cannot be read, is a link, or is of another scenario.
    """
    try:
        run = read_run(directory)
        causes = {name: entry.get("cause", "") for name, entry in run.get("verdicts", {}).items()}
        statuses = {
            name: CaseStatus(entry["status"])
            for name, entry in run["scenarios"].items()
            if chosen(name, causes.get(name, ""))
        }
    except PermissionError as error:
        raise InvalidValue("RUNDIR", directory, f"has a run.json that cannot be read: {error.strerror}") from None
    except (OSError, ValueError):
        raise InvalidValue("RUNDIR", directory, "is no run folder: it has no run.json of replay") from None
    if run["interrupted"]:
        rule = "holds a run that was interrupted; run it again (`replay run --resume` keeps what is done)"
        raise InvalidValue("RUNDIR", directory, rule)
    if chosen and not statuses:
        known = sorted({cause for cause in causes.values() if cause})
        groups = f"; its groups are: {'; '.join(known)}" if chosen.group and known else ""
        raise InvalidValue("RUNDIR", directory, f"holds no scenario that is chosen{groups}")
    failed = [f"{name} ({status.value})" for name, status in statuses.items() if status is not CaseStatus.PASSED]
    if failed:
        rule = f"holds scenarios that did not pass: {', '.join(failed)}; --except NAME leaves one out"
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
    if _same(found):
        return ""
    return "; ".join(filter(None, [headline(effects(found)), wording.summary(found)]))


def _same(found: Difference) -> bool:
    """Return whether nothing but versions differs: not the results, nor the texts and the model that they are of."""
    inputs = (FILES, "model", "root")
    return found.verdict is DiffVerdict.SAME and not any(change.name.startswith(inputs) for change in found.provenance)
