"""The clock of a log from all signals that move: found among all offsets, refined, and told only where data tell it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from replay.alignment.candidates import LARGEST_DRIFT, Candidates, candidates, pace, with_drift
from replay.alignment.clock import ClockEstimate, Undetermined
from replay.alignment.clock_fit import ClockFit, is_told, moved, refine, spreads
from replay.alignment.delays import signal_delays, signals_agree
from replay.alignment.pair import SignalPair
from replay.alignment.rivals import is_noticed, is_plain, is_refuted, is_significant
from replay.alignment.trace import Trace, trace_of
from replay.errors import InvalidValue

_MOST_LOOKED_AT, _LEAST_LOOKED_AT = 1 << 16, 1 << 10
"""Samples of all signals, and of one at least, by which candidates are compared."""

_LEAST_OVERLAP = 0.4
"""Of the shorter of both, scenario and log, so much must overlap."""

_RIVAL = 0.3
"""What explains less than this part of what the best clock does must be more than chance to be a rival."""

_EXACT = 1e-9
"""Times are exact to the nanosecond: no offset is told better than that [s]."""

_CLOSE = 1e-3
"""Steps of less than this part of the standard deviation change nothing."""


def estimate_clock(
    pairs: Sequence[SignalPair], *, drift: bool, lowest: float, highest: float, confidence: float = 0.95
) -> ClockEstimate | Undetermined:
    """Return the clock of the log that all pairs are from.

    Args:
        pairs: simulated and measured signals; those that do not move say nothing.
        drift: whether the clocks may run at different speeds. Where data tell that no better than within 2e-3, which
            clocks keep anyway, no drift is applied; its interval is told all the same.
        lowest, highest: offsets between which the true one is known to be [s].
        confidence: probability with which the intervals cover the truth.

    Returns:
        the clock; or why data cannot tell it: signals that are constant or straight, several offsets that explain the
        data equally well, too little overlap, noise in which nothing is seen, an offset that is not within the bounds.

    Raises:
        InvalidValue: `lowest` is not below `highest`, or the confidence is not between 0 and 1.

    Accuracy: intervals of 95 % cover the truth in 93 to 97 % of logs (`tests/alignment/test_truth.py`).
    """
    if not (np.isfinite([lowest, highest]).all() and lowest < highest):
        raise InvalidValue("lowest, highest", f"{lowest}, {highest}", "must be finite, the first below the second")
    if not 0.0 < confidence < 1.0:
        raise InvalidValue("confidence", confidence, "must be between 0 and 1")
    begins, ends = (np.array([float(pair.time[at]) for pair in pairs if len(pair.time)]) for at in (0, -1))
    beside = float(np.max(ends) - np.min(begins)) if len(begins) else 0.0  # a better offset out there is noticed
    first, last = np.min(begins, initial=np.inf) - highest - beside, np.max(ends, initial=-np.inf) - lowest + beside
    made = [(pair.name, trace_of(pair, first, last)) for pair in pairs]
    traces = [trace for _, trace in made if isinstance(trace, Trace)]
    unused = tuple((name, reason) for name, reason in made if isinstance(reason, str))
    if not traces:
        return Undetermined(_nothing_moves(unused), unused=unused)
    few = [trace.thinned(max(_MOST_LOOKED_AT // len(traces), _LEAST_LOOKED_AT)) for trace in traces]
    found = candidates(few, drifts=drift, lowest=lowest, highest=highest)
    best = _only_one(found, lowest, highest, pace(few))
    if isinstance(best, Undetermined):
        return Undetermined(best.reason, best.candidates, unused)
    fit = refine(traces, moved(traces, best, _centre(best), drifts=False), reach=found.resolution, close=_CLOSE)
    if drift:
        fit = with_drift(traces, fit, reach=found.resolution, close=_CLOSE)
    if not is_told(fit):
        return Undetermined(_between_samples(fit).reason, unused=unused)
    told = {signal.trace.name for signal in fit.signals}
    unused += tuple((t.name, "no sample lies where it moves") for t in traces if t.name not in told)
    drifts = _drift_interval(traces, fit, confidence) if drift else (0.0, 0.0, 0.0)
    return _told(fit, drifts, confidence, 0.25 * (highest - lowest), unused)


def _nothing_moves(unused: Sequence[tuple[str, str]]) -> str:
    if not unused:
        return "there is no signal"
    name, reason = unused[0]
    more = f", and {len(unused) - 1} more say as little" if len(unused) > 1 else ""
    return f"no signal tells it: {name}: {reason}{more}"


def _only_one(found: Candidates, lowest: float, highest: float, speed: float) -> ClockFit | Undetermined:
    """Return the clock that explains most, if no other does as well."""
    if not found.fits:
        return Undetermined("no offset makes measured signals move as simulated ones do")
    first = found.fits[0]
    within = [fit for fit in found.fits if lowest <= fit.offset <= highest]
    if not within or (within[0] is not first and is_refuted(within[0], first)):
        return Undetermined(f"the best offset, {first.offset:.4g} s, is not within {lowest:g} .. {highest:g} s")
    best = within[0]
    if all(map(is_plain, best.signals)):
        return Undetermined("a straight line, a plain curve or one jump explains the log as well as any offset")
    places = max(int((highest - lowest) * speed), 1)
    if not is_significant(best, places):
        return Undetermined("noise hides the signals: no offset explains the log better than chance does")
    rivals = [
        fit
        for fit in within[1:]
        if abs(fit.offset - best.offset) > found.resolution
        and not is_refuted(fit, best)
        and (
            found.gain(fit) > _RIVAL * found.gain(best)
            or (_overlap(fit) >= _LEAST_OVERLAP and is_noticed(found.telling(fit), places))
        )
    ]
    if rivals:
        offsets = tuple(sorted(fit.offset for fit in [best, *rivals]))
        shown = ", ".join(f"{offset:.4g}" for offset in offsets)
        return Undetermined(f"several offsets explain the log equally well: {shown} s", offsets)
    overlap = _overlap(best)
    if overlap < _LEAST_OVERLAP:
        part = f"{100.0 * overlap:.0f} % of the shorter of scenario and log"
        return Undetermined(f"with the best offset, {best.offset:.4g} s, they overlap in {part} only")
    return best if is_told(best) else _between_samples(best)


def _between_samples(fit: ClockFit) -> Undetermined:
    return Undetermined(f"near the best offset, {fit.offset:.4g} s, no sample lies where the signals move")


def _overlap(fit: ClockFit) -> float:
    """Return how much of the shorter of both, scenario and log, lies in both."""
    shares = []
    for signal in fit.signals:
        time, log_time = signal.trace.time, signal.trace.log_time
        inside = log_time[signal.used]
        shares.append((inside[-1] - inside[0]) / min(time[-1] - time[0], log_time[-1] - log_time[0]))
    return float(max(shares))


def _centre(fit: ClockFit) -> float:
    """Return the log's time, to a millisecond, at which the offset is known best."""
    weights = [signal.smooth[0] ** 2 / signal.noise**2 for signal in fit.signals]
    total = sum(float(weight.sum()) for weight in weights)
    moments = [float((w * signal.log_time).sum()) for w, signal in zip(weights, fit.signals, strict=True)]
    return round(sum(moments) / total, 3)


