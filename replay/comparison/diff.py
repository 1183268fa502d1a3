"""Compare two recordings by meaning."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping

import numpy as np

from replay.comparison.absences import absences, with_new_names
from replay.comparison.columns import Gates, MatchedFrames, compare_groups
from replay.comparison.difference import Change, Difference, Frames, Moment, SignalDifference
from replay.comparison.provenance import file_changes, provenance_changes
from replay.comparison.rules import Rule, Rules
from replay.comparison.signals import Group, groups
from replay.numerics.arrays import Integers
from replay.numerics.constants import SECOND
from replay.recording.reader import Recording

FRAMES = "/frames"
"""What a rule's pattern matches to accept missing and extra frames."""
EVENTS = "/events"
"""The topic of the event messages: compared as such only when everything that they follow from is equal."""
UNITS = "/units"
"""Begins the name of a joint's unit in changes and rules: `/units/table_height`."""


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
        added: what only the candidate's schemas have; told with the provenance.
        equal: number of signals that are known to be equal and are in neither recording.
    """
    rules = rules or Rules()
    frames, matched = match_frames(baseline.time, candidate.time, rules)
    groups_a = {group.key: group for group in groups(baseline)}
    groups_b = {group.key: group for group in groups(candidate)}
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
    total = sum(len(group.signals) for group in groups_a.values())
    told = not signals and not missing and not extra and not frames.missing and not frames.extra
    changes = (
        *scene,
        *file_changes(baseline.provenance, candidate.provenance),
        *_units(groups_a, groups_b),
        *(_event_messages(baseline, candidate) if told else ()),
    )
    found = Difference(
        name=baseline.provenance.scenario,
        provenance=(*provenance_changes(baseline.provenance, candidate.provenance), *added),
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


def _event_messages(baseline: Recording, candidate: Recording) -> Iterator[Change]:
    if baseline.events != candidate.events:
        only_a = baseline.events.count_missing_in(candidate.events)
        only_b = candidate.events.count_missing_in(baseline.events)
        yield Change(
            EVENTS,
            f"{len(baseline.events)} events, {only_a} of them only here",
            f"{len(candidate.events)} events, {only_b} of them only here",
        )
