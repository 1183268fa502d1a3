"""What became of one line of an expectation."""

from __future__ import annotations

from dataclasses import dataclass

from replay.language.node import Place
from replay.scenario.measures import Measure


@dataclass(frozen=True)
class Outcome:
    """What became of one line of an expectation.

    Attributes:
        expectation: as people read it: `detector* | patient*: contact never`.
        place: where it is written; None when the scenario was not read from text.
        passed: whether it held.
        detail: the values and times that decided.
        measure: the number that decided; None of an earlier run that did not tell it.
    """

    expectation: str
    place: Place | None
    passed: bool
    detail: str
    measure: Measure | None = None
