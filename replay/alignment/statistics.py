"""How far a machine's signal is from the simulated one: in numbers, and by which scale and offset."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.alignment.between import Places, jump_errors, line_errors, slopes
from replay.alignment.clock import LogClock
from replay.alignment.pair import SignalPair
from replay.alignment.residuals import SampledFrames
from replay.alignment.spread import BINS, SpreadSums
from replay.alignment.trace import FEWEST, frames_of, samples_of

PERCENTILES = (5.0, 50.0, 95.0)


@dataclass(frozen=True)
class LineFit:
    """The best  measured = scale * simulated + offset.

    Attributes:
        scale: without unit.
        offset: in the signal's unit.
        scale_interval, offset_interval: that cover the true ones, what is not known of the clock included.
    """

    scale: float
    offset: float
    scale_interval: tuple[float, float]
    offset_interval: tuple[float, float]


@dataclass(frozen=True)
class ResidualStatistics:
    """What residuals (measured - simulated) of some frames say; NaN where there are none.

    Attributes:
        count: of the frames.
        bias: their mean.
        rms: root mean square.
        largest: the residual of largest magnitude.
        frame: its frame's index, -1 where there are none.
        percentiles: of the residual, see `PERCENTILES`.
        correlation: of measured and simulated; NaN where one of them is constant.
        fit: the best scale and offset; None where nothing tells them, or of states.
    """

    count: int
    bias: float
    rms: float
    largest: float
    frame: int
    percentiles: tuple[float, float, float]
    correlation: float
    fit: LineFit | None


def statistics(matched: SampledFrames, *, confidence: float = 0.95) -> ResidualStatistics:
    """Return what the residuals of a signal say.

    Args:
        matched: the signal at the frames' times.
        confidence: with which the intervals of scale and offset cover the true ones.

    Accuracy: these intervals cover as those of the clock do (`tests/alignment/test_statistics.py`).
    """
    residual = matched.residual
    if len(residual) == 0:
        nothing = float("nan")
        return ResidualStatistics(0, nothing, nothing, nothing, -1, (nothing,) * 3, nothing, None)
    worst = int(np.argmax(np.abs(residual)))
    size = abs(float(residual[worst]))
    rms = size * float(np.sqrt(np.mean((residual / size) ** 2))) if size > 0.0 else 0.0
    low, middle, high = (float(p) for p in np.percentile(residual, PERCENTILES))
    return ResidualStatistics(
        count=len(residual),
        bias=float(np.mean(residual)),
        rms=rms,
        largest=float(residual[worst]),
        frame=int(matched.frames[worst]),
        percentiles=(low, middle, high),
        correlation=_correlation(matched),
        fit=None if matched.pair.steps else best_line(matched.pair, matched.clock, confidence=confidence),
    )


def _correlation(matched: SampledFrames) -> float:
    sides = []
    for values in (matched.simulated, matched.measured):
        size = float(np.max(np.abs(values)))
        scaled = values / size if size > 0.0 else values
        off = scaled - np.mean(scaled)
        norm = float(np.sqrt((off**2).sum()))
        if not norm > 1e-12 * np.sqrt(len(values)):
            return float("nan")
        sides.append(off / norm)
    return float(np.clip((sides[0] * sides[1]).sum(), -1.0, 1.0))


def best_line(pair: SignalPair, clock: LogClock, *, confidence: float) -> LineFit | None:
    """Return the best scale and offset between a simulated signal and the samples of its measurement.

    Here the simulated signal is interpolated at the samples' times: noise is in what was measured, and is not to be
    smoothed by lines between samples. What is not known of the clock moves samples by slope * error of the clock, which
    adds to the variance of both.

    Returns:
        None where fewer than 6 samples lie between frames with values, or where the simulated signal is constant.
    """
    log_time, y = samples_of(pair)
    time, simulated = frames_of(pair)
    if len(time) < 2 or len(y) < FEWEST:
        return None
    places = Places(time, clock.simulated(log_time))
    s = places.values(simulated)
    used = places.inside & np.isfinite(s)
    n = int(used.sum())
    if n < FEWEST:
        return None
    s, y, log_time = s[used], y[used], log_time[used]
    largest = (float(np.max(np.abs(s))) or 1.0), (float(np.max(np.abs(y))) or 1.0)
    s, y = s / largest[0], y / largest[1]
    mean, y_mean = float(np.mean(s)), float(np.mean(y))
    off = s - mean
    norm = float(np.sqrt((off**2).sum()))
    if not norm > 1e-9 * np.sqrt(n):
        return None
    scale = float((off * (y - y_mean)).sum()) / norm**2
    offset = y_mean - scale * mean
    residual = y - y_mean - scale * off
    noise = float(np.sqrt((residual**2).sum() / (n - 2)))
    to_scale = off / norm**2
    to_offset = 1.0 / n - mean * to_scale
    columns = np.array([np.full(n, 1.0 / np.sqrt(n)), off / norm])
    slope = scale * slopes(time, simulated / largest[0])[0][places.index[used]]
    off_lines, off_jumps = (
        scale * errors(simulated / largest[0])[places.index[used]] for errors in (line_errors, jump_errors)
    )
    moves = slope, slope * (log_time - clock.reference)
    intervals = []
    for best, weight, unit in ((scale, to_scale, largest[1] / largest[0]), (offset, to_offset, largest[1])):
        sums = SpreadSums(float(log_time[0]), float(log_time[-1]))
        sums.add(sums.bins(log_time), weight, residual, noise, columns)
        sums.hide(weight, off_lines, off_jumps)
        of_offset, of_drift = (float((weight * move).sum()) for move in moves)
        of_clock = float(np.hypot(of_offset * clock.deviations[0], of_drift * clock.deviations[1]))
        half = sums.spread(np.zeros((0, BINS))).half(confidence, of_clock)
        intervals.append((best * unit - half * unit, best * unit + half * unit))
    return LineFit(scale * largest[1] / largest[0], offset * largest[1], intervals[0], intervals[1])
