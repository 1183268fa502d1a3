"""A scenario's guards as the simulation knows them: names become columns and indices, times become frames."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from replay.guarding.guard import Combined, Guard, Leaf, PairLeaf, SensorLeaf, SeparationLeaf, leaves, whole_frames
from replay.guarding.part import (
    AllCondition,
    AnyCondition,
    GuardPart,
    PairCondition,
    ReleasePart,
    SeparationCondition,
    sensors_of,
)
from replay.kinematics.linkage import Linkage
from replay.kinematics.motion import Script, joint_profiles
from replay.kinematics.profiles import Profile
from replay.language.fields import Part
from replay.scenario.expectation_check import matching_pairs
from replay.scenario.layout import Layout
from replay.sensing.kinds import KINDS
from replay.sensing.signal.chain import Signals


@dataclass(frozen=True, eq=False)
class SceneGuards:
    """The guards of a scene.

    Attributes:
        guards: sorted by name.
        watched: names of the sensors that they look at, by kind.
        pairs: indices of the pairs that they look at, ascending: the columns of their conditions.
        reach: clearances of these are needed up to this one [m]; 0 where contacts are all that is asked for.
        moved: of each guard, the indices of the pairs that its joints move.
        leaders: of each joint with a position, the index of the one that it follows; its own if it follows none.
    """

    guards: tuple[Guard, ...]
    watched: Mapping[str, frozenset[str]]
    pairs: NDArray[np.intp]
    reach: float
    moved: tuple[NDArray[np.int64], ...]
    leaders: tuple[int, ...]


def scene_guards(
    written: Mapping[str, GuardPart],
    rate: Fraction,
    machine: Linkage,
    script: Script,
    layout: Layout,
    signals: Mapping[str, Signals],
) -> SceneGuards | None:
    """Return the guards of a scene; None when there are none.

    Args:
        written: by name.
        rate: of frames [Hz].
        machine, script: of the scene.
        layout: the names behind its columns.
        signals: chains of its sensors.
    """
    if not written:
        return None
    making = _Making(rate, machine, joint_profiles(machine, script), layout, signals)
    guards = tuple(making.guard(name, part) for name, part in sorted(written.items()))
    found = [leaf for guard in guards for leaf in leaves(guard.when)]
    inner = [leaf.sensor or leaf.pairs if isinstance(leaf, SeparationLeaf) else leaf for leaf in found]
    sensors = [leaf for leaf in inner if isinstance(leaf, SensorLeaf)]
    reach = [leaf.released for leaf in inner if isinstance(leaf, PairLeaf)]
    names = machine.joint_names
    return SceneGuards(
        guards=guards,
        watched={
            kind: frozenset(layout.sensors[kind][leaf.column] for leaf in sensors if leaf.kind == kind)
            for kind in {leaf.kind for leaf in sensors}
        },
        pairs=making.pairs,
        reach=max(reach, default=0.0),
        moved=tuple(moved_pairs(machine, layout.pairs, guard.joints) for guard in guards),
        leaders=tuple(
            names.index(machine.followers[name].joint if name in machine.followers else name) for name in names
        ),
    )


def moved_pairs(machine: Linkage, pairs: Sequence[str], joints: Sequence[int]) -> NDArray[np.int64]:
    """Return the indices of pairs "link/shape|link/shape" that move when some joints, by index, or followers do."""
    named = {machine.joint_names[joint] for joint in joints}
    named |= {name for name, mimic in machine.followers.items() if mimic.joint in named}
    found, known = [], {}
    for index, pair in enumerate(pairs):
        links = tuple(side.partition("/")[0] for side in pair.split("|"))
        if links not in known:
            chains = machine.chains_to_common_ancestor(*(machine.link_index(link) for link in links))
            known[links] = any(machine.links[k].joint.name in named for chain in chains for k in chain)
        if known[links]:
            found.append(index)
    return np.array(found, dtype=np.int64)


class _Making:
    """Makes guards, and collects the pairs that they look at."""

    def __init__(
        self,
        rate: Fraction,
        machine: Linkage,
        profiles: Mapping[str, Profile],
        layout: Layout,
        signals: Mapping[str, Signals],
    ) -> None:
        self._rate, self._machine, self._profiles, self._layout, self._signals = (
            rate,
            machine,
            profiles,
            layout,
            signals,
        )
        self.pairs: NDArray[np.intp] = np.zeros(0, dtype=np.intp)

    def guard(self, name: str, part: GuardPart) -> Guard:
        index = {joint: k for k, joint in enumerate(self._machine.joint_names)}
        joints = tuple(sorted(index[joint] for joint in part.joints))
        limits = [self._machine.joints[joint] for joint in joints]
        written = {joint: value.value for joint, value in part.deceleration.items()}
        deceleration = tuple(written.get(limit.name, limit.braking) for limit in limits)
        release = part.release if isinstance(part.release, ReleasePart) else None
        signs = {"positive": 1, "negative": -1}
        return Guard(
            name=name,
            when=self._condition(part, part.when, joints, deceleration),
            directions=tuple((index[joint], signs[way]) for joint, way in sorted(part.direction.items())),
            hold_frames=whole_frames(Fraction(part.for_), self._rate),
            reaction=part.reaction,
            target=0.0 if part.slow is None else part.slow.to,
            joints=joints,
            deceleration=deceleration,
            acceleration=tuple(limit.acceleration for limit in limits),
            release_frames=None if release is None else whole_frames(Fraction(release.after), self._rate),
        )

    def _condition(
        self, part: GuardPart, when: Part, joints: tuple[int, ...], deceleration: tuple[float, ...]
    ) -> Leaf | Combined:
        if isinstance(when, AnyCondition | AllCondition):
            inner = when.any if isinstance(when, AnyCondition) else when.all
            parts = tuple(self._condition(part, condition, joints, deceleration) for condition in inner)
            return Combined(parts, all=isinstance(when, AllCondition))
        hysteresis = 0.0
        if isinstance(part.release, ReleasePart) and part.release.hysteresis is not None:
            hysteresis = part.release.hysteresis.value
        if isinstance(when, PairCondition):
            below = 0.0 if when.clearance is None else when.clearance.below
            return self._pairs(when.pair, below, 0.0 if when.clearance is None else below + hysteresis)
        if isinstance(when, SeparationCondition):
            return self._separation(part, when, joints, deceleration, hysteresis)
        for kind in KINDS.values():
            if kind.output is not None and isinstance(when, kind.output.condition):
                below = kind.output.threshold(when)
                return self._sensor(kind.name, getattr(when, kind.name), below, below + hysteresis)
        raise AssertionError(f"{type(when).__name__} is no condition")

    def _sensor(self, kind: str, name: str, below: float, released: float) -> SensorLeaf:
        return SensorLeaf(kind, self._layout.sensors[kind].index(name), below, released)

    def _pairs(self, patterns: tuple[str, str], below: float, released: float) -> PairLeaf:
        mine = matching_pairs(self._layout.pairs, patterns)
        self.pairs = np.union1d(self.pairs, mine).astype(np.intp)
        return PairLeaf(mine, below, released)

    def _separation(
        self,
        part: GuardPart,
        when: SeparationCondition,
        joints: tuple[int, ...],
        deceleration: tuple[float, ...],
        hysteresis: float,
    ) -> SeparationLeaf:
        written, lag = when.separation, 1.0
        sensor = pairs = None
        for kind, name in sensors_of(when):
            sensor = self._sensor(kind, name, 0.0, 0.0)
            if kind in self._signals and sensor.column in self._signals[kind].chains:
                lag = self._signals[kind].chains[sensor.column].lag
        reaction = float(part.for_) + lag / float(self._rate) + part.reaction
        fastest = [self._profiles[self._machine.joint_names[joint]].fastest(0.0, np.inf) for joint in joints]
        slowest = max(speed / limit for speed, limit in zip(fastest, deceleration, strict=True))
        constant = written.C + written.K * reaction
        largest = constant + written.K * slowest
        if written.pair is not None:
            pairs = self._pairs(written.pair, largest, largest + hysteresis)
        return SeparationLeaf(sensor, pairs, written.K, constant, hysteresis, largest)
