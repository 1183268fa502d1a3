"""The clock of a log from all signals that move: found among all offsets, refined, and told only where data tell it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from replay.alignment.clock import ClockEstimate, Undetermined
from replay.alignment.clock_fit import ClockFit, fit_at, moved, refine, spreads
from replay.alignment.pair import SignalPair
from replay.alignment.rivals import is_refuted, is_significant
from replay.alignment.search import SearchGrid, peaks
from replay.alignment.trace import Trace, trace_of
from replay.errors import InvalidValue

LARGEST_DRIFT = 2e-3
"""Drifts up to this are looked for: clocks are better than 1e-3, good ones than 1e-4."""

_MOST_CANDIDATES = 12
_MOST_DRIFTS = 201
_MOST_LOOKED_AT = 1 << 13
"""Samples of a signal by which candidates are compared."""

_LEAST_OVERLAP = 0.2
"""Of the shorter of both, scenario and log, so much must overlap."""


def estimate_clock(
    pairs: Sequence[SignalPair], *, drift: bool, lowest: float, highest: float, confidence: float = 0.95
) -> ClockEstimate | Undetermined:
    """Return the clock of the log that all pairs are from.

    Args:
        pairs: simulated and measured signals; those that do not move say nothing.
        drift: whether the clocks may run at different speeds.
        lowest, highest: offsets between which the true one is known to be [s].
        confidence: probability with which the intervals cover the truth.

    Returns:
        the clock; or why data cannot tell it: signals that are constant or straight, several offsets that explain the
        data equally well, too little overlap, noise in which nothing is seen.

    Raises:
        InvalidValue: `lowest` is not below `highest`, or the confidence is not between 0 and 1.

    Accuracy: intervals of 95 % cover the truth in 93 to 97 % of logs (`tests/alignment/test_clock.py`).
    """
    if not (np.isfinite([lowest, highest]).all() and lowest < highest):
        raise InvalidValue("lowest, highest", f"{lowest}, {highest}", "must be finite, the first below the second")
    if not 0.0 < confidence < 1.0:
        raise InvalidValue("confidence", confidence, "must be between 0 and 1")
    made = [(pair.name, trace_of(pair)) for pair in pairs]
    traces = [trace for _, trace in made if isinstance(trace, Trace)]
    unused = tuple((name, reason) for name, reason in made if isinstance(reason, str))
    if not traces:
        return Undetermined(_nothing_moves(unused), unused=unused)
    found = _best(traces, drift, lowest, highest)
    if isinstance(found, Undetermined):
        return Undetermined(found.reason, found.candidates, unused)
    told = {signal.trace.name for signal in found.signals}
    unused += tuple((t.name, "no sample lies between frames where it moves") for t in traces if t.name not in told)
    return _told(traces, found, drift, (lowest, highest), confidence, unused)


def _nothing_moves(unused: Sequence[tuple[str, str]]) -> str:
    if not unused:
        return "there is no signal"
    name, reason = unused[0]
    more = f", and {len(unused) - 1} more like it" if len(unused) > 1 else ""
    return f"no signal tells it: {name}: {reason}{more}"


def _best(traces: Sequence[Trace], drifts: bool, lowest: float, highest: float) -> ClockFit | Undetermined:
    """Return the clock that explains most, if no other does as well."""
    few = [trace.thinned(_MOST_LOOKED_AT) for trace in traces]
    first, last = min(float(t.log_time[0]) for t in few), max(float(t.log_time[-1]) for t in few)
    reference = 0.5 * (first + last)
    grid = SearchGrid(few)
    pace = _pace(few)
    steps = min(int(LARGEST_DRIFT * pace * (last - first)), _MOST_DRIFTS // 2) if drifts else 0
    landscapes = [
        (value, grid.landscape(value, reference))
        for value in (LARGEST_DRIFT * np.arange(-steps, steps + 1) / max(steps, 1)).tolist()
    ]
    turned = max(float(land.gain.max()) for _, land in landscapes) < 0.5 * max(
        float(land.gain_either.max()) for _, land in landscapes
    )
    starts = []
    for value, land in landscapes:
        height = land.gain_either if turned else land.gain
        starts += [(-float(height[i]), float(land.offsets[i]), value) for i in peaks(height)[: 4 * _MOST_CANDIDATES]]
    starts.sort()
    apart = max(0.3 / pace, 2.0 * grid.spacing)
    candidates: list[ClockFit] = []
    taken: list[float] = []
    for loss, offset, value in starts:
        if len(taken) == _MOST_CANDIDATES or -loss < 0.1 * -starts[0][0]:
            break
        if any(abs(offset - other) < apart for other in taken):
            continue
        taken.append(offset)
        start = fit_at(few, offset, value, reference, drifts=False)
        fit = refine(few, start, reach=apart, drifts=False)
        if drifts:
            fit = refine(few, moved(few, fit, reference, drifts=True), reach=apart, drifts=True)
        if fit.signals and np.isfinite(fit.covariance).all():
            candidates.append(fit)
    if not candidates:
        return Undetermined("no offset makes measured signals move as simulated ones do")
    candidates.sort(key=lambda fit: -_told_gain(fit, turned))
    within = [fit for fit in candidates if lowest <= fit.offset <= highest]
    searched = f"{lowest:g} .. {highest:g} s"
    if not within:
        return Undetermined(f"the best offset, {candidates[0].offset:.4g} s, is not within {searched}")
    best = within[0]
    if candidates[0] is not best and is_refuted(best, candidates[0]):
        return Undetermined(f"the best offset, {candidates[0].offset:.4g} s, is not within {searched}")
    if not is_significant(best, max(int((highest - lowest) * pace), 1)):
        return Undetermined("noise hides the signals: no offset explains the log better than chance does")
    rivals = [
        fit
        for fit in within[1:]
        if abs(fit.offset - best.offset) > apart
        and _told_gain(fit, turned) > 0.25 * _told_gain(best, turned)
        and not is_refuted(fit, best)
    ]
    if rivals:
        offsets = tuple(sorted(fit.offset for fit in [best, *rivals]))
        shown = ", ".join(f"{offset:.4g}" for offset in offsets)
        return Undetermined(f"several offsets explain the log equally well: {shown} s", offsets)
    overlap = _overlap(best)
    if overlap < _LEAST_OVERLAP:
        return Undetermined(
            f"the best offset, {best.offset:.4g} s, leaves {100.0 * overlap:.0f} % of the shorter of scenario and log"
        )
    fit = moved(traces, best, reference, drifts=drifts)
    return refine(traces, fit, reach=apart, drifts=drifts)


def _told_gain(fit: ClockFit, turned: bool) -> float:
    return sum(signal.gain for signal in fit.signals if turned or signal.scale > 0.0)


def _pace(traces: Sequence[Trace]) -> float:
    """Return how fast signals of size 1 change [1/s], root mean square: offsets less than 1 / pace apart are alike."""
    squares = [float(np.nanmean(trace.lines**2)) for trace in traces]
    return float(np.sqrt(np.mean(squares)))


def _overlap(fit: ClockFit) -> float:
    """Return how much of the shorter of both, scenario and log, lies in both."""
    shares = []
    for signal in fit.signals:
        time, log_time = signal.trace.time, signal.trace.log_time
        inside = log_time[signal.used]
        shares.append((inside[-1] - inside[0]) / min(time[-1] - time[0], log_time[-1] - log_time[0]))
    return float(max(shares))


def _told(
    traces: Sequence[Trace],
    fit: ClockFit,
    drifts: bool,
    within: tuple[float, float],
    confidence: float,
    unused: tuple[tuple[str, str], ...],
) -> ClockEstimate | Undetermined:
    """Return what is said of a clock that was found."""
    fit = moved(traces, fit, _centre(fit), drifts=drifts)
    found = spreads(fit)
    halves = [spread.half(confidence) for spread in found]
    if not np.isfinite(halves).all() or halves[0] > 0.25 * (within[1] - within[0]):
        return Undetermined(f"the offset is told to +-{halves[0]:.2g} s only", unused=unused)
    if drifts and not halves[1] * (max(t.log_time[-1] for t in traces) - fit.reference) < 1.0 / _pace(traces):
        return Undetermined(
            f"the drift is told to +-{halves[1]:.2g} only; without drift there is more to tell", unused=unused
        )
    halves += [0.0] * (2 - len(halves))
    return ClockEstimate(
        fit.offset,
        fit.drift,
        fit.reference,
        offset_interval=(fit.offset - halves[0], fit.offset + halves[0]),
        drift_interval=(fit.drift - halves[1], fit.drift + halves[1]),
        confidence=confidence,
        spread=(found[0].deviation, found[1].deviation if drifts else 0.0),
        used=tuple(signal.trace.name for signal in fit.signals),
        unused=unused,
    )


def _centre(fit: ClockFit) -> float:
    """Return the log's time, to a millisecond, at which the offset is known best."""
    weights = [signal.smooth[0] ** 2 / signal.noise**2 for signal in fit.signals]
    times = [signal.trace.log_time[signal.used] for signal in fit.signals]
    total = sum(float(weight.sum()) for weight in weights)
    return round(sum(float(w @ t) for w, t in zip(weights, times, strict=True)) / total, 3)
