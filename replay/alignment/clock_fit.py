"""The clock that makes measured samples fit simulated signals best, by Gauss and Newton's way.

Sample j of signal k, at the time t_j of the log, is measured as

    y_kj = scale_k s_k(t_j + offset + drift (t_j - reference)) + bias_k + noise,

s_k being the simulated signal on straight lines. For a given clock scale and bias are linear least squares, so that
they are eliminated (variable projection): with P the projection off 1 and s_k, the residual is r_k = P y_k, and with
D_k the derivatives with regard to the clock, the step solves

    sum_k (P G_k)' D_k / n_k^2 step = sum_k (P G_k)' r_k / n_k^2,    n_k^2 = r_k' r_k / (samples - 2).

G_k is D_k with the slopes at the frames, interpolated, instead of those of the lines: what is 0 at the end then varies
smoothly with the clock, where the sum of squares has a kink wherever a sample passes a frame. Measured noise is in y
alone, never in s, so that neither biases the other.

Source: G. Golub and V. Pereyra, Inverse Problems 19 (2003), for the elimination.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from replay.alignment.between import Places
from replay.alignment.spread import BINS, Spread, SpreadSums
from replay.alignment.trace import FEWEST, Trace
from replay.numerics.arrays import Flags, Floats

_MOST_STEPS = 30
_SINGULAR = 1e10
"""Condition of the equations for the clock above which they do not determine it."""

_LEAST_OWN = 1e-3
"""A derivative of which less than this part is not a change of scale and bias tells nothing: rounding, an end."""

_EXACT = 1e-12
"""Residuals below this part of a signal's size are rounding."""


@dataclass(frozen=True, eq=False)
class SignalFit:
    """One signal at one clock.

    Attributes:
        trace: its samples.
        used: (m,) whether a sample lies between two frames that have a value.
        residual: (u,) of those, of measured size 1.
        off_lines: (u,) how far lines between frames may be off there.
        off_jumps: (u,) how far by jumps, of which it is known between which frames they are.
        farther: (u,) by how many times this a jump may be off in time, as it is also between two samples.
        noise: standard deviation of both.
        scale: by which the simulated signal of size 1 is best multiplied.
        gain: logarithm of the likelihood over that of a constant; 0 where nothing can be said.
        measured: (u,) of the samples used, off their mean.
        simulated: (u,) orthonormal to 1.
        smooth: (p, u) derivatives with regard to the clock, smooth ones, off 1 and `simulated`.
        exact: (p, u) those of the lines.
    """

    trace: Trace
    used: Flags
    residual: Floats
    off_lines: Floats
    off_jumps: Floats
    farther: Floats
    noise: float
    scale: float
    gain: float
    measured: Floats
    simulated: Floats
    smooth: Floats
    exact: Floats

    @property
    def log_time(self) -> Floats:
        """(u,) times of the samples used [s]."""
        return self.trace.log_time[self.used]

    def gain_of(self, squares: float) -> float:
        """Return the gain of whatever leaves so large a sum of squares."""
        total = float((self.measured**2).sum())
        return 0.5 * len(self.measured) * float(np.log(total / max(squares, total * _EXACT**2)))

    @property
    def columns(self) -> Floats:
        """(2, u) orthonormal: what bias and scale were fitted with."""
        return np.array([np.full(len(self.residual), 1.0 / np.sqrt(len(self.residual))), self.simulated])


@dataclass(frozen=True, eq=False)
class ClockFit:
    """All signals at one clock.

    Attributes:
        offset, drift: of the clock [s, 1].
        reference: the log's time at which the clock is off by `offset` [s].
        signals: those that have samples between frames.
        step: (p,) to the best clock, as far as lines tell it: of offset and, where asked for, drift.
        covariance: (p, p) of `step` if all errors were independent and of one size; infinite where nothing tells it.
    """

    offset: float
    drift: float
    reference: float
    signals: tuple[SignalFit, ...]
    step: Floats
    covariance: Floats

    @property
    def gain(self) -> float:
        """Logarithm of the likelihood over that of constants, of all signals."""
        return sum(signal.gain for signal in self.signals)

    @property
    def samples(self) -> int:
        """Samples that lie between frames, of all signals."""
        return sum(len(signal.residual) for signal in self.signals)


def fit_at(traces: Sequence[Trace], offset: float, drift: float, reference: float, *, drifts: bool) -> ClockFit:
    """Return how all signals fit at a clock."""
    signals = [_signal_at(trace, offset, drift, reference, drifts) for trace in traces]
    there = tuple(signal for signal in signals if signal is not None)
    unknowns = 2 if drifts else 1
    normal, right = np.zeros((unknowns, unknowns)), np.zeros(unknowns)
    for signal in there:
        normal += _products(signal.smooth, signal.exact) / signal.noise**2
        right += (signal.smooth * signal.residual).sum(axis=1) / signal.noise**2
    covariance = _inverse(normal)
    step = covariance @ right if np.isfinite(covariance).all() else np.zeros(unknowns)
    return ClockFit(offset, drift, reference, there, step, covariance)


def _products(a: Floats, b: Floats) -> Floats:
    """Return the scalar products of rows; not by BLAS, whose sums depend on the number of its threads."""
    return np.asarray(np.einsum("in,jn->ij", a, b))


def _inverse(normal: Floats) -> Floats:
    """Return the inverse of a matrix of one or two rows, infinite where it has none."""
    diagonal = np.diag(normal)
    if (diagonal > 0.0).all():
        size = np.sqrt(diagonal)
        scaled = normal / np.outer(size, size)
        if np.linalg.cond(scaled) < _SINGULAR:
            return np.asarray(np.linalg.inv(scaled) / np.outer(size, size))
    return np.full(normal.shape, np.inf)


