"""What a scenario expects of its own results: pass or fail without a baseline."""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Self, Union

from pydantic import Discriminator, Tag, model_validator

from replay.guarding.part import GuardExpectation
from replay.language.fields import Part, When, needs_one, rejected
from replay.language.units import Distance, Time
from replay.scenario.collision import GlobPair
from replay.sensing.kinds import KINDS


class BetweenPart(Part):
    """A window of time, both ends included."""

    between: tuple[Time, Time]
    """From and to [s]."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.between[0] > self.between[1]:
            raise rejected(f"must not be before its start, {self.between[0]:.6g} s", at=("between", 1))
        return self


def _window_or_word(value: Any) -> str:
    return "a window" if isinstance(value, dict | BetweenPart) else "a word"


Contact = Annotated[
    Annotated[When, Tag("a word")] | Annotated[BetweenPart, Tag("a window")],
    Discriminator(_window_or_word),
]


class ClearanceBounds(Part):
    """Bounds of the clearance."""

    min: Distance
    """The clearance never falls below this one [m]."""


class PairExpectation(Part):
    """What the pairs of shapes that two patterns match do, taken together."""

    pair: GlobPair
    """Two patterns, each of a link's name or of "link/shape"."""
    contact: Contact | None = None
    """Whether any of the pairs is in contact; {between: [from, to]}: their first contact begins within."""
    bounds: When | None = None
    """Whether the bounding volumes of any of the pairs meet (contact included)."""
    clearance: ClearanceBounds | None = None
    """Bounds of the smallest clearance of the pairs."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        needs_one(self, "contact", "bounds", "clearance")
        return self


PARTS = {"pair": PairExpectation, "guard": GuardExpectation, **{kind.name: kind.expectation for kind in KINDS.values()}}
"""Expectations by the key that tells what they are about."""


def _about(value: Any) -> str | None:
    has = value.__contains__ if isinstance(value, dict) else partial(hasattr, value)
    return next((f"about a {key}" for key in PARTS if has(key)), None)


if TYPE_CHECKING:
    Expectation = Part
else:
    Expectation = Annotated[
        Union[tuple(Annotated[part, Tag(f"about a {key}")] for key, part in PARTS.items())],  # noqa: UP007
        Discriminator(_about),
    ]
