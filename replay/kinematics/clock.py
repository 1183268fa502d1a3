"""The clock of a joint's script: how far the script has come at any time, where something slows it down.

Script time s(t) is piecewise quadratic and never falls; the joint is at q(s(t)), so its path is kept. Its velocity is
q' r and its acceleration q'' r^2 + q' r', with the rate r = s' and the ramp r' = s''.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.numerics.arrays import Floats


@dataclass(frozen=True, eq=False)
class Clock:
    """m pieces, each from its start to that of the next one, the last one for ever; before the first, s = t.

    Attributes:
        start: (m,) increasing times [s].
        script: (m,) script time at the start of each piece [s].
        rate: (m,) s' at its start.
        ramp: (m,) s'' on it [1/s].
    """

    start: Floats
    script: Floats
    rate: Floats
    ramp: Floats

    @staticmethod
    def steady() -> Clock:
        """Return a clock that shows the time itself."""
        return Clock(*(np.zeros(0) for _ in range(4)))

    def sample(self, seconds: Floats) -> tuple[Floats, Floats]:
        """Return script time [s] and rate at times (n,) [s]; where two pieces meet, the rate of the later one."""
        if not len(self.start):
            return seconds, np.ones(len(seconds))
        piece = np.searchsorted(self.start, seconds, side="right") - 1
        inside = np.maximum(piece, 0)
        u = seconds - self.start[inside]
        script = self.script[inside] + u * (self.rate[inside] + 0.5 * self.ramp[inside] * u)
        rate = self.rate[inside] + self.ramp[inside] * u
        return np.where(piece < 0, seconds, script), np.where(piece < 0, 1.0, rate)

    def at(self, second: float) -> tuple[float, float]:
        """Return script time [s] and rate at one time [s]."""
        script, rate = self.sample(np.array([second]))
        return float(script[0]), float(rate[0])

    def until(self, second: float) -> Clock:
        """Return the pieces that begin by a time [s]."""
        count = int(np.searchsorted(self.start, second, side="right"))
        return Clock(*(values[:count] for values in (self.start, self.script, self.rate, self.ramp)))

    def then(self, second: float, rate: float, ramp: float) -> Clock:
        """Return this with one more piece, which begins at a time [s] not before any piece; one of that time goes."""
        script = self.at(second)[0]
        count = int(np.searchsorted(self.start, second, side="left"))
        piece = (second, script, rate, ramp)
        pieces = zip((self.start, self.script, self.rate, self.ramp), piece, strict=True)
        return Clock(*(np.append(values[:count], value) for values, value in pieces))
