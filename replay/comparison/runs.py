"""Recordings from files and run folders: two of one name at a time, and the verdict over all."""

from __future__ import annotations

import datetime
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.comparison.diff import EVENTS, compare
from replay.comparison.difference import JSON_VERSION, Change, Difference, DiffVerdict
from replay.comparison.log_changes import SCENE, equal_topics, same_events_of, scene_changes, schema_changes
from replay.comparison.rules import Rules
from replay.comparison.run_folder import recordings_in
from replay.comparison.signals import places
from replay.errors import InvalidValue, RecordingError, ReplayError
from replay.logs.mcap_reader import McapLog
from replay.recording.reader import Recording, own_topics, read, read_provenance

_ATTEMPTS = 3
COLLISION = "/collision"
SCENARIOS = "/scenarios"
"""Begins the name of a scenario in rules: `/scenarios/carm_clear` with `ignore` lets it be missing or extra."""


@dataclass(frozen=True, eq=False)
class RecordingPair:
    """Two recordings of one scenario, with what their files say beside the columns.

    Attributes:
        baseline, candidate: without the topics that are the same bytes in both.
        scene, added: changes of the scene and the schemas, and what only the candidate's schemas have.
        equal: number of signals in the topics that were left out.
    """

    baseline: Recording
    candidate: Recording
    scene: tuple[Change, ...] = ()
    added: tuple[Change, ...] = ()
    equal: int = 0


@dataclass(frozen=True, eq=False)
class Case:
    """One scenario of two runs; `of_folders` when they are run folders and not single files."""

    name: str
    baseline: Path
    candidate: Path
    difference: Difference
    of_folders: bool = False


@dataclass(frozen=True)
class Unreadable:
    """One scenario of two runs of which a recording cannot be read, and why."""

    name: str
    baseline: Path
    candidate: Path
    error: str


@dataclass(frozen=True, eq=False)
class RunDifference:
    """How a candidate run differs from a baseline run.

    Attributes:
        baseline, candidate: what was compared: files or folders, as they were named.
        cases: the scenarios that both have and that can be read.
        missing, extra: names of scenarios that only the baseline, only the candidate has.
        ignored: names among these that a rule accepts.
        unreadable: the scenarios that both have and that cannot be read in one of them.
    """

    baseline: str
    candidate: str
    cases: tuple[Case, ...]
    missing: tuple[str, ...] = ()
    extra: tuple[str, ...] = ()
    ignored: tuple[str, ...] = ()
    unreadable: tuple[Unreadable, ...] = ()

    @property
    def verdict(self) -> DiffVerdict:
        """Unreadable when any scenario is; different when any is, or is missing or extra without a rule."""
        if self.unreadable:
            return DiffVerdict.UNREADABLE
        alone = any(name not in self.ignored for name in (*self.missing, *self.extra))
        differs = alone or any(case.difference.verdict is DiffVerdict.DIFFERENT for case in self.cases)
        return DiffVerdict.DIFFERENT if differs else DiffVerdict.SAME

    @property
    def different(self) -> tuple[Case, ...]:
        """The scenarios that differ."""
        return tuple(case for case in self.cases if case.difference.verdict is DiffVerdict.DIFFERENT)

    def as_json(self) -> dict[str, Any]:
        """Return JSON values."""
        cases = [
            {"baseline": str(case.baseline), "candidate": str(case.candidate), **case.difference.as_json()}
            for case in self.cases
        ]
        return {
            "version": JSON_VERSION,
            "verdict": self.verdict.value,
            "baseline": self.baseline,
            "candidate": self.candidate,
            "scenarios": {"missing": list(self.missing), "extra": list(self.extra), "ignored": list(self.ignored)},
            "unreadable": [
                {"name": o.name, "baseline": str(o.baseline), "candidate": str(o.candidate), "error": o.error}
                for o in self.unreadable
            ],
            "cases": cases,
        }


def diff(
    baseline: Recording | str | Path,
    candidate: Recording | str | Path,
    *,
    rules: Rules | str | Path | None = None,
    today: datetime.date | None = None,
    strict_provenance: bool = False,
) -> Difference:
    """Return how a recording differs from another, by meaning.

    Args:
        baseline, candidate: recordings, or paths of MCAP files that `replay` wrote. Scene and schemas are compared only
            for paths.
        rules: tolerances, or the path of a rules file; without them everything must be equal.
        today: the day on which the rules' expiry dates are judged, when `rules` is a path to rules that expire.
        strict_provenance: other versions, models and inputs make the verdict "different".

    Returns:
        Everything that differs; `.verdict` is `DiffVerdict.SAME` or `DiffVerdict.DIFFERENT`.

    Raises:
        RecordingError: a file cannot be read or is no recording.
        ScenarioError: the rules file is not valid.
        InvalidValue: rules expire and `today` is missing.
    """
    if isinstance(rules, str | Path):
        from replay.comparison.rules_file import read_rules

        rules = read_rules(rules, today=today)
    if isinstance(baseline, Recording) or isinstance(candidate, Recording):
        a, b = (x if isinstance(x, Recording) else read(x) for x in (baseline, candidate))
        pair = RecordingPair(a, b)
        return diff_pair(pair, rules=rules, strict_provenance=strict_provenance)
    pair = read_pair(baseline, candidate, rules=rules)
    return diff_pair(pair, rules=rules, strict_provenance=strict_provenance)


