"""Distance sensors as they are written: the sensor, its methods, what can be expected of it."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

from pydantic import Field, StrictInt, model_validator

from replay.language.fields import Glob, Name, Part, Pose, When, in_order, needs_one, rejected
from replay.language.units import Aperture, Distance, Length, Range
from replay.sensing.kind import Method
from replay.sensing.signal.part import LengthSignal


class DistanceSensorPart(Part):
    """Reads the distance to the closest point inside a cone; the cone's apex is the pose's origin, its axis +z."""

    link: Name
    """The link that carries the sensor."""
    pose: Pose = Pose()
    """Where the sensor stands in its link's frame."""
    aperture: Aperture
    """Full opening angle of the cone [rad], at most a full turn."""
    range: Range = math.inf
    """Largest distance that is read [m]."""
    min_range: Distance = 0.0
    """Distances below this one are read as "too close" [m]."""
    ignore: tuple[Glob, ...] = ()
    """Patterns of the names of links that are not sensed; the sensor's own link never is."""
    signal: LengthSignal | None = None
    """What electronics make of the distance."""

    @model_validator(mode="after")
    def _ranges_in_order(self) -> Self:
        if not self.min_range < self.range:
            raise rejected(f"must be below the range {self.range:.6g} m", at=("min_range",))
        if self.signal is not None and self.signal.low_pass is not None and math.isinf(self.range):
            rule = "needs a finite range of the sensor, which the filter takes while nothing is detected"
            raise rejected(rule, at=("signal", "low_pass"))
        return self


class DistanceMethod(Method):
    """How distance sensors are computed."""

    method: Literal["exact", "rays", "thesis"] = "exact"
    """The exact cone, a bundle of rays, or the thesis's five cases."""
    count: Annotated[StrictInt, Field(ge=1, le=1_000_000)] | None = None
    """Number of rays; only for method rays, 1000 when left out."""
    engine: Literal["own", "embree"] | None = None
    """What casts the rays; only for method rays, own when left out."""

    @model_validator(mode="after")
    def _options_belong(self) -> Self:
        self._belongs("rays", "count", "engine")
        return self

    def options(self) -> dict[str, Any]:
        """See `Method`."""
        if self.method != "rays":
            return {}
        return {"count": 1000 if self.count is None else self.count, "engine": self.engine or "own"}


class DistanceCondition(Part):
    """A distance sensor tells less than a threshold."""

    distance: Name
    """Name of the distance sensor."""
    below: Distance
    """The threshold [m]; what is too close counts as below."""


class DistanceBounds(Part):
    """Bounds of a distance."""

    min: Length | None = None
    """None is below this one [m]."""
    max: Length | None = None
    """None is above this one [m]."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        needs_one(self, "min", "max")
        in_order(self.min, self.max, "m")
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
    measured: DistanceBounds | None = None
    """Bounds of what the sensor's signal chain tells."""

    @model_validator(mode="after")
    def _says_something(self) -> Self:
        needs_one(self, "min", "max", "detected", "measured")
        in_order(self.min, self.max, "m")
        return self
