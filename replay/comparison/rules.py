"""Tolerances per signal: the first rule from the top whose pattern matches; exact when none does."""

from __future__ import annotations

import datetime
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

from replay.language.globs import any_of, fits


@dataclass(frozen=True)
class Tolerance:
    """How far the values of a signal may be apart; the default is: not at all.

    Numbers are equal when |a - b| <= max(abs, rel · max(|a|, |b|)). A rotation is one number, the angle between the two
    [rad], so `rel` says nothing about it. A number and NaN, or a number and infinity, are never equal.

    Attributes:
        abs: largest difference, in the signal's unit.
        rel: largest difference relative to the larger value.
        rms: largest root mean square of the differences over all frames, None for any; where neither `abs` nor `rel`
            is given beside it, differences of single frames do not count.
        time, frames: largest shift of an event [s] and [frames]; the larger one counts.
        nan: whether NaN in both is equal, or any NaN a difference.
        zero: whether 0.0 and -0.0 are equal, or different.
        ignore: the signal is not compared and may be missing or extra.
        bracket: largest shift [s] of an event that a run knows more finely than from frame to frame; None: as others.
    """

    abs: float = 0.0
    rel: float = 0.0
    time: float = 0.0
    frames: int = 0
    nan: Literal["equal", "fail"] = "equal"
    zero: Literal["equal", "signed"] = "equal"
    ignore: bool = False
    bracket: float | None = None
    rms: float | None = None

    @property
    def of_frames(self) -> bool:
        """Whether the differences of single frames count."""
        return self.rms is None or self.abs > 0.0 or self.rel > 0.0


EXACT = Tolerance()


@dataclass(frozen=True)
class Rule:
    """A tolerance with the signals that it is for.

    Attributes:
        signals: patterns of full names: `*` stands for any characters, slashes included, `?` for one, `[abc]` for one
            of these; upper and lower case differ.
        reason: why the difference is acceptable.
        link: where it is discussed.
        expires: last day on which the rule applies.
        place: where the rule is written.
        scenarios: patterns of the scenarios that it is for; all when there are none.
    """

    signals: tuple[str, ...]
    tolerance: Tolerance
    reason: str
    link: str | None = None
    expires: datetime.date | None = None
    place: str = ""
    scenarios: tuple[str, ...] = ()

    @cached_property
    def _pattern(self) -> re.Pattern[str]:
        return any_of(self.signals)

    def matches(self, full_name: str) -> bool:
        """Return whether the rule is for the signal of this full name."""
        return self._pattern.match(full_name) is not None

    def is_for(self, scenario: str) -> bool:
        """Return whether the rule is for a scenario: it names all, or this one, or a pattern that it fits."""
        return not self.scenarios or any(scenario == glob or fits(scenario, glob) for glob in self.scenarios)


@dataclass(frozen=True)
class Rules:
    """Rules as they apply on one day, in order.

    Attributes:
        active: rules that apply.
        expired: rules that no longer do; reported where they would have been the first to match.
    """

    active: tuple[Rule, ...] = ()
    expired: tuple[Rule, ...] = ()
    _known: dict[str, Rule | None] = field(default_factory=dict, repr=False, compare=False)

    @staticmethod
    def on(day: datetime.date, rules: Sequence[Rule]) -> Rules:
        """Return the rules as they apply on a day."""
        late = tuple(rule for rule in rules if rule.expires is not None and rule.expires < day)
        return Rules(tuple(rule for rule in rules if rule not in late), late)

    def of(self, scenario: str) -> Rules:
        """Return the rules that are for a scenario."""
        if not any(rule.scenarios for rule in (*self.active, *self.expired)):
            return self
        active, expired = (
            tuple(rule for rule in rules if rule.is_for(scenario)) for rules in (self.active, self.expired)
        )
        return Rules(active, expired)

    def rule(self, full_name: str) -> Rule | None:
        """Return the rule that applies to a signal, or None: exact."""
        if full_name not in self._known:
            self._known[full_name] = next((rule for rule in self.active if rule.matches(full_name)), None)
        return self._known[full_name]

    def tolerance(self, full_name: str) -> Tolerance:
        """Return the tolerance that applies to a signal."""
        rule = self.rule(full_name)
        return EXACT if rule is None else rule.tolerance
