"""The rules of `diff` for comparisons with a machine: those for measured signals alone come first."""

from __future__ import annotations

import dataclasses

from replay.comparison.rules import Rule, Rules
from replay.comparison.signals import Signal

MEASURED = "/measured"
"""Begins the pattern of a rule that is for comparisons with a machine alone: `/measured/distance/*`."""
DETECTED = "detected"
"""Ends the name of what says whether a signal has a value at all: `/distance/tip/distance/detected`."""


def detection_of(signal: Signal) -> Signal:
    """Return the signal that says whether another one has a value."""
    return Signal(signal.topic, signal.field, "/".join(filter(None, [signal.name, DETECTED])))


@dataclasses.dataclass(frozen=True)
class MeasuredRules(Rules):
    """Rules that are asked for the plain names of signals.

    A rule for `/measured` and the name comes before one for the name itself. What says whether a signal has a value has
    the signal's rule, if none is for it alone.
    """

    @staticmethod
    def made_of(rules: Rules, scenario: str) -> MeasuredRules:
        """Return the rules that are for a scenario."""
        mine = rules.of(scenario)
        return MeasuredRules(mine.active, mine.expired)

    def rule(self, full_name: str) -> Rule | None:
        """Return the rule that applies to a signal, or None: exact."""
        names = [full_name]
        if full_name.endswith(f"/{DETECTED}"):
            names.append(full_name.removesuffix(f"/{DETECTED}"))
        tried = [f"{MEASURED}{name}" for name in names] + names
        return next((rule for rule in map(super().rule, tried) if rule is not None), None)
