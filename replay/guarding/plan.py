"""The factors of guards over time, and the clocks of joints that follow: closed forms from event to event.

Each guard has a factor, piecewise linear in time: 1 while it does not act, falling to its target while it brakes,
rising to 1 after its release. The rate of a joint's clock is the least factor of the guards that name it.

A ramp between the rates a and b takes T = max_j V_j |a - b| / d_j, with V_j the largest speed of joint j's script on
what the clock passes in that time, and d_j the joint's limit: the ramp's part of the acceleration, q' r', is within it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from replay.guarding.columns import GuardState
from replay.guarding.guard import Guard
from replay.kinematics.clock import Clock
from replay.kinematics.profiles import Profile

ROUNDS = 5_000
"""Cap of the search for the time of a ramp; beyond it the largest speed of all that is left of the script counts. Each
round comes nearer by a constant share, which is small where the script speeds up as fast as the ramp grows."""

_SAME = 1.0 + 2.0**-50
"""Times that are as near as this are one: what is left of the search is rounding."""

Line = tuple[float, float, float]
"""From when on [s] a factor is a straight line, its value then, and its slope [1/s]."""
_FREE: Line = (0.0, 1.0, 0.0)


@dataclass
class Factor:
    """A guard's factor.

    Attributes:
        lines: by their start.
        before: the lines as they are without the braking that is to come.
        trigger, brake, hold: when it was triggered, braking begins, and ends [s]; None before that is known.
        release, full: when it was let go last, and is at 1 again [s].
    """

    lines: list[Line] = field(default_factory=lambda: [_FREE])
    before: list[Line] = field(default_factory=list)
    trigger: float | None = None
    brake: float = math.inf
    hold: float = math.inf
    release: float = -math.inf
    full: float = -math.inf

    def state(self, second: float) -> GuardState:
        """Return what the guard does at a time [s]."""
        if self.trigger is None:
            return GuardState.RELEASING if second < self.full else GuardState.ARMED
        if second < self.brake:
            return GuardState.REACTING
        return GuardState.BRAKING if second < self.hold else GuardState.HOLDING

    def line(self, second: float) -> Line:
        """Return the line at a time [s], of two that meet the later one."""
        return next(line for line in reversed(self.lines) if line[0] <= second)


def value_of(line: Line, second: float) -> float:
    """Return a line's value at a time [s]."""
    start, value, slope = line
    return value + slope * (second - start)


class Plan:
    """Factors and clocks, planned for ever; a change of a guard changes them from its time on.

    Args:
        guards: by name.
        profiles: of the joints that lead, by index: their scripts.

    Attributes:
        clocks: of each joint that a guard names, by index.
        factors: of the guards.
    """

    def __init__(self, guards: Sequence[Guard], profiles: Sequence[Profile]) -> None:
        self.guards, self._profiles = tuple(guards), tuple(profiles)
        self.factors = [Factor() for _ in guards]
        named = sorted({joint for guard in guards for joint in guard.joints})
        self._of = {joint: [k for k, guard in enumerate(guards) if joint in guard.joints] for joint in named}
        self.clocks = dict.fromkeys(named, Clock.steady())
        self._shown: dict[int, list[Line]] = {joint: [] for joint in named}  # the line of each piece of a clock

    def trigger(self, guard: int, second: float) -> None:
        """Let a guard brake after its reaction."""
        factor = self.factors[guard]
        factor.trigger, factor.brake = second, second + self.guards[guard].reaction
        factor.before = list(factor.lines)

    def let_go(self, guard: int, second: float) -> None:
        """Let the joints of a guard that holds them go on."""
        factor, made = self.factors[guard], self.guards[guard]
        value = value_of(factor.line(second), second)
        time = self._ramp_time(guard, second, value, 1.0, made.acceleration)
        factor.trigger, factor.brake, factor.hold = None, math.inf, math.inf
        factor.release, factor.full = second, second + time
        factor.lines = [line for line in factor.lines if line[0] < second]
        if time > 0.0:
            factor.lines.append((second, value, (1.0 - value) / time))
        factor.lines.append((factor.full, 1.0, 0.0))

    def follow(self, second: float) -> None:
        """Plan all that comes after the changes at a time [s] again."""
        coming = [k for k, f in enumerate(self.factors) if f.trigger is not None and f.brake >= second]
        for k in coming:
            self.factors[k].lines, self.factors[k].hold = list(self.factors[k].before), math.inf
        self._clocks_from(second)
        for k in sorted(coming, key=lambda k: self.factors[k].brake):
            self._brake(k)
            self._clocks_from(self.factors[k].brake)

    def rate(self, joint: int, second: float) -> float:
        """Return the rate of a joint's clock at a time [s]."""
        return self.clocks[joint].at(second)[1]

    def _brake(self, guard: int) -> None:
        factor, made = self.factors[guard], self.guards[guard]
        begin = factor.brake
        rate = max(self.rate(joint, begin) for joint in made.joints)
        time = 0.0
        if rate > made.target:
            time = self._ramp_time(guard, begin, rate, made.target, made.deceleration)
        factor.hold = begin + time
        factor.lines = [line for line in factor.lines if line[0] < begin]
        if time > 0.0:
            factor.lines.append((begin, rate, (made.target - rate) / time))
        factor.lines.append((factor.hold, made.target, 0.0))

    def _ramp_time(self, guard: int, second: float, begin: float, end: float, limits: Sequence[float]) -> float:
        """Return T of the module's text for a ramp that begins at a time [s]."""
        joints = self.guards[guard].joints
        places = [self.clocks[joint].at(second)[0] for joint in joints]

        def time(way: float) -> float:
            return max(
                self._profiles[joint].fastest(place, place + way) * abs(begin - end) / limit
                for joint, place, limit in zip(joints, places, limits, strict=True)
            )

        found = time(0.0)
        for _ in range(ROUNDS):
            longer = time(0.5 * (begin + end) * found)
            if longer <= found * _SAME:
                return max(longer, found)
            found = longer
        return time(math.inf)

    def _clocks_from(self, second: float) -> None:
        """Make the clocks follow the least factors from a time [s] on."""
        for joint, guards in self._of.items():
            clock, shown = self.clocks[joint].until(second), self._shown[joint]
            del shown[len(clock.start) :]
            starts = sorted({line[0] for k in guards for line in self.factors[k].lines if line[0] > second})
            for begin, end in zip([second, *starts], [*starts, math.inf], strict=True):
                lines = [self.factors[k].line(begin) for k in guards]
                at = begin
                while True:
                    least = min(lines, key=lambda line: (value_of(line, at), line[2]))
                    if least != (shown[-1] if shown else _FREE):
                        clock = clock.then(at, value_of(least, at), least[2])
                        del shown[len(clock.start) - 1 :]
                        shown.append(least)
                    crossings = [(self._crossing(least, other, at), other) for other in lines if other[2] < least[2]]
                    at, lower = min(crossings, default=(math.inf, least))
                    if not at < end:
                        break
                    lines = [lower, *(line for line in lines if line[2] < lower[2])]
            self.clocks[joint] = clock

    @staticmethod
    def _crossing(line: Line, steeper: Line, second: float) -> float:
        """Return when a line that falls faster is no longer above another one, not before a time [s]."""
        above = value_of(steeper, second) - value_of(line, second)
        return second + max(above, 0.0) / (line[2] - steeper[2])
