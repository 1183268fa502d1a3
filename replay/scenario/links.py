"""Links and the joints that carry them."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from replay.language.fields import Axis, Name, Part, Pose, rejected
from replay.language.units import (
    ANGLE,
    LENGTH,
    Angle,
    Dimensioned,
    Earth,
    JointPosition,
    Length,
    MaxAcceleration,
    MaxAngularAcceleration,
    MaxAngularVelocity,
    MaxVelocity,
    Number,
    Quantity,
)
from replay.scenario.shapes import Shape

AngleLimit = Annotated[float, Quantity("AngleLimit", ANGLE, infinite=True)]
LengthLimit = Annotated[float, Quantity("LengthLimit", LENGTH, infinite=True)]


class JointPart(Part):
    """What all joints have in common."""

    name: Name | None = None
    """Unique among all joints; the link's name when left out."""


class MimicPart(Part):
    """The joint that another one follows: position = multiplier * position of `joint` + offset."""

    joint: Name
    """The joint that leads; it may follow another one itself."""
    multiplier: Number = 1.0
    """How far this joint goes by how far the leader goes; between an angle and a length in rad/m or m/rad."""
    offset: JointPosition = Dimensioned(0.0, None)
    """Position [rad or m] of this joint where that of the leader is 0."""


class FixedPart(JointPart):
    """Does not move."""

    type: Literal["fixed"]


class FreePart(JointPart):
    """Moves by the pose key frames of motion.free."""

    type: Literal["free"]


class AxisPart(JointPart):
    """What all joints have in common that have one position, along or about an axis."""

    type: Literal["revolute", "continuous", "prismatic"]
    axis: Axis = (0.0, 0.0, 1.0)
    """Axis in the joint's frame; it is normalised."""
    initial: float | None = None
    """Position [rad or m] while nothing has moved the joint; when left out, that of the pose `motion.initial`, or the
    one nearest to 0."""
    mimic: MimicPart | None = None
    """The joint that this one follows; nothing else moves it then."""

    @model_validator(mode="after")
    def _leads_or_follows(self) -> Self:
        if self.mimic is not None and self.initial is not None:
            rule = f"has no effect on a joint that follows {self.mimic.joint!r}; remove it"
            raise rejected(rule, at=("initial",))
        return self


class TurningPart(AxisPart):
    """What all joints have in common that turn."""

    type: Literal["revolute", "continuous"]
    initial: Angle | None = None
    """Position [rad] while nothing has moved the joint; when left out, that of the pose `motion.initial`, or the one
    nearest to 0."""
    velocity: MaxAngularVelocity = math.inf
    """Limit of the absolute velocity [rad/s]; moves need one."""
    acceleration: MaxAngularAcceleration = math.inf
    """Limit of the absolute acceleration [rad/s^2]; moves need one."""
    deceleration: MaxAngularAcceleration | None = None
    """Limit of the absolute acceleration while the joint slows down [rad/s^2]; `acceleration` when left out."""


class RevolutePart(TurningPart):
    """Turns about an axis."""

    type: Literal["revolute"]
    lower: AngleLimit = -math.inf
    """Lower position limit [rad]."""
    upper: AngleLimit = math.inf
    """Upper position limit [rad]."""

    @model_validator(mode="after")
    def _within_limits(self) -> Self:
        _check_limits(self, "rad")
        return self


class ContinuousPart(TurningPart):
    """Turns about an axis without position limits."""

    type: Literal["continuous"]


class PrismaticPart(AxisPart):
    """Slides along an axis."""

    type: Literal["prismatic"]
    initial: Length | None = None
    """Position [m] while nothing has moved the joint; when left out, that of the pose `motion.initial`, or the one
    nearest to 0."""
    lower: LengthLimit = -math.inf
    """Lower position limit [m]."""
    upper: LengthLimit = math.inf
    """Upper position limit [m]."""
    velocity: MaxVelocity = math.inf
    """Limit of the absolute velocity [m/s]; moves need one."""
    acceleration: MaxAcceleration = math.inf
    """Limit of the absolute acceleration [m/s^2]; moves need one."""
    deceleration: MaxAcceleration | None = None
    """Limit of the absolute acceleration while the joint slows down [m/s^2]; `acceleration` when left out."""

    @model_validator(mode="after")
    def _within_limits(self) -> Self:
        _check_limits(self, "m")
        return self


def _check_limits(joint: RevolutePart | PrismaticPart, unit: str) -> None:
    if joint.lower > joint.upper:
        raise rejected(f"must not be above the upper limit {joint.upper:.6g} {unit}", at=("lower",))
    if joint.initial is not None and not joint.lower <= joint.initial <= joint.upper:
        between = f"between the limits {joint.lower:.6g} {unit} and {joint.upper:.6g} {unit}"
        raise rejected(f"must be {between}", at=("initial",))


Joint = Annotated[FixedPart | RevolutePart | ContinuousPart | PrismaticPart | FreePart, Field(discriminator="type")]


class LinkPart(Part):
    """A rigid part: what it hangs on, how it moves against that, and the shapes it carries."""

    parent: Name | None = None
    """The link that carries this one; without it the link is the root of a tree and stands in the world."""
    pose: Pose = Pose()
    """Where the joint stands in the parent's frame (or in the world)."""
    joint: Joint = FixedPart(type="fixed")
    """How the link moves in the joint's frame."""
    shapes: dict[Name, Shape] = Field(default_factory=dict)
    """Shapes by name."""
    earth: Earth = math.inf
    """How the link is connected to earth, for the capacitive methods field and bem: grounded, floating, or through a
    capacitance [F] of what is not modelled (shoes, a mattress)."""
