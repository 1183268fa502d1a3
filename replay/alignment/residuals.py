"""What a machine measured beside what was simulated, at the frames' times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.alignment.clock import LogClock
from replay.alignment.pair import SignalPair
from replay.errors import InvalidValue
from replay.numerics.arrays import Flags, Floats, Integers

_SAME_TIME = 1e-9
"""A sample and a frame that are no farther apart are at one time: recordings are exact to the nanosecond [s]."""


@dataclass(frozen=True, eq=False)
class SampledFrames:
    """A pair of signals at the frames' times.

    Attributes:
        pair: the signals.
        clock: that was used.
        at_frames: (n,) measured values at the frames, NaN where there is none.
        enclosed: (n,) whether a frame lies between two samples, no farther apart than `max_gap`, or on a sample.
        measured_there: (n,) whether the nearer of the two has a value, so that something was detected.
        simulated_there: (n,) whether the simulation detects something.
        frames: (k,) indices of the frames at which both are finite numbers.
        simulated, measured: (k,) at these.
        residual: (k,) measured - simulated.
        n_unmatched_samples: samples that lie before the first frame, after the last, or next to no enclosed frame.
    """

    pair: SignalPair
    clock: LogClock
    at_frames: Floats
    enclosed: Flags
    measured_there: Flags
    simulated_there: Flags
    frames: Integers
    simulated: Floats
    measured: Floats
    residual: Floats
    n_unmatched_samples: int

    @property
    def n_unmatched_frames(self) -> int:
        """Frames that lie between no two samples near enough."""
        return len(self.enclosed) - int(self.enclosed.sum())

    @property
    def both(self) -> int:
        """Enclosed frames at which both detect something."""
        return self._frames(True, True)

    @property
    def only_measured(self) -> int:
        """Enclosed frames at which the machine alone detects something."""
        return self._frames(False, True)

    @property
    def only_simulated(self) -> int:
        """Enclosed frames at which the simulation alone detects something."""
        return self._frames(True, False)

    def _frames(self, simulated: bool, measured: bool) -> int:
        return int((self.enclosed & (self.simulated_there == simulated) & (self.measured_there == measured)).sum())


def match(pair: SignalPair, clock: LogClock, *, max_gap: float) -> SampledFrames:
    """Return what was measured at the frames' times.

    A value lies on the line between the samples before and after the frame (of `steps`: it is that of the sample
    before). There is none where these are more than `max_gap` apart, before the first and after the last sample, and
    where one of the two has no value.

    Args:
        pair: the signals.
        clock: given, or estimated.
        max_gap: longest time between two samples that are joined [s].

    Raises:
        InvalidValue: `max_gap` is not above 0.
    """
    if not max_gap > 0.0:
        raise InvalidValue("max_gap", max_gap, "must be above 0")
    frames, samples, value = pair.time, clock.simulated(pair.measured_time), pair.measured_value
    n, m = len(frames), len(samples)
    at_frames, enclosed, there = np.full(n, np.nan), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool)
    next_to = np.zeros(m, dtype=bool)
    if m and n:
        earlier = np.searchsorted(samples, frames + _SAME_TIME, side="right")
        before, after = np.maximum(earlier - 1, 0), np.minimum(earlier, m - 1)
        first, second = samples[before], samples[after]
        on = np.abs(first - frames) <= _SAME_TIME
        gap = second - first
        enclosed = on | ((first < frames) & (second > frames) & (gap <= max_gap))
        weight = np.where(on, 0.0, (frames - first) / np.where(gap > 0.0, gap, 1.0))
        low, high = value[before], value[after]
        with np.errstate(invalid="ignore", over="ignore"):
            between = low if pair.steps else np.where(weight == 0.0, low, low + weight * (high - low))
        at_frames = np.where(enclosed, between, np.nan)
        there = enclosed & ~np.isnan(np.where(pair.steps | (weight <= 0.5), low, high))
        next_to = _next_to(earlier, m, enclosed) & (samples >= frames[0] - _SAME_TIME)
    simulated_there = ~np.isnan(pair.value)
    kept = np.flatnonzero(np.isfinite(at_frames) & np.isfinite(pair.value))
    simulated, measured = pair.value[kept], at_frames[kept]
    return SampledFrames(
        pair=pair,
        clock=clock,
        at_frames=at_frames,
        enclosed=enclosed,
        measured_there=there,
        simulated_there=simulated_there,
        frames=kept,
        simulated=simulated,
        measured=measured,
        residual=measured - simulated,
        n_unmatched_samples=m - int(next_to.sum()),
    )


def _next_to(earlier: Integers, count: int, enclosed: Flags) -> Flags:
    """Return whether the frame before or after each of some samples is enclosed, False after the last frame.

    Args:
        earlier: (n,) how many samples are not later than each frame.
        count: of the samples.
        enclosed: (n,) see `SampledFrames`.
    """
    passed = np.cumsum(np.bincount(earlier, minlength=count + 1))[:count]  # frames before each sample
    last = len(enclosed) - 1
    return np.asarray((passed <= last) & (enclosed[np.maximum(passed - 1, 0)] | enclosed[np.minimum(passed, last)]))
