"""What guards made of a run: how they reacted, how far joints went until they stopped, how near bodies came."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from replay.collision.columns import Between, CollisionColumns, Level
from replay.guarding.acceleration import excesses, peak
from replay.guarding.guard import Guard
from replay.guarding.reaction import Episode, Reaction
from replay.kinematics.linkage import Joint
from replay.kinematics.motion import Motion
from replay.numerics.arrays import Floats, Integers


@dataclass(frozen=True)
class JointStop:
    """How a joint was stopped, or slowed down.

    Attributes:
        joint: its name, and `unit` that of its positions.
        reaction_distance: way from the trigger until braking began [unit].
        stopping_distance: way from the trigger until it held; of what it braked, the larger one of what the clock made
            of it and of (v^2 - w^2) / 2d from its speed v to w [unit].
        speed: when braking began [unit/s].
        peak_acceleration: the largest one from the trigger until it held, script and guard together [unit/s^2].
        excess: by how much that is above the joint's limit, as a factor; 1 where it never is.
        at_rest: whether it stood when it held.
    """

    joint: str
    unit: str
    reaction_distance: float
    stopping_distance: float
    speed: float
    peak_acceleration: float
    excess: float
    at_rest: bool


@dataclass
class Stop:
    """What became of one trigger; times [s], None of what did not come before the end.

    Attributes:
        guard: its name.
        trigger, held, released: when.
        joints: of the guard; none if it did not come to hold.
        clearance: smallest one of the pairs that its joints move, from the trigger until they go on [m], proven between
            frames; inf where it was never near. `clearance_at_stop` in the first frame in which they hold, 0 if they
            met before.
        contact: when they first met after the trigger, and `contact_speed` how fast the joints were then.
    """

    guard: str
    trigger: float
    held: float | None
    released: float | None
    joints: tuple[JointStop, ...]
    clearance: float = math.inf
    clearance_at_stop: float | None = None
    contact: float | None = None
    contact_speed: dict[str, float] = field(default_factory=dict)

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values: what is infinite is None."""
        values = dict(vars(self))
        values["joints"] = [vars(joint) for joint in self.joints]
        for name in ("clearance", "clearance_at_stop"):
            values[name] = None if values[name] is None or math.isinf(values[name]) else values[name]
        values["stopping_time"] = None if self.held is None else self.held - self.trigger
        return values


class GuardOutcomes:
    """Follows a run with guards, block by block, and says what became of each trigger.

    Args:
        reaction: what the guards do.
        joints: with a position, in order.
        moved: of each guard, the columns of the pairs that its joints move.
    """

    def __init__(self, reaction: Reaction, joints: Sequence[Joint], moved: Sequence[Integers]) -> None:
        self._reaction, self._joints, self._moved = reaction, tuple(joints), tuple(moved)
        self._seconds: list[Floats] = []
        self._least: list[list[Floats]] = [[] for _ in moved]
        self._at_frame: list[list[Floats]] = [[] for _ in moved]
        self._met: list[list[float]] = [[] for _ in moved]

    def update(self, time_ns: Integers, collision: CollisionColumns | None) -> None:
        """Take the results of the next frames, at times (n,) [ns]."""
        seconds = time_ns / 1e9
        self._seconds.append(seconds)
        for g, pairs in enumerate(self._moved):
            least, shown, met = _nearness(seconds, collision, pairs)
            self._least[g].append(least)
            self._at_frame[g].append(shown)
            self._met[g].extend(met)

    def stops(self) -> list[Stop]:
        """Return what became of each trigger, in the order of time."""
        seconds = np.concatenate([np.zeros(0), *self._seconds])
        end = float(seconds[-1]) if len(seconds) else 0.0
        return [self._stop(item, seconds, end) for item in self._reaction.episodes()]

    def _stop(self, item: Episode, seconds: Floats, end: float) -> Stop:
        g = item.guard
        guard, motion = self._reaction.guards[g], self._reaction.motion
        held = item.hold if item.hold <= end else None
        last = min(item.release, end)
        joints = () if held is None else tuple(self._joint(guard, k, item, motion) for k in range(len(guard.joints)))
        stop = Stop(guard.name, item.trigger, held, item.release if item.release <= end else None, joints)
        least = np.concatenate([np.zeros(0), *self._least[g]])
        after = (seconds > item.trigger) & (seconds <= last)
        stop.clearance = float(np.min(least[after], initial=math.inf))
        met = sorted(time for time in self._met[g] if item.trigger <= time <= last)
        if met:
            stop.contact = met[0]
            speeds = np.abs(motion.states(np.array([met[0]])).velocities[0])
            stop.contact_speed = {self._joints[joint].name: float(speeds[joint]) for joint in guard.joints}
        if held is not None:
            standing = np.flatnonzero(seconds >= held)
            if met and met[0] <= held:
                stop.clearance_at_stop = 0.0
            elif len(standing):
                stop.clearance_at_stop = float(np.concatenate([np.zeros(0), *self._at_frame[g]])[standing[0]])
        return stop

    def _joint(self, guard: Guard, k: int, item: Episode, motion: Motion) -> JointStop:
        index = guard.joints[k]
        joint, profile, clock = self._joints[index], motion.profiles[index], motion.clocks[index]
        places = [clock.at(time)[0] for time in (item.trigger, item.brake, item.hold)]
        reaction, braking = profile.length(*places[:2]), profile.length(*places[1:])
        at = motion.states(np.array([item.brake, item.hold])).velocities[:, index]
        speed, rest = abs(float(at[0])), abs(float(at[1]))
        straight = max(speed**2 - rest**2, 0.0) / (2.0 * guard.deceleration[k])
        found = excesses(joint, profile, clock, item.trigger, item.hold)
        return JointStop(
            joint=joint.name,
            unit=joint.type.unit,
            reaction_distance=reaction,
            stopping_distance=reaction + max(braking, straight),
            speed=speed,
            peak_acceleration=peak(profile, clock, item.trigger, item.hold)[1],
            excess=max((excess.acceleration / excess.limit for excess in found), default=1.0),
            at_rest=rest == 0.0,
        )


def _nearness(
    seconds: Floats, collision: CollisionColumns | None, pairs: Integers
) -> tuple[Floats, Floats, list[float]]:
    """Return (n,) smallest clearances of pairs since the frame before and in frames [m], and moments of contact [s]."""
    far = np.full(len(seconds), np.inf)
    if collision is None or not len(pairs):
        return far, far, []
    level = collision.level[:, pairs]
    at_frame = np.where(collision.evaluated[:, pairs], collision.clearance[:, pairs], np.inf)
    at_frame = np.where(level == Level.CONTACT, 0.0, at_frame)
    shown = np.min(at_frame, axis=1, initial=np.inf)
    least = shown
    if collision.between is not None and collision.clearance_bound is not None:
        looked = collision.between[:, pairs] != Between.NOT_LOOKED
        near = looked & ((collision.between[:, pairs] != Between.CLEAR) | collision.evaluated[:, pairs])
        bound = np.where(near, collision.clearance_bound[:, pairs], np.inf)
        least = np.minimum(least, np.min(np.where(np.isnan(bound), np.inf, bound), axis=1, initial=np.inf))
    touches = seconds[np.flatnonzero((level == Level.CONTACT).any(axis=1))]
    crossings = collision.crossings
    mine = np.isin(crossings.pair, pairs) & (crossings.level == Level.CONTACT) & crossings.begins
    return least, shown, [*touches.tolist(), *(crossings.latest[mine] / 1e9).tolist()]
