"""One model of ours on one scene, on any frames, with the time of every stage."""

from __future__ import annotations

import math
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from replay.collision.columns import Level
from replay.collision.engines import NarrowPhase
from replay.collision.pair_frames import PairFrames
from replay.kinematics.linkage import LinkPoses
from replay.kinematics.motion import sample
from replay.numerics.arrays import Flags, Floats, Integers
from replay.recording.record import record_blocks
from replay.scenario.layout import Layout
from replay.scenario.methods import Model
from replay.scenario.model import Scenario
from replay.scenario.scene import build
from replay.sensing.kinds import KINDS
from replay.simulation import BLOCK_FRAMES, FrameBlock, Simulation

_RECORDINGS = 7
"""How often frames are recorded: libraries are loaded on the first use, and a file takes its time now and then."""


@dataclass(frozen=True, eq=False)
class Readings:
    """What n frames say: contacts (n, P), distances (n, D) [m] with NaN for nothing, capacitances (n, C) [F]."""

    contact: Flags
    distance: Floats
    capacitance: Floats

    def of(self, frames: slice) -> Readings:
        """Return those of some frames."""
        return Readings(self.contact[frames], self.distance[frames], self.capacitance[frames])


class Runner:
    """One model of ours on a scene with pairs and both kinds of sensors.

    Attributes:
        simulation: what is run.
        layout: the names behind the readings.
        seconds: spent by stage in the last run.
    """

    def __init__(self, scenario: Scenario, model: Model, *, savings: bool = True) -> None:
        self.simulation = Simulation(build(scenario, model=model, savings=savings))
        scene = self.simulation.scene
        self.layout: Layout = scene.layout
        self._states = sample(scene.linkage, scene.script, scene.seconds(0, scene.frames))
        self.seconds: dict[str, float] = {}
        self._narrow = 0.0
        assert self.simulation.collision is not None
        self.simulation.collision.narrow_phase = self._timed(self.simulation.collision.narrow_phase)

    def poses(self, frames: Sequence[int]) -> LinkPoses:
        """Return the link poses of some frames."""
        chosen = list(frames)
        return self.simulation.scene.linkage.forward(self._states.positions[chosen], self._states.free_poses[chosen])

    def run(self, frames: Sequence[int]) -> Readings:
        """Return the readings of some frames, in blocks as a run has them."""
        blocks = self.blocks(frames)
        return Readings(
            np.concatenate([block["collision"].level == Level.CONTACT for block in blocks]),
            np.concatenate([block["distance"].distance for block in blocks]),
            np.concatenate([block["capacitive"].capacitance for block in blocks]),
        )

    def blocks(self, frames: Sequence[int]) -> list[dict[str, Any]]:
        """Return poses and columns of some frames by stage, in blocks as a run has them."""
        self._narrow = 0.0
        stages: Any = self.simulation
        spent = dict.fromkeys(("kinematics", "collision", "distance", "capacitive"), 0.0)
        blocks = []
        for k in range(0, len(frames), BLOCK_FRAMES):
            begin = time.perf_counter()
            poses = self.poses(frames[k : k + BLOCK_FRAMES])
            found: dict[str, Any] = {"kinematics": poses}
            for name in spent:
                if name != "kinematics":
                    found[name] = getattr(stages, name).run(poses)
                end = time.perf_counter()
                spent[name] += end - begin
                begin = end
            blocks.append(found)
        collision = spent.pop("collision")
        kinematics = spent.pop("kinematics")
        self.seconds = {
            "kinematics": kinematics,
            "broad phase": collision - self._narrow,
            "narrow phase": self._narrow,
            **spent,
        }
        return blocks

    def sensor_seconds(self, frames: Sequence[int]) -> dict[str, float]:
        """Return what each sensor takes when it is the only one [s]."""
        scene = self.simulation.scene
        model = scene.model
        suites: dict[str, Any] = {
            sensor.name: KINDS[kind].suite([sensor], scene.targets, getattr(model, kind), savings=True)
            for kind, sensors in scene.sensors.items()
            for sensor in sensors
        }
        blocks = [self.poses(frames[k : k + BLOCK_FRAMES]) for k in range(0, len(frames), BLOCK_FRAMES)]
        spent = {}
        for name, suite in suites.items():
            begin = time.perf_counter()
            for poses in blocks:
                suite.run(poses)
            spent[name] = time.perf_counter() - begin
        return spent

    def recording(self, frames: Sequence[int]) -> float:
        """Return how long it takes to record some frames that are computed already, MCAP and rerun, at best [s]."""
        scene, chosen = self.simulation.scene, list(frames)
        time_ns = scene.time_ns(0, scene.frames)[chosen]
        blocks = []
        for first, found in zip(range(0, len(chosen), BLOCK_FRAMES), self.blocks(frames), strict=True):
            part = slice(first, first + BLOCK_FRAMES)
            states = self._states
            blocks.append(
                FrameBlock(
                    layout=self.layout,
                    first=first,
                    time=time_ns[part],
                    joint_positions=states.positions[chosen[part]],
                    joint_velocities=states.velocities[chosen[part]],
                    link_poses=found["kinematics"].world,
                    collision=found["collision"],
                    readings={kind: found[kind] for kind in self.simulation.suites},
                )
            )
        spent = math.inf
        for _ in range(_RECORDINGS):
            with tempfile.TemporaryDirectory() as folder:
                begin = time.perf_counter()
                record_blocks(scene, blocks, folder)
                spent = min(spent, time.perf_counter() - begin)
        return spent

    def _timed(self, narrow_phase: NarrowPhase) -> NarrowPhase:
        def decide(frames: PairFrames, limit: float, counts: Integers) -> None:
            begin = time.perf_counter()
            narrow_phase(frames, limit, counts)
            self._narrow += time.perf_counter() - begin

        return decide