def read_pair(baseline: str | Path, candidate: str | Path, *, rules: Rules | None = None) -> RecordingPair:
    """Read two recordings, without the topics that are the same bytes in both and stand for the same signals.

    Under a rule that lets no NaN pass, not even in both, all topics are read.

    Raises:
        RecordingError: one cannot be read, or is replaced again and again while it is read.
    """
    files = Path(baseline), Path(candidate)
    for _ in range(_ATTEMPTS):
        before = [_identity(file) for file in files]
        try:
            pair, wrong = _read_pair(baseline, candidate, rules), None
        except ReplayError as error:
            wrong = error
        changed = [str(file) for file, one in zip(files, before, strict=True) if _identity(file) != one]
        if not changed and wrong is not None:
            raise wrong
        if not changed:
            return pair
    raise RecordingError(changed[0], "is replaced by another process while it is read")


def _identity(file: Path) -> tuple[int, ...]:
    """Return what tells a file from one that takes its place; nothing of one that is not there."""
    try:
        found = file.stat()
    except OSError:
        return ()
    return found.st_dev, found.st_ino, found.st_size, found.st_mtime_ns


def _read_pair(baseline: str | Path, candidate: str | Path, rules: Rules | None) -> RecordingPair:
    with McapLog(baseline) as log_a, McapLog(candidate) as log_b:
        known_a, known_b = read_provenance(log_a), read_provenance(log_b)
        bytes_equal = equal_topics(log_a, log_b)
        equal = {
            topic
            for topic in bytes_equal
            if places(known_a.layout, topic, known_a.format) == places(known_b.layout, topic, known_b.format)
            and (rules is None or all(rule.tolerance.nan == "equal" for rule in rules.active))
        }
        if COLLISION not in equal:  # its events say when levels begin and end
            equal.discard(EVENTS)
        elif EVENTS not in equal and not same_events_of(log_a, log_b, COLLISION):
            equal.discard(COLLISION)
        lost, added = schema_changes(log_a, log_b)
        scene = () if SCENE in bytes_equal else scene_changes(log_a, log_b)
        names = [
            {channel.topic for channel in log.channels.values()} & own_topics(layout)
            for log, layout in ((log_a, known_a.layout), (log_b, known_b.layout))
        ]
    return RecordingPair(
        read(baseline, topics=names[0] - equal if equal else None),
        read(candidate, topics=names[1] - equal if equal else None),
        (*scene, *lost),
        added,
        sum(places(known_a.layout, topic, known_a.format)[1] for topic in equal),
    )


def diff_pair(pair: RecordingPair, *, rules: Rules | None, strict_provenance: bool = False) -> Difference:
    """Return how the recordings of a pair differ."""
    return compare(
        pair.baseline,
        pair.candidate,
        rules=rules,
        strict_provenance=strict_provenance,
        scene=pair.scene,
        added=pair.added,
        equal=pair.equal,
    )


def diff_runs(
    baseline: str | Path,
    candidate: str | Path,
    *,
    rules: Rules | None = None,
    strict_provenance: bool = False,
    visit: Callable[[Case, RecordingPair], None] | None = None,
) -> RunDifference:
    """Return how two files, or two run folders, differ; scenarios of folders correspond by their paths inside.

    A recording in a folder that cannot be read is told in the result and does not keep the others from being compared.

    Args:
        baseline, candidate: two MCAP files, or two folders: of run folders what their run.json lists is compared, of
            others all MCAP files in them.
        rules: tolerances; without them everything must be equal.
        strict_provenance: other versions, models and inputs make the verdict "different".
        visit: called for each scenario while its columns are in memory, for reports that draw them.

    Raises:
        InvalidValue: one is a file and the other a folder.
        RecordingError: one of two files cannot be read or is no recording, or a folder holds none.
    """
    rules = rules or Rules()
    folders = Path(baseline).is_dir(), Path(candidate).is_dir()
    if folders[0] != folders[1]:
        raise InvalidValue(
            "candidate", candidate, f"must be a {'folder' if folders[0] else 'file'}, as the baseline is"
        )
    if folders[0]:
        a, b = recordings_in(Path(baseline)), recordings_in(Path(candidate))
    else:
        a, b = {"": Path(baseline)}, {"": Path(candidate)}
    cases, unreadable = [], []
    for name in sorted(a.keys() & b.keys()):
        try:
            pair = read_pair(a[name], b[name], rules=rules)
        except RecordingError as error:
            if not folders[0]:
                raise
            unreadable.append(Unreadable(name, a[name], b[name], str(error)))
            continue
        found = diff_pair(pair, rules=rules, strict_provenance=strict_provenance)
        case = Case(name or found.name, a[name], b[name], found, of_folders=folders[0])
        if visit is not None:
            visit(case, pair)
        cases.append(case)
    missing, extra = sorted(a.keys() - b.keys()), sorted(b.keys() - a.keys())
    return RunDifference(
        baseline=str(baseline),
        candidate=str(candidate),
        cases=tuple(cases),
        missing=tuple(missing),
        extra=tuple(extra),
        ignored=tuple(name for name in (*missing, *extra) if rules.tolerance(f"{SCENARIOS}/{name}").ignore),
        unreadable=tuple(unreadable),
    )
