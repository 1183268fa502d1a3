"""Guards by integration from event to event, written apart from the package: nothing is planned ahead.

All that is kept is where every clock is now, how fast every guard lets it go and how that changes, and what each
guard waits for. From frame to frame this is moved on by closed forms, cut wherever a guard begins or ends braking and
wherever two guards' factors cross.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

ARMED, REACTING, BRAKING, HOLDING, RELEASING = range(5)


@dataclass
class Script:
    """Pieces (start, end, coefficients) of a joint's script, in order and without gaps but at rest."""

    pieces: list[tuple[float, float, list[float]]]

    def speeds(self, s: float) -> list[float]:
        """Return the velocities at s: two where pieces meet."""
        found = [_slope(c, s - a) for a, b, c in self.pieces if a <= s <= b]
        return found or [0.0]

    def velocity(self, s: float) -> float:
        """Return the velocity, at knots that of the later piece."""
        later = [(a, c) for a, b, c in self.pieces if a <= s <= b]
        return _slope(later[-1][1], s - later[-1][0]) if later else 0.0

    def position(self, s: float, initial: float) -> float:
        place = initial
        for a, b, c in self.pieces:
            if s >= a:
                place = sum(value * (min(s, b) - a) ** k for k, value in enumerate(c))
        return place

    def fastest(self, low: float, high: float) -> float:
        """Return the largest speed on [low, high] by asking everywhere it may be."""
        times = {low, high}
        for a, b, c in self.pieces:
            times |= {t for t in (a, b) if low <= t <= high}
            if len(c) > 3 and c[3]:
                turn = a - c[2] / (3.0 * c[3])
                times |= {turn} if max(a, low) <= turn <= min(b, high) else set()
        return max(abs(v) for t in times for v in self.speeds(t))


def _slope(c: Sequence[float], tau: float) -> float:
    return sum(k * value * tau ** (k - 1) for k, value in enumerate(c) if k)


@dataclass
class Rule:
    """A guard: joints, limits, times, and what its condition is by frame."""

    joints: list[int]
    target: float
    deceleration: dict[int, float]
    acceleration: dict[int, float]
    frames_for: int
    reaction: float
    frames_after: int | None
    # now
    state: int = ARMED
    factor: float = 1.0
    slope: float = 0.0
    until: float = math.inf
    brake: float = math.inf
    since: int | None = None


@dataclass
class World:
    """Joints and guards at one moment."""

    scripts: list[Script]
    rules: list[Rule]
    time: float = 0.0
    clocks: list[float] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.clocks = [0.0] * len(self.scripts)

    def rate(self, joint: int) -> float:
        return min((rule.factor for rule in self.rules if joint in rule.joints), default=1.0)

    def advance(self, time: float) -> None:
        """Move on to a time, from event to event."""
        while True:
            event = min([time, *(rule.until for rule in self.rules), *(rule.brake for rule in self.rules)])
            self._flow(max(event - self.time, 0.0))
            self.time = max(event, self.time)
            happened = False
            for rule in self.rules:
                if rule.until <= self.time:
                    happened = True
                    rule.factor = rule.target if rule.state == BRAKING else 1.0
                    rule.slope, rule.until = 0.0, math.inf
                    rule.state = {BRAKING: HOLDING, RELEASING: ARMED}.get(rule.state, rule.state)
            for rule in self.rules:
                if rule.brake <= self.time:
                    happened = True
                    self._brake(rule)
            if not happened and event >= time:
                return

    def _brake(self, rule: Rule) -> None:
        begin = max(self.rate(joint) for joint in rule.joints)
        rule.brake, rule.until = math.inf, math.inf
        if begin <= rule.target:
            rule.factor, rule.slope, rule.state = rule.target, 0.0, HOLDING
            return
        self._ramp(rule, begin, rule.target, rule.deceleration)
        rule.state = BRAKING if rule.until < math.inf else HOLDING

    def let_go(self, rule: Rule) -> None:
        self._ramp(rule, rule.factor, 1.0, rule.acceleration)
        rule.state = RELEASING if rule.until < math.inf else ARMED

    def _ramp(self, rule: Rule, begin: float, end: float, limits: dict[int, float]) -> None:
        took = 0.0
        for _ in range(100_000):
            way = 0.5 * (begin + end) * took
            speeds = {j: self.scripts[j].fastest(self.clocks[j], self.clocks[j] + way) for j in rule.joints}
            longer = max(speeds[j] * abs(end - begin) / limits[j] for j in rule.joints)
            if longer <= took * (1.0 + 1e-15):
                break
            took = longer
        rule.factor, rule.slope = (begin, (end - begin) / took) if took > 0.0 else (end, 0.0)
        rule.until = self.time + took if took > 0.0 else math.inf

    def _flow(self, span: float) -> None:
        cuts = {0.0, span}
        for a, b in itertools.combinations(self.rules, 2):
            if a.slope != b.slope:
                cross = (b.factor - a.factor) / (a.slope - b.slope)
                cuts |= {cross} if 0.0 < cross < span else set()
        for low, high in itertools.pairwise(sorted(cuts)):
            for joint in range(len(self.clocks)):
                at = [
                    min([1.0, *(r.factor + r.slope * u for r in self.rules if joint in r.joints)]) for u in (low, high)
                ]
                self.clocks[joint] += 0.5 * (at[0] + at[1]) * (high - low)
        for rule in self.rules:
            rule.factor += rule.slope * span

    def frame(self, number: int, holds: Sequence[bool], stays: Sequence[bool]) -> None:
        """Look at the conditions in a frame; all guards that change do so at once."""
        for rule, on, keeps in zip(self.rules, holds, stays, strict=True):
            watching = rule.state in (ARMED, RELEASING) and rule.brake == math.inf
            if watching and on:
                rule.since = number if rule.since is None else rule.since
                if number - rule.since >= rule.frames_for:
                    rule.since, rule.brake = None, self.time + rule.reaction
            elif rule.state == HOLDING and rule.frames_after is not None and not keeps:
                rule.since = number if rule.since is None else rule.since
                if number - rule.since >= rule.frames_after:
                    rule.since = None
                    self.let_go(rule)
            else:
                rule.since = None
        self.advance(self.time)

    def shown(self, rule: Rule) -> int:
        """Return the state by name: what waits to brake reacts, whatever it does meanwhile."""
        return REACTING if rule.brake < math.inf else rule.state


Readings = Callable[[int, np.ndarray], np.ndarray]
"""Takes the number of a frame and the joints' positions, returns what sensors tell."""
