"""Compare two recordings by meaning."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Iterable, Iterator, Mapping

import numpy as np

from replay.collision.columns import Level
from replay.comparison.absences import Groups, absences, with_new_names
from replay.comparison.columns import Gates, MatchedFrames, compare_groups
from replay.comparison.difference import Absence, Change, Difference, Frames, Moment, SignalDifference
from replay.comparison.provenance import file_changes, provenance_changes
from replay.comparison.rules import Rule, Rules
from replay.comparison.signals import SCHEMAS, Group, Signal, groups, silent_fields
from replay.errors import count
from replay.numerics.arrays import Integers
from replay.numerics.constants import SECOND
from replay.recording.reader import Recording

FRAMES = "/frames"
"""What a rule's pattern matches to accept missing and extra frames."""
EVENTS = "/events"
"""The topic of the event messages: compared as such only when everything that they follow from is equal."""
UNITS = "/units"
"""Begins the name of a joint's unit in changes and rules: `/units/table_height`."""
_LEVEL = "collision", "level"


def compare(
    baseline: Recording,
    candidate: Recording,
    *,
    rules: Rules | None = None,
    strict_provenance: bool = False,
    scene: Iterable[Change] = (),
    added: Iterable[Change] = (),
    equal: int = 0,
) -> Difference:
    """Return how a candidate differs from a baseline.

    Args:
        baseline, candidate: two recordings; frames are matched by time, everything else by name.
        rules: tolerances; without them everything must be equal (NaN equals NaN, and -0.0 equals 0.0).
        strict_provenance: other versions, models and inputs make the verdict "different".
        scene: changes of the scene or the schemas, which recordings do not hold in columns.
        added: what only the candidate's schemas have; told with the provenance, as what only the candidate's columns
            have that the baseline's format or model cannot have.
        equal: number of signals that are known to be equal and are in neither recording.
    """
    rules = (rules or Rules()).of(candidate.provenance.scenario)
    frames, matched = match_frames(baseline.time, candidate.time, rules)
    groups_a = {group.key: group for group in groups(baseline)}
    groups_b = {group.key: group for group in groups(candidate)}
    only_a = _only_in(groups_a, groups_b, silent_fields(candidate))
    only_b = _only_in(groups_b, groups_a, silent_fields(baseline))
    added = (*_newly_told([groups_b[key] for key in only_b], groups_a, groups_b), *added)
    lost = _no_longer_told([groups_a[key] for key in only_a], rules)
    for key in {*only_a, *only_b}:
        groups_a.pop(key, None)
        groups_b.pop(key, None)
    gates: Gates = {}
    signals: list[SignalDifference] = []
    for key, group in groups_a.items():
        if key in groups_b:
            signals.extend(compare_groups(group, groups_b[key], matched, rules, gates))
    missing, extra = with_new_names(
        absences(groups_a, groups_b, rules),
        absences(groups_b, groups_a, rules),
        groups_a,
        groups_b,
        (matched.baseline, matched.candidate),
    )
    missing = (*lost, *missing)
    total = sum(len(group.signals) for group in groups_a.values()) + sum(len(absence.signals) for absence in lost)
    told = not signals and not missing and not extra and not frames.missing and not frames.extra
    changes = (
        *scene,
        *file_changes(baseline.provenance, candidate.provenance),
        *_units(groups_a, groups_b),
        *(_event_messages(baseline, candidate) if told else ()),
    )
    found = Difference(
        name=baseline.provenance.scenario,
        provenance=(*provenance_changes(baseline.provenance, candidate.provenance), *_once_a_topic(added)),
        scene=tuple(change for change in changes if not rules.tolerance(change.name).ignore),
        frames=frames,
        missing=missing,
        extra=extra,
        signals=tuple(sorted(signals, key=lambda signal: (not signal.decides, signal.signal))),
        compared=equal + total - sum(len(absence.signals) for absence in missing),
        strict_provenance=strict_provenance,
    )
    return dataclasses.replace(found, expired=expired_rules(found, rules))


def expired_rules(found: Difference, rules: Rules) -> tuple[Rule, ...]:
    """Return the rules that no longer apply and match something that decides."""
    names = list(_deciding_names(found))
    return tuple(rule for rule in rules.expired if any(rule.matches(name) for name in names))


def _deciding_names(found: Difference) -> Iterator[str]:
    yield from (signal.signal.full_name for signal in found.deciding)
    yield from (change.name for change in found.scene)
    for absence in (*found.missing, *found.extra):
        if absence.decides:
            yield from (signal.full_name for signal in absence.signals)
    if found.frames.decides:
        yield FRAMES


