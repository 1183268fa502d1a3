"""Scenario in, stream of frame blocks out: no files, no clock, no globals."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from replay.collision.columns import CollisionColumns
from replay.guarding.columns import GuardColumns
from replay.numerics import transforms
from replay.numerics.arrays import Flags, Floats, Integers
from replay.scenario.layout import Layout
from replay.sensing.kinds import KINDS, of_kind
from replay.sensing.readings import KindReadings

if TYPE_CHECKING:
    from replay.collision.pipeline import CollisionPipeline
    from replay.guarded import Guarding
    from replay.kinematics.linkage import LinkPoses
    from replay.kinematics.motion import Motion
    from replay.scenario.methods import Model
    from replay.scenario.model import Scenario
    from replay.scenario.scene import Scene
    from replay.sensing.kind import Suite

__all__ = ["BLOCK_FRAMES", "FrameBlock", "Layout", "Simulation", "block_frames", "simulate"]


BLOCK_FRAMES = 256
"""Most frames per block."""

PAIR_FRAMES = 1 << 21
"""Most pairs times frames of a block: results are 20 bytes each, 40 MiB, and up to four blocks are held."""


def block_frames(pairs: int) -> int:
    """Return how many frames the blocks of a scene have; recorded."""
    return max(1, min(BLOCK_FRAMES, PAIR_FRAMES // max(pairs, 1)))


@dataclass(frozen=True, eq=False)
class FrameBlock:
    """n consecutive frames: poses, and one group of columns for each thing that the scene asks for.

    Attributes:
        layout: the names behind the columns.
        first: index of the block's first frame.
        time: (n,) int64 nanoseconds from the scenario's start.
        joint_positions: (n, J) [rad or m].
        joint_velocities: (n, J) [rad/s or m/s].
        link_poses: (n, L, 4, 4), T_world_link.
        collision: None when the scene tests no pair.
        readings: columns of the sensors by kind, also by name as `block.distance`, None when there are none.
        guards: None when there are none.
    """

    layout: Layout
    first: int
    time: Integers
    joint_positions: Floats
    joint_velocities: Floats
    link_poses: Floats
    collision: CollisionColumns | None
    readings: Mapping[str, Any] = field(default_factory=dict)
    guards: GuardColumns | None = None

    def __getattr__(self, kind: str) -> Any:
        return of_kind(self, kind, "readings")

    @cached_property
    def link_quaternions(self) -> Floats:
        """The rotations of `link_poses` as unit quaternions (n, L, 4) xyzw, w >= 0."""
        return transforms.to_quaternion(self.link_poses)


class Simulation:
    """A scene with everything that is computed once, ready to answer block after block.

    Args:
        scene: see `scenario.scene.build`.

    Raises:
        MissingPackageError: the model names an engine that is not installed.
        MotionLimitError: the script breaks a limit.
    """

    def __init__(self, scene: Scene) -> None:
        from replay.kinematics.motion import plan

        self.scene = scene
        self._block_frames = block_frames(len(scene.pairs))
        self._motion = plan(scene.linkage, scene.script)
        self._proven = scene.model.collision.between == "proven"
        self.collision = collision_pipeline(scene, self._motion if self._proven else None) if scene.pairs else None
        self.suites: dict[str, Suite] = {
            kind: KINDS[kind].suite(
                sensors,
                scene.targets,
                getattr(scene.model, kind),
                savings=scene.savings,
                watched=scene.guards.watched.get(kind, frozenset()) if scene.guards else frozenset(),
            )
            for kind, sensors in scene.sensors.items()
            if sensors
        }
        self._readings = {
            kind: KindReadings(KINDS[kind], suite, scene.signals.get(kind)) for kind, suite in self.suites.items()
        }
        self.guarding: Guarding | None = None
        if scene.guards is not None:
            from replay.guarded import Guarding

            self.guarding = Guarding(scene, scene.guards, self._motion, self._readings)
        self._remembers = bool(scene.signals) or scene.guards is not None
        self._next = 0

    def __getattr__(self, kind: str) -> Any:
        return of_kind(self, kind, "suites")

    def block(self, first: int) -> FrameBlock:
        """Return the block that begins at a frame, the first of a block.

        It depends on no other block; but where sensors have signal chains, or there are guards, those before it are
        computed first, unless the last one asked for was the one before it.
        """
        if self._remembers and first != self._next:
            for readings in self._readings.values():
                readings.restart()
            if self.guarding is not None:
                self.guarding.restart()
            for earlier in range(0, first, self._block_frames):
                self._block(earlier)
        return self._block(first)

    def _block(self, first: int) -> FrameBlock:
        last = min(first + self._block_frames, self.scene.frames)
        lead = min(first, 1) if self._proven else 0  # what is between this block and the last one belongs to this one
        guards: GuardColumns | None = None
        known: dict[str, Any] = {}
        placed: LinkPoses | None = None
        if self.guarding is not None:
            guards, known, placed = self.guarding.run(first, last)
            self._motion = self.guarding.motion
            if self.collision is not None:
                self.collision.follow(self._motion)
        time = self.scene.time_ns(first - lead, last)
        states = self._motion.states(time / 1e9)
        if placed is None:
            poses = self.scene.linkage.forward(states.positions, states.free_poses)
        else:  # what guards were decided by
            head = self.scene.linkage.forward(states.positions[:lead], states.free_poses[:lead])
            poses = head.joined([head, placed])
        shown = poses.slice(lead, len(time))
        self._next = last
        return FrameBlock(
            layout=self.scene.layout,
            first=first,
            time=time[lead:],
            joint_positions=states.positions[lead:],
            joint_velocities=states.velocities[lead:],
            link_poses=shown.world,
            collision=self.collision.run(poses, lead=lead, time=time, first=first) if self.collision else None,
            readings={
                kind: known[kind] if kind in known else self._read(kind, shown, first) for kind in self._readings
            },
            guards=guards,
        )

    def _read(self, kind: str, poses: LinkPoses, first: int) -> Any:
        columns = self._readings[kind].read(poses, first)
        self._readings[kind].keep(columns, first)
        return columns

    def blocks(self) -> Iterator[FrameBlock]:
        """Yield all blocks in order."""
        for first in range(0, self.scene.frames, self._block_frames):
            yield self.block(first)


def simulate(
    scenario: Scenario, *, model: Model | str | Path | None = None, savings: bool = True
) -> Iterator[FrameBlock]:
    """Yield a scenario's frames in blocks of `block_frames`, the last one shorter.

    Args:
        scenario: what `replay.load` returned.
        model: replaces the scenario's own model; a built-in model's name, or a file that holds one, will do.
        savings: False computes every pair, sensor and triangle anew in every frame, as a check of all that is left out
            otherwise; it takes many times as long.

    Raises:
        ScenarioError: a mesh cannot be used, or an expectation is about a pair that is not tested.
        MotionLimitError: the script breaks a limit.
        MissingPackageError: the model names an engine that is not installed.

    Accuracy: of the methods that the model names; the same numbers on every run, whatever the block is computed by.
    Without savings all columns are the same bit for bit (tests/test_savings.py), except clearances, which are the same
    within their stated accuracy, and capacitances of method "tree", whose place the exact sum takes: within `rtol`.
    """
    from replay.scenario.scene import build

    yield from Simulation(build(scenario, model=model, savings=savings)).blocks()


def touching(scene: Scene, positions: Floats, free_poses: Floats) -> Iterator[Flags]:
    """Yield which pairs are in contact in any states of the joints, in blocks (k, P).

    Args:
        scene: whose pairs they are, in the order of its layout.
        positions: (n, J) [rad or m], in the order of its linkage's joints.
        free_poses: (n, K, 4, 4), of its free joints.
    """
    from replay.collision.columns import Level

    if not scene.pairs:
        return
    collision = collision_pipeline(scene, None)
    for first in range(0, len(positions), BLOCK_FRAMES):
        chosen = slice(first, first + BLOCK_FRAMES)
        yield collision.run(scene.linkage.forward(positions[chosen], free_poses[chosen])).level == Level.CONTACT


def touching_first(scene: Scene) -> tuple[str, ...]:
    """Return the names of the pairs that are in contact in the first frame."""
    from replay.kinematics.motion import sample

    states = sample(scene.linkage, scene.script, scene.seconds(0, 1))
    found = touching(scene, states.positions, states.free_poses)
    return tuple(name for flags in found for name, met in zip(scene.layout.pairs, flags[0], strict=True) if met)


def collision_pipeline(scene: Scene, motion: Motion | None) -> CollisionPipeline:
    """Return what computes the pairs of a scene that tests any; without its motion, at the frames alone."""
    from replay.collision.pipeline import CollisionPipeline

    version = scene.model.collision
    return CollisionPipeline(
        scene.bodies,
        scene.pairs,
        scene.linkage,
        bounds=version.bounds,
        narrowphase=version.narrowphase,
        pieces=version.pieces,
        clearance=version.clearance,
        margin=scene.margin,
        savings=scene.savings,
        motion=motion,
    )
