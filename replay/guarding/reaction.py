"""What guards make of a motion: frames are looked at in order, and the first change of a guard ends what is known."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from replay.guarding.acceleration import excesses
from replay.guarding.columns import EXCESS, GuardColumns, GuardState, Happening
from replay.guarding.conditions import Conditions, Told
from replay.guarding.guard import Guard
from replay.guarding.plan import Plan, value_of
from replay.kinematics.clock import Clock
from replay.kinematics.linkage import Joint
from replay.kinematics.motion import Motion
from replay.numerics.arrays import Flags, Floats, Integers

_AWAKE = (GuardState.ARMED, GuardState.RELEASING)


@dataclass(frozen=True)
class Episode:
    """What a guard did from a trigger on: times [s], inf of what did not come.

    Attributes:
        guard: index of the guard.
        trigger: when it was triggered.
        brake, hold: when braking began, and ended.
        release, full: when its joints were let go, and went as fast as scripted or were braked again.
    """

    guard: int
    trigger: float
    brake: float
    hold: float
    release: float = math.inf
    full: float = math.inf


class Reaction:
    """Guards at work on a motion.

    Args:
        guards: sorted by name.
        motion: as it is scripted, without clocks.
        joints: of the motion, in its order.
        leaders: of each joint, the index of the one that it follows; its own if it follows none.

    Attributes:
        motion: as it is by all that was decided so far: final up to the last frame that was decided.
    """

    def __init__(
        self, guards: Sequence[Guard], motion: Motion, joints: Sequence[Joint], leaders: Sequence[int]
    ) -> None:
        self.guards, self._joints, self._leaders, self._scripted = tuple(guards), tuple(joints), tuple(leaders), motion
        self._conditions = Conditions(guards)
        self.restart()

    def restart(self) -> None:
        """Go back to before the first frame."""
        self._conditions.restart()
        self._plan = Plan(self.guards, self._scripted.profiles)
        self._since: list[int | None] = [None] * len(self.guards)
        self._past: list[Episode] = []
        self._told, self._excess_from = -math.inf, [0.0] * len(self._joints)
        self._rows: list[tuple[Integers, Flags, Floats]] = []
        self._follow_plan()

    def decide(self, first: int, seconds: Floats, told: Told, clearance: Floats) -> int:
        """Look at frames until a guard changes, and return how many are decided: all, or those up to that one.

        Args:
            first: number of the first frame.
            seconds: (n,) their times [s].
            told, clearance: see `Conditions.look`; of poses as `motion` has them. Where not all frames are decided it
                is another one from there on.
        """
        velocity = self.motion.states(seconds).velocities
        holds, stays = self._conditions.look(told, clearance, velocity, self._script_velocity(seconds))
        quiet = self._quiet(seconds, holds)
        for row, second in enumerate(seconds.tolist()[quiet:], start=quiet):
            looked = [self._look(g, first + row, second, holds[row, g], stays[row, g]) for g in range(len(self.guards))]
            changed = any(change for change, _ in looked)
            if changed:
                self._plan.follow(second)
                self._follow_plan()
            factors = self._plan.factors
            values = [value_of(factor.line(second), second) for factor in factors]
            state = np.array([[factor.state(second) for factor in factors]])
            self._rows.append((state, np.array([[shown for _, shown in looked]]), np.array([values])))
            if changed:
                self._conditions.keep(row + 1)
                return row + 1
        self._conditions.keep(len(seconds))
        return len(seconds)

    def columns(self, seconds: Floats) -> GuardColumns:
        """Return the columns of the frames decided since this was asked last, at times (n,) [s]."""
        state, condition, factor = (np.concatenate(parts) for parts in zip(*self._rows, strict=True))
        self._rows = []
        clocks = [clock.sample(seconds) for clock in self.motion.clocks]
        happenings = sorted(self._happenings(float(seconds[-1])), key=lambda item: item.time)
        self._told = float(seconds[-1])
        return GuardColumns(
            state=state.astype(np.uint8),
            condition=condition,
            factor=factor,
            rate=np.stack([rate for _, rate in clocks], axis=1),
            script_time=np.stack([script for script, _ in clocks], axis=1),
            happenings=tuple(happenings),
        )

    def soonest(self) -> float:
        """Return in how many frames a condition may begin to hold, as far as the last ones tell; inf if none is near.

        A guess, which no result depends on.
        """
        return self._conditions.soonest

    def episodes(self) -> tuple[Episode, ...]:
        """Return what guards did so far, by the time of the trigger."""
        current = [self._current(g) for g in range(len(self.guards))]
        return tuple(sorted((*self._past, *(item for item in current if item)), key=lambda item: item.trigger))

    def _quiet(self, seconds: Floats, holds: Flags) -> int:
        """Take the first frames, as long as all guards are armed and no condition holds; return how many these are."""
        if not len(seconds) or any(f.state(seconds[0]) is not GuardState.ARMED for f in self._plan.factors):
            return 0
        held = np.flatnonzero(holds.any(axis=1))
        count = int(held[0]) if len(held) else len(holds)
        if count:
            self._since = [None] * len(self.guards)
            shape = holds[:count].shape
            self._rows.append((np.zeros(shape, dtype=np.int64), holds[:count], np.ones(shape)))
        return count

    def _look(self, g: int, frame: int, second: float, holds: bool, stays: bool) -> tuple[bool, bool]:
        """Take one frame of a guard; return whether it changes, and what its condition is taken for."""
        guard, state = self.guards[g], self._plan.factors[g].state(second)
        shown = bool(stays if state is GuardState.HOLDING else holds)
        wanted, needed = (holds, guard.hold_frames) if state in _AWAKE else (not stays, guard.release_frames)
        since = self._since[g]
        self._since[g] = None
        if not wanted or needed is None or state in (GuardState.REACTING, GuardState.BRAKING):
            return False, shown
        since = frame if since is None else since
        if frame - since < needed:
            self._since[g] = since
            return False, shown
        if state in _AWAKE:
            self._plan.trigger(g, second)
            begins = second + guard.reaction
            last = next((k for k in reversed(range(len(self._past))) if self._past[k].guard == g), None)
            if last is not None:
                self._past[last] = replace(self._past[last], full=min(self._past[last].full, begins))
        else:
            episode = self._current(g)
            assert episode is not None
            self._plan.let_go(g, second)
            self._past.append(replace(episode, release=second, full=self._plan.factors[g].full))
        return True, shown

    def _current(self, g: int) -> Episode | None:
        factor = self._plan.factors[g]
        return None if factor.trigger is None else Episode(g, factor.trigger, factor.brake, factor.hold)

    def _follow_plan(self) -> None:
        steady = Clock.steady()
        self.motion = replace(
            self._scripted, clocks=tuple(self._plan.clocks.get(leader, steady) for leader in self._leaders)
        )

    def _script_velocity(self, seconds: Floats) -> Floats:
        found = np.zeros((len(seconds), len(self._joints)))
        if not any(guard.directions for guard in self.guards):
            return found
        for joint, (profile, clock) in enumerate(zip(self.motion.profiles, self.motion.clocks, strict=True)):
            found[:, joint] = profile.sample(clock.sample(seconds)[0])[1]
        return found

    def _happenings(self, end: float) -> Iterator[Happening]:
        """Yield what began and ended after what was told last, until a time [s]."""
        for item in self.episodes():
            name = self.guards[item.guard].name
            for time, kind, begins in (
                (item.trigger, "trigger", True),
                (item.hold, "hold", True),
                (item.release, "hold", False),
                (item.release, "trigger", False),
                (item.release, "release", True),
                (item.full, "release", False),
            ):
                if self._told < time <= end:
                    yield Happening(time, kind, name, begins)
        for joint, (limits, profile, clock) in enumerate(
            zip(self._joints, self.motion.profiles, self.motion.clocks, strict=True)
        ):
            following = end
            for excess in excesses(limits, profile, clock, self._excess_from[joint], math.inf):
                for time, begins in ((excess.begin, True), (excess.end, False)):
                    if self._told < time <= end:
                        yield Happening(time, EXCESS, limits.name, begins)
                if excess.begin <= end < excess.end:
                    following = excess.begin
            self._excess_from[joint] = following
