"""What is kept of a comparison once its page is written: little, because a night has many."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from replay.comparison.causes import Causes
from replay.comparison.effects import Effect

_KEPT = 5
NO_CAUSES = Causes()
_REPORT = 8_000
"""Characters of a report in text that are kept, for JUnit."""


@dataclass(frozen=True)
class Finding:
    """What a scenario's comparison with its baseline said.

    Attributes:
        baseline: the accepted recording.
        effects: the worst few; `count` of all.
        causes: what has changed beside the results.
        report: the difference as text.
    """

    baseline: Path
    effects: tuple[Effect, ...] = ()
    count: int = 0
    causes: Causes = NO_CAUSES
    report: str = ""

    @staticmethod
    def of(baseline: Path, effects: Sequence[Effect], causes: Causes, report: str) -> Finding:
        """Return what is kept."""
        kept = tuple(Effect(e.severity, e.size, e.text, e.subject, e.signals[:1]) for e in effects[:_KEPT])
        return Finding(baseline, kept, len(effects), causes, report[:_REPORT])

    def told(self) -> Finding:
        """Return what is kept once the scenario's page tells the difference of texts."""
        return replace(self, causes=replace(self.causes, text=""))
