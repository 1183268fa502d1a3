"""Frames computed as if no guard changed, cut where one does, and computed again from there on."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from replay.collision.columns import Level
from replay.guarding.columns import GuardColumns
from replay.guarding.outcome import GuardOutcomes
from replay.guarding.reaction import Reaction
from replay.kinematics.linkage import LinkPoses
from replay.kinematics.motion import Motion
from replay.numerics.arrays import Flags, Floats
from replay.scenario.guards import SceneGuards
from replay.sensing.readings import KindReadings

if TYPE_CHECKING:
    from replay.collision.pipeline import CollisionPipeline
    from replay.scenario.scene import Scene

LONGEST, SHORTEST = 256, 8
"""Frames that are looked at together: few at first and where a condition comes near its threshold."""

EARLY, GROWTH = 0.7, 4
"""The share of the frames until a condition may hold that are looked at next; at most so many times those before."""


class Guarding:
    """The guards of a scene at work, frame by frame in order.

    Only what guards look at is computed here: the sensors of the kinds they name, and the pairs they name, each frame
    by itself. So results do not depend on how many frames are looked at together.

    Args:
        scene, guards: of the scenario.
        motion: as it is scripted.
        readings: of the scene's sensors by kind.
    """

    def __init__(self, scene: Scene, guards: SceneGuards, motion: Motion, readings: Mapping[str, KindReadings]) -> None:
        self._scene, self._pairs = scene, guards.pairs
        self._readings = {kind: readings[kind] for kind in sorted(guards.watched)}
        self.reaction = Reaction(guards.guards, motion, scene.linkage.joints, guards.leaders)
        self._pipeline = _watching(scene, guards)
        self._step = SHORTEST

    @property
    def motion(self) -> Motion:
        """The motion as it is by all that was decided so far."""
        return self.reaction.motion

    def outcomes(self) -> GuardOutcomes:
        """Return what follows the run and says what became of each trigger."""
        assert self._scene.guards is not None
        return GuardOutcomes(self.reaction, self._scene.linkage.joints, self._scene.guards.moved)

    def restart(self) -> None:
        """Go back to before the first frame."""
        self.reaction.restart()
        self._step = SHORTEST

    def run(self, first: int, last: int) -> tuple[GuardColumns, dict[str, Any], LinkPoses]:
        """Decide frames first..last-1, which follow those decided before.

        Returns:
            Their columns, their readings of the kinds of sensors that guards look at, and their poses.
        """
        parts: dict[str, list[Any]] = {kind: [] for kind in self._readings}
        placed: list[LinkPoses] = []
        begin = first
        while begin < last:
            end = min(begin + self._step, last)
            seconds = self._scene.time_ns(begin, end) / 1e9
            states = self.motion.states(seconds)
            poses = self._scene.linkage.forward(states.positions, states.free_poses)
            columns = {kind: readings.read(poses, begin) for kind, readings in self._readings.items()}

            def told(
                kind: str, column: int, columns: Mapping[str, Any] = columns, begin: int = begin
            ) -> tuple[Floats, Flags]:
                return self._readings[kind].told(columns[kind], column, begin)

            decided = self.reaction.decide(begin, seconds, told, self._clearances(poses))
            for kind, readings in self._readings.items():
                kept = _rows(columns[kind], decided)
                readings.keep(kept, begin)
                parts[kind].append(kept)
            placed.append(poses.slice(0, decided))
            expected = min(EARLY * self.reaction.soonest(), GROWTH * self._step, LONGEST)
            self._step = max(int(expected), SHORTEST)
            begin += decided
        found = {kind: _joined(pieces) for kind, pieces in parts.items()}
        seconds = self._scene.time_ns(first, last) / 1e9
        return self.reaction.columns(seconds), found, LinkPoses.joined(placed)

    def _clearances(self, poses: LinkPoses) -> Floats:
        """Return clearances (n, P) [m] of pairs that guards look at: 0 in contact, inf where beyond all thresholds."""
        frames = len(poses.local)
        clearance = np.full((frames, len(self._scene.pairs)), np.inf)
        for frame in range(frames) if self._pipeline is not None else ():
            assert self._pipeline is not None
            found = self._pipeline.run(poses.slice(frame, frame + 1))  # a frame by itself: nothing is taken from others
            near = np.where(found.evaluated, found.clearance, np.inf)
            clearance[frame, self._pairs] = np.where(found.level == Level.CONTACT, 0.0, near)[0]
        return clearance


def _watching(scene: Scene, guards: SceneGuards) -> CollisionPipeline | None:
    """Return what computes the pairs that guards look at; None where they look at none."""
    if not len(guards.pairs):
        return None
    from replay.collision.pipeline import CollisionPipeline

    version = scene.model.collision
    return CollisionPipeline(
        scene.bodies,
        tuple(scene.pairs[index] for index in guards.pairs),
        scene.linkage,
        bounds=version.bounds,
        narrowphase=version.narrowphase,
        pieces=version.pieces,
        clearance="near" if guards.reach > 0.0 else "never",
        margin=guards.reach,
        savings=scene.savings,
    )


def _rows(columns: Any, count: int) -> Any:
    """Return the first frames of a group of columns."""
    values = {item.name: getattr(columns, item.name) for item in fields(columns)}
    return type(columns)(**{name: None if value is None else value[:count] for name, value in values.items()})


def _joined(parts: list[Any]) -> Any:
    """Return groups of columns as one."""
    if len(parts) == 1:
        return parts[0]
    names = [item.name for item in fields(parts[0])]
    values = {name: [getattr(part, name) for part in parts] for name in names}
    return type(parts[0])(
        **{name: None if value[0] is None else np.concatenate(value) for name, value in values.items()}
    )