def match_frames(a: Integers, b: Integers, rules: Rules) -> tuple[Frames, MatchedFrames]:
    """Return which frames two runs have in common, by integer nanoseconds, and what there is to say of the others."""
    if np.array_equal(a, b):
        return Frames(matched=len(a)), MatchedFrames(a, None, None)
    time, rows_a, rows_b = np.intersect1d(a, b, assume_unique=True, return_indices=True)
    missing, extra = np.setdiff1d(a, time, assume_unique=True), np.setdiff1d(b, time, assume_unique=True)
    frames = Frames(
        matched=len(time),
        missing=len(missing),
        extra=len(extra),
        first_missing=_moment(a, missing),
        first_extra=_moment(b, extra),
        decides=not rules.tolerance(FRAMES).ignore,
    )
    return frames, MatchedFrames(time, rows_a, rows_b)


def _moment(time: Integers, only: Integers) -> Moment | None:
    return Moment(int(np.searchsorted(time, only[0])), float(only[0]) / SECOND) if len(only) else None


def _units(groups_a: Mapping[tuple[str, str], Group], groups_b: Mapping[tuple[str, str], Group]) -> Iterator[Change]:
    """Yield the joints whose positions are in another unit: one that turned has become one that slides."""
    key = ("joint_states", "position")
    if key in groups_a and key in groups_b:
        unit_b = {signal.name: signal.unit for signal in groups_b[key].signals}
        for signal in groups_a[key].signals:
            if unit_b.get(signal.name, signal.unit) != signal.unit:
                yield Change(f"{UNITS}/{signal.name}", signal.unit, unit_b[signal.name])


def _only_in(own: Groups, other: Groups, silent: Collection[tuple[str, str]]) -> list[tuple[str, str]]:
    """Return the fields that one recording tells of and the other, which has their topic, cannot.

    Args:
        own, other: signals of both.
        silent: what the other's format or model cannot tell, see `silent_fields`.
    """
    topics = {topic for topic, _ in other}
    return [key for key in own if key in silent and key[0] in topics and (key not in other or own[key].between)]


def _newly_told(new: Iterable[Group], groups_a: Groups, groups_b: Groups) -> Iterator[Change]:
    """Yield what only the candidate tells, once a topic."""
    fields: dict[str, list[str]] = {}
    for topic, signals in _by_topic(new).items():
        names = dict.fromkeys(signal.field for signal in signals)
        fields.setdefault(topic, []).append(f"{', '.join(names)} ({count(len(signals), 'signal')})")
    level_a, level_b = groups_a.get(_LEVEL), groups_b.get(_LEVEL)
    if level_a and level_b and level_b.between and not level_a.between and level_b.moments:
        contacts = level_b.moments.count_between(Level.CONTACT)
        fields["/collision"] += [f"{count(contacts, 'contact')} between two frames"] if contacts else []
    yield from (Change(topic, None, "; ".join(texts)) for topic, texts in fields.items())


def _no_longer_told(lost: Iterable[Group], rules: Rules) -> tuple[Absence, ...]:
    """Return what only the baseline tells, once a topic."""
    return tuple(
        Absence(
            topic=topic,
            name=", ".join(dict.fromkeys(signal.field for signal in signals)),
            signals=tuple(signals),
            whole_topic=False,
            same_as=None,
            decides=not all(rules.tolerance(signal.full_name).ignore for signal in signals),
        )
        for topic, signals in _by_topic(lost).items()
    )


def _by_topic(groups: Iterable[Group]) -> dict[str, list[Signal]]:
    found: dict[str, list[Signal]] = {}
    for group in groups:
        for signal in group.signals:
            found.setdefault(signal.topic, []).append(signal)
    return found


def _once_a_topic(added: Iterable[Change]) -> Iterator[Change]:
    """Yield changes without the new fields of schemas whose signals are told anyway."""
    changes = tuple(added)
    told = tuple(f"{SCHEMAS}{change.name}/" for change in changes if not change.name.startswith(SCHEMAS))
    yield from (change for change in changes if not change.name.startswith(told))


def _event_messages(baseline: Recording, candidate: Recording) -> Iterator[Change]:
    a, b = baseline.events, candidate.events
    if a.earliest is not None or b.earliest is not None:  # moments within overlapping brackets are the same
        a, b = a.at_frames(baseline.time), b.at_frames(candidate.time)
    if a != b:
        only_a, only_b = a.count_missing_in(b), b.count_missing_in(a)
        yield Change(
            EVENTS, f"{len(a)} events, {only_a} of them only here", f"{len(b)} events, {only_b} of them only here"
        )