def _drift_interval(traces: Sequence[Trace], fit: ClockFit, confidence: float) -> tuple[float, float, float]:
    """Return the interval that covers the drift, -1 .. 1 where nothing tells it, and the standard deviation.

    Where the drift was not looked for, as it is told too badly, one step from the clock that was found says enough.
    """
    both = fit if len(fit.step) > 1 else moved(traces, fit, fit.reference, drifts=True)
    if not np.isfinite(both.covariance).all():
        return -1.0, 1.0, LARGEST_DRIFT
    spread, middle = spreads(both)[1], both.drift + float(both.step[1])
    half = spread.half(confidence)
    return max(middle - half, -1.0), min(middle + half, 1.0), min(spread.deviation, LARGEST_DRIFT)


def _told(
    fit: ClockFit,
    drift: tuple[float, float, float],
    confidence: float,
    widest: float,
    unused: tuple[tuple[str, str], ...],
) -> ClockEstimate | Undetermined:
    """Return what is said of a clock that was found.

    Args:
        fit: at the time at which its offset is known best.
        drift: its interval and standard deviation.
        confidence: of the intervals.
        widest: half of the widest interval that is an answer [s].
        unused: signals, with reasons.
    """
    spread = spreads(fit)[0]
    half = max(spread.half(confidence), _EXACT + 4.0 * float(np.spacing(np.max(np.abs([fit.offset, fit.reference])))))
    if not half <= widest:
        return Undetermined(f"the offset is told to +-{half:.2g} s only", unused=unused)
    delays = signal_delays(fit, confidence)
    agree = signals_agree(delays)
    low, high = fit.offset - half, fit.offset + half
    if not agree:
        low = min([low, *(fit.offset - delay.interval[1] for delay in delays)])
        high = max([high, *(fit.offset - delay.interval[0] for delay in delays)])
    wider = max(high - fit.offset, fit.offset - low) / half
    return ClockEstimate(
        fit.offset,
        fit.drift,
        fit.reference,
        offset_interval=(low, high),
        drift_interval=drift[:2],
        confidence=confidence,
        spread=(spread.deviation * wider, drift[2]),
        used=tuple(signal.trace.name for signal in fit.signals),
        unused=unused,
        delays=delays,
        agree=agree,
    )