def _signal_at(trace: Trace, offset: float, drift: float, reference: float, drifts: bool) -> SignalFit | None:
    since = trace.log_time - reference
    places = Places(trace.time, trace.log_time + offset + drift * since)
    simulated = places.values(trace.value)
    used = places.inside & np.isfinite(simulated)
    count = int(used.sum())
    if count < FEWEST:
        return None
    s, y = simulated[used], trace.measured[used]
    s = s - s.mean()
    y = y - y.mean()
    norm, size = float(np.sqrt((s**2).sum())), float((y**2).sum())
    if not (norm > 1e-6 * np.sqrt(count) and size > 1e-12 * count):
        return None
    s /= norm
    along = float((s * y).sum())
    residual = y - along * s
    squares = max(float((residual**2).sum()), size * _EXACT**2)
    gain = 0.5 * count * np.log(size / squares)
    smooth, exact = places.values(trace.slopes)[used], trace.lines[places.index[used]]
    smooth, exact = ((slope * (along / norm))[None] for slope in (smooth, exact))
    if drifts:
        smooth, exact = (np.vstack([slope, slope * since[used]]) for slope in (smooth, exact))
    length = np.sqrt((smooth**2).sum(axis=1))
    smooth -= smooth.mean(axis=1)[:, None]
    smooth -= (smooth * s).sum(axis=1)[:, None] * s
    smooth[np.sqrt((smooth**2).sum(axis=1)) < _LEAST_OWN * length] = 0.0
    scale = along / norm
    at = places.index[used]
    off_lines = scale * trace.bends[at]
    intervals = np.diff(trace.log_time)
    sampled = np.maximum(np.append(0.0, intervals), np.append(intervals, 0.0))[used]
    off_jumps, farther = scale * trace.jumps[at], 1.0 + sampled / np.diff(trace.time)[at]
    noise = float(np.sqrt(squares / (count - 2) + np.mean(off_lines**2 + off_jumps**2)))
    return SignalFit(
        trace, used, residual, off_lines, off_jumps, farther, noise, scale, float(gain), y, s, smooth, exact
    )


def refine(traces: Sequence[Trace], start: ClockFit, *, reach: float, close: float) -> ClockFit:
    """Return the best clock near one.

    Args:
        traces: the signals.
        start: a clock, whose drift is looked for if it has a step for it.
        reach: longest step of the offset [s].
        close: a step of less than this part of the standard deviation is the last.
    """
    best, step, drifts = start, start.step, len(start.step) > 1
    for _ in range(_MOST_STEPS):
        step = step * min(1.0, reach / max(abs(float(step[0])), 1e-300))
        if not np.isfinite(best.covariance).all() or (step**2 <= close**2 * np.diag(best.covariance)).all():
            break
        drift = best.drift + (float(step[1]) if drifts else 0.0)
        tried = fit_at(traces, best.offset + float(step[0]), drift, best.reference, drifts=drifts)
        if _is_worse(tried, best):
            step = 0.5 * step
        else:
            best, step = tried, tried.step
    return best


def _is_worse(tried: ClockFit, best: ClockFit) -> bool:
    """Return whether a clock fits worse than another, by the samples that both use: at the ends, these come and go."""
    known = {signal.trace.name: signal for signal in best.signals}
    loss, common = 0.0, 0
    for signal in tried.signals:
        other = known.get(signal.trace.name)
        if other is not None:
            both = signal.used & other.used
            mine, theirs = (float((one.residual[both[one.used]] ** 2).sum()) for one in (signal, other))
            common += int(both.sum())
            exact = len(signal.measured) * _EXACT**2
            loss += 0.5 * int(both.sum()) * float(np.log(max(mine, exact) / max(theirs, exact)))
    return loss > 0.1 or not common


def moved(traces: Sequence[Trace], fit: ClockFit, reference: float, *, drifts: bool) -> ClockFit:
    """Return the same clock, with its offset at another time of the log."""
    return fit_at(traces, fit.offset + fit.drift * (reference - fit.reference), fit.drift, reference, drifts=drifts)


def is_told(fit: ClockFit) -> bool:
    """Return whether samples tell the offset at all: of a jump that they pass by, none lies where it moves."""
    return bool(np.isfinite(fit.covariance).all())


def spreads(fit: ClockFit) -> tuple[Spread, ...]:
    """Return how far each number of a clock may be off once its step is taken: offset and, where looked for, drift."""
    times = [signal.log_time for signal in fit.signals]
    first, last = min(float(t[0]) for t in times), max(float(t[-1]) for t in times)
    square = sum(_products(s.smooth, s.smooth) / s.noise**2 for s in fit.signals)
    whitening = np.linalg.inv(np.linalg.cholesky(square))
    results = []
    for number in range(len(fit.step)):
        sums, shared = SpreadSums(first, last), np.zeros((len(fit.step), BINS))
        for signal, time in zip(fit.signals, times, strict=True):
            weight = (fit.covariance[number][:, None] * signal.smooth).sum(axis=0) / signal.noise**2
            bins = sums.bins(time)
            left = signal.residual - (fit.step[:, None] * signal.smooth).sum(axis=0)
            sums.add(bins, weight, left, signal.noise, signal.columns)
            sums.hide(weight, signal.off_lines, signal.off_jumps * signal.farther)
            together = _products(whitening, signal.smooth.T)
            for row, column in zip(shared, together, strict=True):
                row += np.bincount(bins, weight * column, BINS)
        results.append(sums.spread(shared))
    return tuple(results)
