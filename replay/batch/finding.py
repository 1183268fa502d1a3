"""What is kept of a comparison once its page is written: little, because a night has many."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from typing_extensions import TypedDict

from replay.comparison.causes import Causes
from replay.comparison.effects import Effect, Severity

_KEPT = 5
NO_CAUSES = Causes()
_REPORT = 8_000
"""Characters of a report in text that are kept, for JUnit."""


class WrittenEffect(TypedDict):
    """An effect in run.json; a size that is infinite is null."""

    severity: str
    size: float | None
    text: str
    subject: str


class WrittenCauses(TypedDict, total=False):
    """Causes in run.json."""

    inputs: list[str]
    model: list[str]
    libraries: list[str]
    code: list[str]


class WrittenFinding(TypedDict):
    """A finding in run.json."""

    baseline: str
    effects: list[WrittenEffect]
    count: int
    causes: WrittenCauses


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


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

    @property
    def told_of(self) -> bool:
        """Whether there is anything to tell: an effect, or a change beside the results."""
        return bool(self.count or self.causes.changes)

    @staticmethod
    def of(baseline: Path, effects: Sequence[Effect], causes: Causes, report: str) -> Finding:
        """Return what is kept."""
        kept = tuple(Effect(e.severity, e.size, e.text, e.subject, e.signals[:1], e.at) for e in effects[:_KEPT])
        return Finding(baseline, kept, len(effects), causes, report[:_REPORT])

    def with_effects(self, effects: Sequence[Effect], report: str) -> Finding:
        """Return the same with what else is to be seen, the worst first, and another report."""
        kept = sorted([*self.effects, *effects], key=lambda effect: (effect.severity, -effect.size))[:_KEPT]
        return replace(self, effects=tuple(kept), count=self.count + len(effects), report=report[:_REPORT])

    def as_json(self) -> dict[str, Any]:
        """Return what run.json holds of it: the worst effect and the causes."""
        told = ((key, getattr(self.causes, key)) for key in ("inputs", "model", "libraries", "code"))
        causes = {key: list(lines) for key, lines in told if lines}
        worst = [
            {"severity": e.severity.name.lower(), "size": _finite(e.size), "text": e.text, "subject": e.subject}
            for e in self.effects[:1]
        ]
        return {"baseline": str(self.baseline), "effects": worst, "count": self.count, "causes": causes}

    @staticmethod
    def from_json(values: WrittenFinding) -> Finding:
        """Return what `as_json` wrote; ValueError when a severity is none."""
        effects = []
        for effect in values["effects"]:
            name = effect["severity"].upper()
            if name not in Severity.__members__:
                raise ValueError(f"{effect['severity']!r} is no severity")
            size = math.inf if effect["size"] is None else effect["size"]
            effects.append(Effect(Severity[name], size, effect["text"], effect["subject"]))
        known = values["causes"]
        causes = Causes(
            tuple(known.get("inputs", ())),
            tuple(known.get("model", ())),
            tuple(known.get("libraries", ())),
            tuple(known.get("code", ())),
        )
        return Finding(Path(values["baseline"]), tuple(effects), values["count"], causes)

    def told(self) -> Finding:
        """Return what is kept once the scenario's page tells the difference of texts."""
        return replace(self, causes=replace(self.causes, text=""))
