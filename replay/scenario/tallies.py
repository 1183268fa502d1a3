"""What is kept of a quantity while its frames stream past, and what it says in the end."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from replay.errors import count
from replay.language.fields import When
from replay.numerics.arrays import Floats, Integers
from replay.numerics.constants import SECOND
from replay.scenario.measures import Measure, finite


class Tally(Protocol):
    """Takes a quantity's values frame by frame and judges them in the end."""

    def update(self, time_ns: Integers, values: Any, /) -> None:
        """Take what is followed in n frames at times (n,) [ns]: values (n,), of which a NaN is none, or as it says."""

    def result(self, what: str) -> tuple[bool, str]:
        """Return whether the expectation held, and the detail."""

    def measure(self, name: str) -> Measure:
        """Return the number that decided, with what was expected of it."""
        ...


@dataclass
class Count:
    """In how many frames something was so (1) or not (0)."""

    when: When
    count: int = 0
    frames: int = 0
    first: int | None = None
    first_not: int | None = None

    def update(self, time_ns: Integers, values: Floats) -> None:
        """See `Tally`."""
        so = values > 0.0
        self.count += int(np.count_nonzero(so))
        self.frames += len(so)
        if self.first is None and so.any():
            self.first = int(time_ns[int(np.argmax(so))])
        if self.first_not is None and not so.all():
            self.first_not = int(time_ns[int(np.argmin(so))])

    def result(self, what: str) -> tuple[bool, str]:
        """See `Tally`."""
        text = f"{what} in {self.count} of {count(self.frames, 'frame')}"
        if self.when == "always":
            text += "" if self.first_not is None else f", first not at {shown_seconds(self.first_not)}"
            return self.count == self.frames, text
        text += "" if self.first is None else f", first at {shown_seconds(self.first)}"
        return (self.count == 0) == (self.when == "never"), text

    def measure(self, name: str) -> Measure:
        """See `Tally`."""
        at = self.first_not if self.when == "always" else self.first
        return frames_measure(name, self.when, self.count, self.frames, at)


def frames_measure(name: str, when: When, number: int, frames: int, at: int | None, subject: str = "") -> Measure:
    """Return in how many frames something was so, where never, always or sometimes is expected, and the moment [ns]."""
    limit = {"never": 0, "sometimes": 1, "always": frames}[when]
    margin = limit - number if when == "never" else number - limit
    time = None if at is None else at / SECOND
    return Measure(name, float(number), "frames", time, subject, float(limit), float(margin))


@dataclass
class Extremes:
    """Smallest and largest value, their times, and the bounds expected of them; NaN is no value.

    Attributes:
        complete: every frame must have a value.
        subject: what the smallest value is of, where that is told.
    """

    unit: str
    low: float | None = None
    high: float | None = None
    complete: bool = False
    least: tuple[float, int] = (math.inf, 0)
    most: tuple[float, int] = (-math.inf, 0)
    missing: int = 0
    subject: str = ""

    def update(self, time_ns: Integers, values: Floats, subjects: Sequence[str] | None = None) -> None:
        """See `Tally`; `subjects` names what each value is of."""
        known = ~np.isnan(values)
        self.missing += len(values) - int(np.count_nonzero(known))
        rows = np.flatnonzero(known)
        values, time_ns = values[known], time_ns[known]
        if not len(values):
            return
        low, high = int(np.argmin(values)), int(np.argmax(values))
        if values[low] < self.least[0]:
            self.least = (float(values[low]), int(time_ns[low]))
            self.subject = "" if subjects is None else subjects[int(rows[low])]
        if values[high] > self.most[0]:
            self.most = (float(values[high]), int(time_ns[high]))

    def result(self, what: str) -> tuple[bool, str]:
        """See `Tally`."""
        parts = []
        found = self.most[0] >= self.least[0]
        if found and self.low is not None:
            of = f" of {self.subject}" if self.subject else ""
            parts.append(f"smallest {what} {self.least[0]:.6g} {self.unit}{of} at {shown_seconds(self.least[1])}")
        if found and self.high is not None:
            parts.append(f"largest {what} {self.most[0]:.6g} {self.unit} at {shown_seconds(self.most[1])}")
        if not found:
            parts.append(f"no {what}")
        unknown = self.complete and self.missing > 0
        if unknown:
            parts.append(f"{what} not computed in {count(self.missing, 'frame')} (model.collision.clearance)")
        above = self.low is None or self.least[0] >= self.low
        below = self.high is None or self.most[0] <= self.high
        return above and below and not unknown, ", ".join(parts)

    def measure(self, name: str) -> Measure:
        """See `Tally`: the value that is nearest to its bound, or beyond it."""
        (value, time), limit = (self.most, self.high) if self.low is None else (self.least, self.low)
        if self.most[0] < self.least[0] or limit is None:
            return Measure(name, None, self.unit, None, self.subject, limit)
        margin = limit - value if self.low is None else value - limit
        return Measure(name, finite(value), self.unit, time / SECOND, self.subject, limit, finite(margin))


def shown_seconds(time_ns: int) -> str:
    """Return a time [ns] for a message."""
    return f"{time_ns * 1e-9:.6g} s"
