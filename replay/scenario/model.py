"""The whole language: what a scenario file may hold."""

from __future__ import annotations

import math
from fractions import Fraction
from typing import Annotated, Final, Literal, Self

from pydantic import BeforeValidator, Field, PrivateAttr, StringConstraints, model_validator

from replay.guarding.part import GuardPart
from replay.language.fields import Name, Part, Text, Title, rejected
from replay.language.units import Dimensioned, Duration, Rate
from replay.scenario.collision import CollisionPart
from replay.scenario.expectations import BetweenPart, Expectation, PairExpectation
from replay.scenario.links import LinkPart
from replay.scenario.measured import MeasuredPart
from replay.scenario.methods import Model, builtin_model
from replay.scenario.motion import MotionPart, MovePart, Positions
from replay.scenario.sensors import Sensors
from replay.scenario.source import ScenarioProvenance
from replay.scenario.sweep import SweepPart

MAX_FRAMES: Final = 100_000_000

Label = Annotated[str, StringConstraints(pattern=r"^[^\s,:/]+$", max_length=100)]


class Fragment(Part):
    """What an included file may hold."""

    include: tuple[Annotated[str, StringConstraints(min_length=1)], ...] = ()
    """Files whose parts are merged in; paths relative to this file, inside the scenario's folder tree."""
    links: dict[Name, LinkPart] = Field(default_factory=dict)
    """Links by name."""
    poses: dict[Name, Positions] = Field(default_factory=dict)
    """Joint positions by the name of a pose, for `motion.initial` and the `to` of moves."""
    motion: MotionPart = MotionPart()
    """What moves."""
    collision: CollisionPart = CollisionPart()
    """What is tested for collision."""
    sensors: Sensors = Sensors()
    """Sensors."""
    guards: dict[Name, GuardPart] = Field(default_factory=dict)
    """Rules that slow and stop the motion."""
    model: Annotated[Model, BeforeValidator(builtin_model)] = Model()
    """The version of each method, or the name of a built-in model."""
    expect: tuple[Expectation, ...] = ()
    """What must hold of the results."""


class Scenario(Fragment):
    """A scene, its scripted motion, its sensors, and what is computed of them."""

    version: Literal[1]
    """1, the version of this language."""
    name: Title
    """Names the recording."""
    description: Text = ""
    """What the scenario shows."""
    tags: tuple[Label, ...] = ()
    """Labels to select scenarios by."""
    rate: Rate
    """Frames per second [Hz]."""
    duration: Duration
    """Length [s]; frames are at k/rate for k = 0..floor(duration*rate)."""
    measured: MeasuredPart | None = None
    """A log of the real machine that the signals are compared with."""
    sweep: SweepPart | None = None
    """Cases that replace some values of this scenario."""
    _provenance: ScenarioProvenance = PrivateAttr(default_factory=ScenarioProvenance)

    @model_validator(mode="after")
    def _few_enough_frames(self) -> Self:
        if self.frames > MAX_FRAMES:
            raise rejected(f"makes {self.frames} frames; at most {MAX_FRAMES} are computed", at=("duration",))
        return self

    @model_validator(mode="after")
    def _windows_begin_in_time(self) -> Self:
        for index, expected in enumerate(self.expect):
            window = expected.contact if isinstance(expected, PairExpectation) else None
            if isinstance(window, BetweenPart) and window.between[0] > self.duration:
                end = f"{float(self.duration):.6g} s"
                raise rejected(f"is after the scenario's end at {end}", at=("expect", index, "contact", "between", 0))
        return self

    @property
    def frames(self) -> int:
        """Number of frames: floor(duration*rate) + 1, in exact arithmetic."""
        return math.floor(Fraction(self.duration) * Fraction(self.rate)) + 1

    def target(self, move: MovePart) -> dict[str, Dimensioned]:
        """Return the target position of each joint of a move, as it is written there or in the pose it names."""
        return self.poses.get(move.to, {}) if isinstance(move.to, str) else move.to

    @property
    def sources(self) -> dict[str, bytes]:
        """Every file the scenario needs, by its path relative to the scenario's folder, or package:// name."""
        return self._provenance.sources

    @property
    def sha256(self) -> dict[str, str]:
        """The SHA-256 of each source, in hexadecimal."""
        return self._provenance.sha256

    @property
    def main_source(self) -> str:
        """The name in `sources` of the scenario file itself."""
        return self._provenance.main

    @property
    def provenance(self) -> ScenarioProvenance:
        """Where everything was read."""
        return self._provenance
