"""A pair made ready for finding the clock: of size 1, without what is not there, and no longer than is of use."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from replay.alignment.between import jump_errors, line_errors, slopes
from replay.alignment.pair import SignalPair
from replay.numerics.arrays import Flags, Floats

FEWEST = 6
"""Samples of a signal that are of use: two determine its scale and offset, two the clock."""

MOST = 1 << 16
"""Samples and frames that a clock is found with; of more, as many neighbours as it takes are one, their mean."""

_MOST_OF = (5.0, 95.0)
"""Percentiles between which most values of a signal are."""

_MOVES = 1e-9
"""A signal that varies by less than this part of its size is constant: that is rounding."""


@dataclass(frozen=True, eq=False)
class Trace:
    """A pair of signals whose clock is looked for.

    Attributes:
        name: of the pair.
        time: (n,) of the frames [s].
        value: (n,) simulated, of mean 0 and standard deviation 1; NaN where nothing is detected.
        lines: (n - 1,) slopes between frames [1/s].
        slopes: (n,) slopes at frames [1/s].
        log_time: (m,) of the samples [s], on the log's clock.
        measured: (m,) of mean 0 and standard deviation 1.
        bends: (n - 1,) how far each line between frames may be off, see `line_errors`.
        jumps: (n - 1,) how far by jumps, which are known to a frame at best, see `jump_errors`.
    """

    name: str
    time: Floats
    value: Floats
    lines: Floats
    slopes: Floats
    log_time: Floats
    measured: Floats
    bends: Floats
    jumps: Floats

    def thinned(self, most: int) -> Trace:
        """Return a trace of fewer samples, see `thinned`."""
        log_time, measured = thinned(self.log_time, self.measured, most)
        return dataclasses.replace(self, log_time=log_time, measured=measured)


def thinned(time: Floats, value: Floats, most: int) -> tuple[Floats, Floats]:
    """Return `most` samples at most: neighbours are one, at the mean of their times, with the mean of their values.

    What stands across a gap is left out, unless all samples are that far apart.
    """
    group = -(-len(time) // most)
    if group <= 1:
        return time, value
    used = len(time) // group * group
    times, values = (array[:used].reshape(-1, group) for array in (time, value))
    span = times[:, -1] - times[:, 0]
    near = span <= 2.0 * np.median(span)
    return times.mean(axis=1)[near], values.mean(axis=1)[near]


def trace_of(pair: SignalPair, first: float = -np.inf, last: float = np.inf) -> Trace | str:
    """Return the trace of a pair, or why it says nothing about the clock.

    Args:
        pair: the signals.
        first, last: samples of other times are left out [s]: logs may be long, or have a time that is far off.
    """
    log_time, measured = samples_of(pair, first, last)
    frames = int(np.isfinite(pair.value).sum())
    if frames < FEWEST:
        return f"{frames} of {len(pair.value)} frames have a simulated value"
    if len(measured) < FEWEST:
        return (
            f"{len(measured)} of {len(pair.measured_value)} samples have a value, at times that may be the scenario's"
        )
    time, value = frames_of(pair)
    likely = _likely(value, measured)
    log_time, measured = log_time[likely], measured[likely]
    if pair.steps:
        value = _softened(time, value, float(np.median(np.diff(log_time))))
    simulated, taken = _of_size_one(value), _of_size_one(measured)
    if simulated is None:
        return "the simulated signal is constant"
    if taken is None:
        return "the measured signal is constant"
    lines, at_frames = slopes(time, simulated)
    jumps = jump_errors(simulated)
    if pair.steps:  # each ramp may be half a frame earlier or later
        jumps = np.nan_to_num(np.abs(lines)) * np.diff(time) / np.sqrt(12.0)
    return Trace(pair.name, time, simulated, lines, at_frames, log_time, taken, line_errors(simulated), jumps)


def frames_of(pair: SignalPair) -> tuple[Floats, Floats]:
    """Return times and simulated values, NaN where there is no number, of `MOST` frames at most."""
    value = pair.value
    if np.isinf(value).any():
        value = np.where(np.isfinite(value), value, np.nan)
    return thinned(pair.time, value, MOST)


def samples_of(pair: SignalPair, first: float = -np.inf, last: float = np.inf) -> tuple[Floats, Floats]:
    """Return times and measured values of those samples, between two times, that are numbers, `MOST` at most."""
    begin, end = np.searchsorted(pair.measured_time, [first, last])
    time, value = pair.measured_time[begin:end], pair.measured_value[begin:end]
    there = np.isfinite(value)
    return thinned(time, value, MOST) if there.all() else thinned(time[there], value[there], MOST)


def _likely(value: Floats, measured: Floats) -> Flags:
    """Return which measured values are not farther from most than simulated ones are, by the width of most and more.

    A single value that is far off, as loggers have them, outweighs all others in a sum of squares. Most are those
    between the first and the last twentieth.
    """
    low, high = np.nanpercentile(value, _MOST_OF)
    beyond = max(low - np.nanmin(value), np.nanmax(value) - high) / (high - low) if high > low else np.inf
    first, last = np.percentile(measured, _MOST_OF)
    far = (1.0 + beyond) * (last - first) if last > first else np.inf
    return np.asarray((measured >= first - far) & (measured <= last + far))


def _softened(time: Floats, value: Floats, interval: float) -> Floats:
    """Return a signal of steps with ramps of twice the time between samples, so that some samples lie on each.

    A step between two frames is half-way between them in the mean, where the middle of the ramp is; anywhere else it
    is as likely.
    """
    half = int(np.ceil(interval / float(np.median(np.diff(time)))))
    there = np.isfinite(value)
    sums = np.append(0.0, np.cumsum(np.where(there, value, 0.0)))
    counts = np.append(0, np.cumsum(there))
    index = np.arange(len(value))
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(value))
    mean = (sums[high] - sums[low]) / np.maximum(counts[high] - counts[low], 1)
    return np.where(there, mean, np.nan)


def _of_size_one(value: Floats) -> Floats | None:
    """Return values of mean 0 and standard deviation 1, or None if they are constant."""
    largest = float(np.nanmax(np.abs(value)))
    if largest == 0.0:
        return None
    scaled = value / largest
    scaled = scaled - np.nanmean(scaled)
    size = float(np.sqrt(np.nanmean(scaled**2)))
    return np.asarray(scaled / size) if size > _MOVES else None
