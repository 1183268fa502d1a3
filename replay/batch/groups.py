"""Scenarios that need attention, grouped by what explains them: what nothing explains first, then the worst first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from replay.batch import failure_kind
from replay.batch.case import CaseResult
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
    failing = [item for item in judged if not item.verdict.fine]
    kinds = failure_kind.kinds({item.name: item.message for item in failing})
    found: dict[tuple[bool, tuple[str, ...]], list[Judged]] = {}
    for item in failing:
        found.setdefault(_cause(item, kinds[item.name]), []).append(item)
    made = [
        CauseGroup(_name(members), explained, tuple(sorted(members, key=lambda item: item.order)))
        for (explained, _), members in found.items()
    ]
    return tuple(sorted(made, key=lambda group: group.order))


def _cause(item: Judged, kind: str) -> tuple[bool, tuple[str, ...]]:
    """Return whether a scenario's failure is explained, and what tells it from others."""
    if item.finding is not None and item.finding.told_of:
        causes = item.finding.causes
        return bool(causes.changes), causes.changes or (causes.name,)
    if item.verdict is RegressVerdict.BROKEN and item.result is not None:
        return False, ("broken", *_broken(item.result))
    if item.verdict is RegressVerdict.MISSING:
        return True, ("missing",)
    return False, (item.verdict.value, kind)


def _name(members: Sequence[Judged]) -> str:
    """Return what scenarios of one cause have in common."""
    item = members[0]
    if item.finding is not None and item.finding.told_of:
        return item.finding.causes.name
    if item.verdict is RegressVerdict.BROKEN and item.result is not None:
        return f"broken: {'; '.join(_broken(item.result))}"
    if item.verdict is RegressVerdict.MISSING:
        return "no baseline yet"
    reason = failure_kind.in_common([member.message for member in members])
    return f"{item.verdict.value}: {reason}" if reason else item.verdict.value


def _broken(result: CaseResult) -> tuple[str, ...]:
    return tuple(outcome.expectation for outcome in result.outcomes if not outcome.passed)
