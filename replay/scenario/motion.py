"""Scripted motion as it is written."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Field, model_validator

from replay.scenario.fields import Flag, Name, Part, Placement, Vector, rejected
from replay.scenario.units import JointAcceleration, JointPosition, JointVelocity, Share, Time

SHORTEST = 1e-9
"""Shortest time between two points [s]: the resolution of recordings, and it keeps polynomials finite."""


class Waypoint(Part):
    """What a joint passes at one time; an interval is linear, cubic or quintic, as far as both its ends go."""

    time: Time
    """[s] from the scenario's start."""
    position: JointPosition
    """[rad] or [m], by the joint's type."""
    velocity: JointVelocity | None = None
    """[rad/s] or [m/s]."""
    acceleration: JointAcceleration | None = None
    """[rad/s^2] or [m/s^2]; needs a velocity."""

    @model_validator(mode="after")
    def _acceleration_needs_velocity(self) -> Self:
        if self.acceleration is not None and self.velocity is None:
            raise rejected("needs a velocity beside it", at=("acceleration",))
        return self


class Move(Part):
    """A move from rest to rest by a trapezoidal velocity profile."""

    to: Annotated[dict[Name, JointPosition], Field(min_length=1)]
    """Target position [rad or m] by joint name."""
    start: Time | None = None
    """[s]; when left out, the move starts as soon as the previous move of any of its joints has ended."""
    speed: Share = 1.0
    """Fraction of the joints' velocity and acceleration limits that is used."""
    synchronised: Flag = True
    """Whether all joints arrive together with the slowest."""


class Keyframe(Placement):
    """Pose of a free link in its joint's frame at one time; between key frames position is linear, rotation slerp."""

    xyz: Vector
    """Position [m]."""
    time: Time
    """[s] from the scenario's start."""


def _increasing(items: tuple[Waypoint | Keyframe, ...]) -> tuple[Waypoint | Keyframe, ...]:
    for index, (earlier, later) in enumerate(itertools.pairwise(items), start=1):
        if not later.time - earlier.time >= SHORTEST:
            raise rejected(f"must be above the one before, {earlier.time:.6g} s, by 1 ns or more", at=(index, "time"))
    return items


Waypoints = Annotated[tuple[Waypoint, ...], Field(min_length=1), AfterValidator(_increasing)]
Keyframes = Annotated[tuple[Keyframe, ...], Field(min_length=1), AfterValidator(_increasing)]


class RecordedJoint(Part):
    """The joint of a log that moves a joint of the scenario."""

    name: Annotated[str, Field(min_length=1)]
    """What the log calls it."""
    unit: Literal["rad", "deg", "mrad", "m", "cm", "mm", "um", "km", "in"] | None = None
    """Unit of the positions in the log; rad or m when left out."""


class TimeColumn(Part):
    """The times of a CSV file."""

    column: Annotated[str, Field(min_length=1)] = "time"
    """Heading of the column."""
    unit: Literal["s", "ms", "us", "min"] = "s"
    """Its unit."""


class Recorded(Part):
    """Joint positions from a log; between samples they are interpolated linearly, outside the ends hold."""

    file: Annotated[str, Field(min_length=1)]
    """A .mcap (of replay, Foxglove or ROS 2) or .csv file inside the scenario's folder tree."""
    topic: str | None = None
    """Topic of the joint states in a .mcap file; /joint_states when left out."""
    time: TimeColumn | None = None
    """Column with the times of a .csv file; `time` in seconds when left out."""
    joints: dict[Name, RecordedJoint] = Field(default_factory=dict)
    """The log's joint by joint of the scenario; when left out, the joints that both have under the same name."""
    start: Time = 0.0
    """Time [s] after the log's first sample at which the scenario begins."""
    max_gap: Time = 1.0
    """Longest time [s] between two samples that is bridged in a straight line; a longer one is an error."""


class Motion(Part):
    """What moves; all other joints hold their initial position."""

    points: dict[Name, Waypoints] = Field(default_factory=dict)
    """Waypoints by joint name."""
    moves: tuple[Move, ...] = ()
    """Moves, planned in this order."""
    free: dict[Name, Keyframes] = Field(default_factory=dict)
    """Pose key frames by the name of a free joint."""
    recorded: Recorded | None = None
    """Joint positions from a log."""
