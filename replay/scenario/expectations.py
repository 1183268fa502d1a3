"""What a scenario expects of its own results: pass or fail without a baseline."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

from pydantic import Discriminator, Tag, model_validator

from replay.scenario.collision import GlobPair
from replay.scenario.fields import Name, Part, rejected
from replay.scenario.units import Distance, Time, Voltage

When = Literal["never", "always", "sometimes"]
"""In no frame, in every frame, in at least one."""


class Between(Part):
    """A window of time, both ends included."""

    between: tuple[Time, Time]
    """From and to [s]."""

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.between[0] > self.between[1]:
            raise rejected(f"must not be before its start, {self.between[0]:.6g} s", at=("between", 1))
        return self


def _window_or_word(value: Any) -> str:
    return "a window" if isinstance(value, dict | Between) else "a word"


Contact = Annotated[
    Annotated[When, Tag("a word")] | Annotated[Between, Tag("a window")],
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
        _needs_one(self, "contact", "bounds", "clearance")
        return self


class DistanceExpectation(Part):
    """What a distance sensor reads."""

    distance: Name
    """Name of the distance sensor."""
    min: Distance | None = None
    """No reading is below this one [m]."""
    max: Distance | None = None
    """No reading is above this one [m]."""
    detected: When | None = None
    """Whether something is inside the cone and within range."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        _needs_one(self, "min", "max", "detected")
        _ordered(self.min, self.max, "m")
        return self


class OutputBounds(Part):
    """Bounds of an output voltage."""

    min: Voltage | None = None
    """No output is below this one [V]."""
    max: Voltage | None = None
    """No output is above this one [V]."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        _needs_one(self, "min", "max")
        _ordered(self.min, self.max, "V")
        return self


class CapacitiveExpectation(Part):
    """What a capacitive sensor reads."""

    capacitive: Name
    """Name of the capacitive sensor."""
    output: OutputBounds | None = None
    """Bounds of the output voltage."""
    saturated: When | None = None
    """Whether the capacitance is infinite."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        _needs_one(self, "output", "saturated")
        return self


def _needs_one(part: Part, *keys: str) -> None:
    if all(getattr(part, key) is None for key in keys):
        raise rejected(f"expects nothing; add one of {', '.join(keys)}")


def _ordered(low: float | None, high: float | None, unit: str) -> None:
    if low is not None and high is not None and low > high:
        raise rejected(f"must not be below min, {low:.6g} {unit}", at=("max",))


def _kind(value: Any) -> str | None:
    kinds = {"pair": "expects a pair", "distance": "expects a distance", "capacitive": "expects a capacitance"}
    if isinstance(value, dict):
        return next((tag for kind, tag in kinds.items() if kind in value), None)
    return next((tag for kind, tag in kinds.items() if hasattr(value, kind)), None)


Expectation = Annotated[
    Annotated[PairExpectation, Tag("expects a pair")]
    | Annotated[DistanceExpectation, Tag("expects a distance")]
    | Annotated[CapacitiveExpectation, Tag("expects a capacitance")],
    Discriminator(_kind),
]
