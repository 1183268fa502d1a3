"""Clocks that may be the one that is looked for: the peaks of what offsets explain, each refined."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.alignment.clock_fit import ClockFit, SignalFit, fit_at, moved, refine
from replay.alignment.search import SearchGrid, peaks
from replay.alignment.trace import Trace

LARGEST_DRIFT = 2e-3
"""Drifts up to this are looked for: clocks are better than 1e-3, good ones than 1e-4."""

_MOST_DRIFTS = 201
_MOST_CANDIDATES = 10
_MOST_PEAKS = 40
"""Peaks of a landscape that are looked at, many of which are noise on the same hill; as many beyond the bounds."""

_LEAST_GAIN = 0.02
"""Peaks below this part of the highest are left out."""


def with_drift(traces: Sequence[Trace], fit: ClockFit, *, reach: float, close: float) -> ClockFit:
    """Return a clock whose offset is found with its drift, if data tell the drift better than what clocks keep anyway.

    Args:
        traces: the signals.
        fit: the best offset.
        reach, close: as `refine` takes them.
    """
    both = moved(traces, fit, fit.reference, drifts=True)
    if not 2.0 * float(np.sqrt(np.abs(both.covariance[1, 1]))) <= LARGEST_DRIFT:
        return fit
    return refine(traces, both, reach=reach, close=close)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Clocks to choose from.

    Attributes:
        fits: those that explain most first.
        resolution: offsets that are no farther apart are one [s].
        turned: whether signals may be turned over; else those that are say nothing.
    """

    fits: tuple[ClockFit, ...]
    resolution: float
    turned: bool

    def telling(self, fit: ClockFit) -> tuple[SignalFit, ...]:
        """Return the signals that say something for a clock."""
        return tuple(signal for signal in fit.signals if self.turned or signal.scale > 0.0)

    def gain(self, fit: ClockFit) -> float:
        """Return what a clock explains."""
        return sum(signal.gain for signal in self.telling(fit))


def pace(traces: Sequence[Trace]) -> float:
    """Return how fast signals of size 1 change [1/s], root mean square: offsets less than 1 / pace apart are alike."""
    return float(np.sqrt(np.mean([float(np.nanmean(trace.lines**2)) for trace in traces])))


def candidates(traces: Sequence[Trace], *, drifts: bool, lowest: float, highest: float) -> Candidates:
    """Return the clocks among which the best one is, at all offsets at which simulation and log overlap.

    Args:
        traces: the signals.
        drifts: whether clocks may drift.
        lowest, highest: offsets [s] within which all that may be rivals are to be among them.
    """
    first, last = min(float(t.log_time[0]) for t in traces), max(float(t.log_time[-1]) for t in traces)
    middle = 0.5 * (first + last)
    grid = SearchGrid(traces)
    resolution = max(0.3 / pace(traces), 2.0 * grid.spacing)
    steps = min(int(LARGEST_DRIFT * pace(traces) * (last - first)), _MOST_DRIFTS // 2) if drifts else 0
    tried = (LARGEST_DRIFT * np.arange(-steps, steps + 1) / max(steps, 1)).tolist()
    landscapes = [(drift, grid.landscape(drift, middle)) for drift in tried]
    upright, either = (
        max(float(gain.max()) for gain in gains)
        for gains in ([land.gain for _, land in landscapes], [land.gain_either for _, land in landscapes])
    )
    turned = upright < 0.5 * either
    starts = []
    for drift, land in landscapes:
        height = land.gain_either if turned else land.gain
        tops = peaks(height)
        inside = (land.offsets[tops] >= lowest) & (land.offsets[tops] <= highest)
        for some in (tops[inside][:_MOST_PEAKS], tops[~inside][:_MOST_PEAKS]):
            starts += [(-float(height[i]), float(land.offsets[i]), drift) for i in some]
    starts.sort()
    fits: list[ClockFit] = []
    taken: dict[bool, list[float]] = {True: [], False: []}
    for loss, offset, drift in starts:
        if loss > _LEAST_GAIN * starts[0][0]:
            break
        mine = taken[lowest <= offset <= highest]
        if len(mine) == _MOST_CANDIDATES or any(
            abs(offset - other) < resolution for side in taken.values() for other in side
        ):
            continue
        mine.append(offset)
        fit = refine(traces, fit_at(traces, offset, drift, middle, drifts=False), reach=resolution, close=0.1)
        if drifts:
            fit = with_drift(traces, fit, reach=resolution, close=0.1)
        if fit.signals:
            fits.append(fit)
    found = Candidates(tuple(fits), resolution, turned)
    return Candidates(tuple(sorted(fits, key=lambda fit: -found.gain(fit))), resolution, turned)
