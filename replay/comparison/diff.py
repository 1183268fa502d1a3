"""Compare two recordings by meaning."""

from __future__ import annotations

import datetime
import hashlib
from collections.abc import Iterable
from pathlib import Path

import numpy as np

from replay.comparison.columns import NANOSECONDS, Gates, MatchedFrames, compare_groups
from replay.comparison.difference import Absence, Change, Difference, Frames, Moment, SignalDifference
from replay.comparison.provenance import file_changes, provenance_changes
from replay.comparison.rules import Rules
from replay.comparison.signals import Group, Signal, groups
from replay.recording.reader import Recording

FRAMES = "/frames"
"""What a rule's pattern matches to accept missing and extra frames."""


def compare(
    baseline: Recording,
    candidate: Recording,
    *,
    rules: Rules | None = None,
    strict_provenance: bool = False,
    scene: Iterable[Change] = (),
) -> Difference:
    """Return how a candidate differs from a baseline.

    Args:
        baseline, candidate: two recordings; frames are matched by time, everything else by name.
        rules: tolerances; without them everything must be equal (NaN equals NaN, and -0.0 equals 0.0).
        strict_provenance: other versions, models and inputs make the verdict "different".
        scene: changes of the scene or the schemas that were found in the files.
    """
    rules = rules or Rules()
    frames, matched = _match_frames(baseline, candidate, rules)
    groups_a = {group.key: group for group in groups(baseline)}
    groups_b = {group.key: group for group in groups(candidate)}
    gates: Gates = {}
    signals: list[SignalDifference] = []
    for key, group in groups_a.items():
        if key in groups_b:
            signals.extend(compare_groups(group, groups_b[key], matched, rules, gates))
    only_a, only_b = _only_in(groups_a, groups_b), _only_in(groups_b, groups_a)
    missing = _absences(only_a, _topics(groups_b), rules)
    extra = _absences(only_b, _topics(groups_a), rules)
    missing, extra = _renamed(missing, extra, _Readings(groups_a, matched.baseline), _Readings(groups_b, matched.candidate))
    scene = (*scene, *file_changes(baseline.provenance, candidate.provenance), *_units(groups_a, groups_b))
    result = Difference(
        name=baseline.provenance.scenario,
        provenance=provenance_changes(baseline.provenance, candidate.provenance),
        scene=tuple(change for change in scene if not rules.tolerance(change.name).ignore),
        frames=frames,
        missing=missing,
        extra=extra,
        signals=tuple(sorted(signals, key=lambda s: (not s.decides, s.signal))),
        compared=sum(len(group.signals) for group in groups_a.values()) - len(only_a),
        strict_provenance=strict_provenance,
    )
    return _with_expired(result, rules)
