"""Scenarios that need attention, grouped by what explains them: what nothing explains first, then the worst first."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass

from replay.batch.judged import Judged, RegressVerdict
from replay.comparison.effects import Severity


@dataclass(frozen=True, eq=False)
class CauseGroup:
    """Scenarios with the same change of input or model, or with the same failure.

    Attributes:
        name: the change: "person/body radius 20 -> 21 cm"; or what they have in common.
        explained: something but the code has changed.
        members: the scenarios, the worst first.
    """

    name: str
    explained: bool
    members: tuple[Judged, ...]

    @property
    def severity(self) -> Severity:
        """Of the worst member."""
        return self.members[0].severity

    @property
    def order(self) -> tuple[object, ...]:
        """What groups are sorted by."""
        return self.explained, self.severity, -self.members[0].size, -len(self.members), self.name


def groups(judged: Iterable[Judged]) -> tuple[CauseGroup, ...]:
    """Return the groups of the scenarios that need attention."""
    found: dict[tuple[bool, tuple[str, ...]], list[Judged]] = {}
    names: dict[tuple[bool, tuple[str, ...]], str] = {}
    for item in judged:
        if not item.verdict.fine:
            explained, key, name = _cause(item)
            found.setdefault((explained, key), []).append(item)
            names[explained, key] = name
    made = [
        CauseGroup(names[key], key[0], tuple(sorted(members, key=lambda item: item.order)))
        for key, members in found.items()
    ]
    return tuple(sorted(made, key=lambda group: group.order))


def _cause(item: Judged) -> tuple[bool, tuple[str, ...], str]:
    """Return whether a scenario's failure is explained, what tells it from others, and its name."""
    if item.finding is not None and item.finding.told_of:
        causes = item.finding.causes
        return bool(causes.changes), causes.changes or (causes.name,), causes.name
    if item.verdict is RegressVerdict.BROKEN and item.result is not None:
        broken = tuple(outcome.expectation for outcome in item.result.outcomes if not outcome.passed)
        return False, ("broken", *broken), f"broken: {'; '.join(broken)}"
    if item.verdict is RegressVerdict.MISSING:
        return True, ("missing",), "no baseline yet"
    reason = _without_particulars(item)
    return False, (item.verdict.value, reason), f"{item.verdict.value}: {reason}" if reason else item.verdict.value


def _without_particulars(item: Judged) -> str:
    """Return why a scenario failed, without what is its own alone: its name, paths, numbers."""
    line = (item.message.splitlines() or [""])[0].replace(item.name, "...")
    return re.sub(r"\S*/\S+", "...", re.sub(r"\b\d[\d.e+-]*\b", "#", line))[:200]
