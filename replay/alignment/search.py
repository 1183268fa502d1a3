"""Where to look for the clock: all offsets at once, on a grid, by correlation of what is there.

With m the mask of a signal (1 where there is a value, else 0, and values 0 there), all sums over the overlap at each
shift are correlations, so that n, both means, both variances and the covariance cost six inverse Fourier transforms
(Padfield 2012). From the correlation coefficient r of n values follows how much likelier scale * simulated + bias is
than a constant: the gain -n/2 log(1 - r^2), which grows with the overlap as well as with the fit; of several signals
it is added. A negative r counts only if nothing else can be found.

Source: D. Padfield, Masked object registration in the Fourier domain, IEEE Trans. Image Process. 21 (2012).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.alignment.between import Places
from replay.alignment.trace import FEWEST, Trace
from replay.numerics.arrays import Flags, Floats, Integers

_FEWEST_POINTS, _MOST_POINTS = 1 << 13, 1 << 18
_KEPT = 0.9
"""Part of the signals' variance that a grid must keep."""

_BEST_FIT = 1e-6
"""1 - r^2 is not smaller than that: values are at their grid points nearly."""

_LEAST_VARIANCE = 1e-3
"""An overlap in which the simulated signal varies by less than this part of its whole variance says nothing."""


@dataclass(frozen=True, eq=False)
class Landscape:
    """What each offset explains, at one drift.

    Attributes:
        offsets: (k,) [s], equally spaced.
        gain: (k,) where each signal is like the simulated one.
        gain_either: (k,) the same, where it may be turned over.
    """

    offsets: Floats
    gain: Floats
    gain_either: Floats


class SearchGrid:
    """Simulated signals on a grid, against which logs are held.

    Attributes:
        spacing: of the grid [s].
    """

    def __init__(self, traces: Sequence[Trace]) -> None:
        from scipy.fft import next_fast_len, rfft

        self.traces = traces
        self.start = min(float(t.time[0]) for t in traces)
        self.log_start = min(float(t.log_time[0]) for t in traces)
        simulated = max(float(t.time[-1]) for t in traces) - self.start
        logged = max(float(t.log_time[-1]) for t in traces) - self.log_start
        frame = min(float(np.median(np.diff(t.time))) for t in traces)
        points = _FEWEST_POINTS
        while True:
            self.spacing = max(frame, (simulated + logged) / points)
            self._count = int(simulated / self.spacing) + 2
            sides = [self._simulated(trace) for trace in traces]
            kept = sum(float((value**2 * there).sum() / max(there.sum(), 1)) for value, there in sides)
            if kept >= _KEPT * len(traces) or self.spacing == frame or points >= _MOST_POINTS:
                break
            points *= 2
        self._logged = int(logged * 1.01 / self.spacing) + 3
        self._length = next_fast_len(self._count + self._logged, real=True)
        self._sides = []
        for value, there in sides:
            value = np.where(there, value, 0.0)
            self._sides.append(tuple(rfft(a, self._length) for a in (there.astype(float), value, value**2)))

    def _simulated(self, trace: Trace) -> tuple[Floats, Flags]:
        """Return a simulated signal on the grid, and where it has a value."""
        there = np.isfinite(trace.value)
        if len(trace.time) > 2 * self._count:
            index = np.round((trace.time[there] - self.start) / self.spacing).astype(np.int64)
            return _means(index, trace.value[there], self._count)
        places = Places(trace.time, np.asarray(self.start + self.spacing * np.arange(self._count), dtype=np.float64))
        value = places.values(trace.value)
        return value, places.inside & np.isfinite(value)

    def landscape(self, drift: float, reference: float) -> Landscape:
        """Return what each offset explains at a drift."""
        from scipy.fft import irfft, rfft

        gain, either = np.zeros(self._length), np.zeros(self._length)
        for trace, (mask, values, squares) in zip(self.traces, self._sides, strict=True):
            time = trace.log_time + drift * (trace.log_time - reference)
            index = np.round((time - self.log_start) / self.spacing).astype(np.int64) + 1
            measured, there = _means(np.clip(index, 0, self._logged - 1), trace.measured, self._logged)
            measured = np.where(there, measured, 0.0)
            log = [np.conj(rfft(a, self._length)) for a in (there.astype(float), measured, measured**2)]
            n = np.maximum(np.round(irfft(mask * log[0], self._length)), 1.0)
            s, ss, y, yy, sy = (
                irfft(product, self._length) / n
                for product in (values * log[0], squares * log[0], mask * log[1], mask * log[2], values * log[1])
            )
            of_s, of_y = ss - s * s, yy - y * y
            total = float(squares[0].real)
            tells = (
                (n >= FEWEST)
                & (n * of_s > _LEAST_VARIANCE * total * min(1.0, there.sum() / self._count))
                & (of_y > 1e-9)
            )
            r = np.where(tells, (sy - s * y) / np.sqrt(np.where(tells, of_s * of_y, 1.0)), 0.0)
            explained = -0.5 * n * np.log(np.maximum(1.0 - np.minimum(r * r, 1.0), _BEST_FIT))
            either += explained
            gain += np.where(r > 0.0, explained, 0.0)
        # Shift l pairs grid point j + l of the simulation with point j of the log, which begins one point before.
        shifts = np.arange(self._length)
        shifts = np.where(shifts >= self._count, shifts - self._length, shifts)
        order = np.argsort(shifts, kind="stable")
        offsets = self.start - self.log_start + (shifts[order] + 1) * self.spacing
        return Landscape(offsets, gain[order], either[order])


def _means(index: Integers, value: Floats, length: int) -> tuple[Floats, Flags]:
    counts = np.bincount(index, minlength=length)
    return np.bincount(index, value, length) / np.maximum(counts, 1), counts > 0


def peaks(height: Floats) -> Integers:
    """Return the indices of local maxima above 0, the highest first."""
    inner = height[1:-1]
    found = np.flatnonzero((inner > 0.0) & (inner >= height[:-2]) & (inner > height[2:])) + 1
    return found[np.argsort(-height[found], kind="stable")]
