"""Scripted motion as it is written."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, Discriminator, Field, Tag, model_validator

from replay.language.fields import Flag, Name, Part, Placement, Vector, rejected
from replay.language.units import (
    Dimensioned,
    JointAcceleration,
    JointPosition,
    JointVelocity,
    LimitTolerance,
    Share,
    Time,
)

SHORTEST = 1e-9
"""Shortest time between two points [s]: the resolution of recordings, and it keeps polynomials finite."""


class WaypointPart(Part):
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


Positions = Annotated[dict[Name, JointPosition], Field(min_length=1)]
"""Position [rad or m] by joint name."""


def _kind_of_target(value: object) -> str:
    return "pose" if isinstance(value, str) else "joints"


class MovePart(Part):
    """A move from rest to rest by a trapezoidal velocity profile."""

    to: Annotated[
        Annotated[Positions, Tag("joints")] | Annotated[Name, Tag("pose")],
        Discriminator(_kind_of_target),
    ]
    """Target position [rad or m] by joint name, or the name of one of `poses`."""
    start: Time | None = None
    """[s]; when left out, the move starts as soon as the previous move of any of its joints has ended."""
    speed: Share = 1.0
    """Fraction of the joints' velocity and acceleration limits that is used."""
    synchronised: Flag = True
    """Whether all joints arrive together with the slowest."""


class KeyframePart(Placement):
    """Pose of a free link in its joint's frame at one time; between key frames position is linear, rotation slerp."""

    xyz: Vector
    """Position [m]."""
    time: Time
    """[s] from the scenario's start."""


def _increasing(items: tuple[WaypointPart | KeyframePart, ...]) -> tuple[WaypointPart | KeyframePart, ...]:
    for index, (earlier, later) in enumerate(itertools.pairwise(items), start=1):
        if not later.time - earlier.time >= SHORTEST:
            raise rejected(f"must be above the one before, {earlier.time:.6g} s, by 1 ns or more", at=(index, "time"))
    return items


Waypoints = Annotated[tuple[WaypointPart, ...], Field(min_length=1), AfterValidator(_increasing)]
Keyframes = Annotated[tuple[KeyframePart, ...], Field(min_length=1), AfterValidator(_increasing)]


class RecordedJointPart(Part):
    """The joint of a log that moves a joint of the scenario."""

    name: Annotated[str, Field(min_length=1)]
    """What the log calls it."""
    unit: Literal["rad", "deg", "mrad", "m", "cm", "mm", "um", "km", "in"] | None = None
    """Unit of the positions in the log; when left out, the one in brackets in a CSV heading, or rad or m."""


class RecordedFramePart(Part):
    """The frame of a log that moves a free link."""

    child: Annotated[str, Field(min_length=1)] | None = None
    """What the log calls it; the link's name when left out."""
    parent: Annotated[str, Field(min_length=1)] | None = None
    """The frame of the log that stands for the frame of the link's joint; may be left out if the log has one only."""


class TimeColumnPart(Part):
    """The times of a CSV file."""

    column: Annotated[str, Field(min_length=1)] | None = None
    """Heading of the column; `time`, or `time [UNIT]`, when left out."""
    unit: Literal["s", "ms", "us", "ns", "min"] | None = None
    """Its unit; when left out, the one in brackets in its heading, or s. Dates as of ISO 8601 have none."""


class RecordedPart(Part):
    """Joint positions from a log; between samples they are interpolated linearly, outside the ends hold.

    A continuous joint goes the short way round between two samples. What the log holds beyond the scenario's time does
    not matter.
    """

    file: Annotated[str, Field(min_length=1)]
    """A .mcap (of replay, Foxglove or ROS), .csv, ROS 1 .bag or ROS 2 .db3 file, or a ROS 2 bag's folder, inside the
    scenario's folder tree."""
    topic: str | None = None
    """Topic of the joint states in a log of messages; /joint_states when left out, and /tf for transforms."""
    channel: Annotated[int, Field(strict=True, ge=0)] | None = None
    """The only channel (of a bag: connection or topic id) that is read of a topic: one of several publishers."""
    frame_id: str | None = None
    """The only frame_id that is read of joint states: one of several publishers on one channel."""
    time: TimeColumnPart | None = None
    """Column with the times of a .csv file; `time` in seconds when left out."""
    separator: Literal[",", ";", "\t", "|"] | None = None
    """What separates the cells of a .csv file; found in its headings when left out."""
    decimal: Literal[".", ","] | None = None
    """Decimal sign of a .csv file; found in its numbers when left out."""
    joints: dict[Name, RecordedJointPart] = Field(default_factory=dict)
    """The log's joint by joint of the scenario; when left out, the joints that both have under the same name."""
    free: dict[Name, RecordedFramePart] = Field(default_factory=dict)
    """The log's frame by link with a free joint, from transforms (TF)."""
    limit_tolerance: LimitTolerance = Dimensioned(1e-4, None)
    """How far a measured position may be beyond a limit [rad or m], 1e-4 when left out; a note says so."""
    start: Time = 0.0
    """Time [s] after the log's first sample at which the scenario begins."""
    max_gap: Time = 1.0
    """Longest time [s] between two samples that is bridged in a straight line; a longer one is an error."""


class MotionPart(Part):
    """What moves; all other joints hold their initial position."""

    initial: Name | None = None
    """The one of `poses` that its joints begin in; a joint's own `initial` wins."""
    points: dict[Name, Waypoints] = Field(default_factory=dict)
    """Waypoints by joint name."""
    moves: tuple[MovePart, ...] = ()
    """Moves, planned in this order."""
    free: dict[Name, Keyframes] = Field(default_factory=dict)
    """Pose key frames by the name of a free joint."""
    recorded: RecordedPart | None = None
    """Joint positions from a log."""
