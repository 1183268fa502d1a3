"""Guards as they are written: when, how soon, which joints, how they are let go; and what can be expected of them."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, Union

from pydantic import Discriminator, Field, Tag, model_validator

from replay.language.fields import Glob, Name, Part, needs_one, rejected
from replay.language.units import (
    LENGTH,
    NUMBER,
    VELOCITY,
    VOLTAGE,
    AnyQuantity,
    Delay,
    Dimensioned,
    Distance,
    JointAcceleration,
    JointPosition,
    Quantity,
    Time,
)
from replay.sensing.kinds import KINDS

PairOfGlobs = tuple[Glob, Glob]
Factor = Annotated[float, Quantity("Factor", NUMBER, at_least=0.0, below=1.0)]
ApproachSpeed = Annotated[float, Quantity("ApproachSpeed", VELOCITY, at_least=0.0, at_most=1e3)]
Hysteresis = Annotated[Dimensioned, AnyQuantity("Hysteresis", (LENGTH, VOLTAGE), at_least=0.0)]


class ClearanceBelow(Part):
    """A threshold of a clearance."""

    below: Distance
    """The threshold [m]."""


class PairCondition(Part):
    """Two bodies are near each other, or touch; of several pairs the smallest clearance counts."""

    pair: PairOfGlobs = ("*", "*")
    """Two patterns, each of a link's name or of "link/shape"; any pair when left out."""
    clearance: ClearanceBelow | None = None
    """The clearance is below a threshold."""
    contact: Literal[True] | None = None
    """Any of the pairs is in contact."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.clearance is None) == (self.contact is None):
            raise rejected("needs either clearance or contact")
        return self


class SeparationPart(Part):
    """The protective separation distance in the form of ISO 13855: S = K (reaction + stopping time) + C.

    An aid to calculate with, no certification.
    """

    method: Literal["iso13855"]
    """The form of the distance."""
    K: ApproachSpeed
    """Speed at which a person approaches [m/s]."""
    C: Distance
    """Intrusion distance [m]."""
    distance: Name | None = None
    """The distance sensor that is compared with it."""
    pair: PairOfGlobs | None = None
    """The pairs whose smallest clearance is compared with it."""

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.distance is None) == (self.pair is None):
            raise rejected("needs either distance, a sensor, or pair")
        return self


class SeparationCondition(Part):
    """What is measured or proven is below the protective separation distance of the motion at that moment."""

    separation: SeparationPart
    """The distance, and what is compared with it."""


class AnyCondition(Part):
    """One of several conditions holds."""

    any: Annotated[tuple[Condition, ...], Field(min_length=1)]
    """The conditions."""


class AllCondition(Part):
    """Several conditions hold at once."""

    all: Annotated[tuple[Condition, ...], Field(min_length=1)]
    """The conditions."""


CONDITIONS: dict[str, type[Part]] = {
    **{kind.name: kind.output.condition for kind in KINDS.values() if kind.output is not None},
    "pair": PairCondition,
    "contact": PairCondition,
    "any": AnyCondition,
    "all": AllCondition,
    "separation": SeparationCondition,
}
"""Conditions by the key that tells what they are about."""
_TAGS = {key: f"on {part.__name__}" for key, part in CONDITIONS.items()}


def condition_key(value: Any) -> str | None:
    """Return the tag of a condition, as it is written or as a part."""
    if isinstance(value, Part):
        return next(tag for key, tag in _TAGS.items() if type(value) is CONDITIONS[key])
    return next((tag for key, tag in _TAGS.items() if isinstance(value, dict) and key in value), None)


if TYPE_CHECKING:
    Condition = Part
else:
    Condition = Annotated[
        Union[tuple(Annotated[part, Tag(tag)] for part, tag in dict(zip(CONDITIONS.values(), _TAGS.values())).items())],  # noqa: B905, UP007
        Discriminator(condition_key),
    ]
    AnyCondition.model_rebuild()
    AllCondition.model_rebuild()


def parts_of(when: Part) -> Iterator[Part]:
    """Yield the conditions that a condition is made of and that are no combinations."""
    if isinstance(when, AnyCondition | AllCondition):
        for part in when.any if isinstance(when, AnyCondition) else when.all:
            yield from parts_of(part)
    else:
        yield when


def sensors_of(when: Part) -> Iterator[tuple[str, str]]:
    """Yield kind and name of the sensor that a condition, which is no combination, looks at."""
    asked = when.separation if isinstance(when, SeparationCondition) else when
    for kind in KINDS:
        name = getattr(asked, kind, None)
        if isinstance(name, str):
            yield kind, name


class SlowPart(Part):
    """A share of the scripted speed."""

    to: Factor
    """The share, 0 to 1."""
    joints: Annotated[tuple[Name, ...], Field(min_length=1)]
    """The joints that are slowed down."""


class ReleasePart(Part):
    """When a guard lets its joints go on."""

    after: Delay = Fraction(0)
    """How long the condition must be gone [s], while the joints hold."""
    hysteresis: Hysteresis | None = None
    """How far above their thresholds readings must be [V or m]."""


def _word_or_rule(value: Any) -> str:
    return "a rule" if isinstance(value, dict | ReleasePart) else "a word"


Release = Annotated[
    Annotated[Literal["never"], Tag("a word")] | Annotated[ReleasePart, Tag("a rule")], Discriminator(_word_or_rule)
]


class GuardPart(Part):
    """A rule that stops or slows joints: their script is played more slowly, so that they stay on their path."""

    when: Condition
    """The condition, looked at in every frame."""
    for_: Annotated[Delay, Field(alias="for")] = Fraction(0)
    """How long it must hold [s]."""
    reaction: Time = 0.0
    """Time from then until braking begins [s]."""
    stop: Annotated[tuple[Name, ...] | None, Field(min_length=1)] = None
    """The joints that are stopped."""
    slow: SlowPart | None = None
    """The joints that are slowed down."""
    direction: dict[Name, Literal["positive", "negative"]] = Field(default_factory=dict)
    """The condition holds only while one of these joints is moved this way by its script."""
    deceleration: dict[Name, JointAcceleration] = Field(default_factory=dict)
    """What braking adds to the acceleration of joints at most; their limit of deceleration when left out."""
    release: Release = "never"
    """When the joints go on."""

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that are stopped or slowed down."""
        return self.stop or (self.slow.joints if self.slow is not None else ())

    @model_validator(mode="after")
    def _one_of_two(self) -> Self:
        if (self.stop is None) == (self.slow is None):
            raise rejected("needs either stop or slow")
        for name in self.deceleration:
            if name not in self.joints:
                raise rejected("is none of the joints that the guard names", at=("deceleration", name))
            if self.deceleration[name].value <= 0.0:
                raise rejected("must be above 0", at=("deceleration", name))
        return self


class BeforePart(Part):
    """A time by which something must be so."""

    before: Time
    """[s] from the scenario's start."""


class LargestWay(Part):
    """A bound of ways."""

    max: JointPosition
    """None is longer [rad or m]."""


class LeastClearance(Part):
    """A bound of clearances."""

    min: Distance
    """None is smaller [m]."""


def _word_or_time(value: Any) -> str:
    return "a time" if isinstance(value, dict | BeforePart) else "a word"


Stops = Annotated[
    Annotated[Literal["always", "never"], Tag("a word")] | Annotated[BeforePart, Tag("a time")],
    Discriminator(_word_or_time),
]


class GuardExpectation(Part):
    """What a guard does."""

    guard: Name
    """Name of the guard."""
    stops: Stops | None = None
    """"always": it triggers, and all its joints come to rest each time; "never": it does not trigger; {before: TIME}:
    the first time by then."""
    stopping_distance: LargestWay | None = None
    """Bound of the way from the trigger to the stop, of each of its joints."""
    clearance_at_stop: LeastClearance | None = None
    """Bound of the clearance of all pairs that its joints move, when they have stopped; 0 if they met on the way."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        needs_one(self, "stops", "stopping_distance", "clearance_at_stop")
        return self
