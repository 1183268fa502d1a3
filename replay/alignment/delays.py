"""What each signal says of the clock by itself, and whether they agree."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from replay.alignment.clock import SignalDelay
from replay.alignment.clock_fit import ClockFit, SignalFit
from replay.alignment.spread import BINS, Spread, SpreadSums

_DISAGREE = 1e-3
"""Probability with which signals that agree are taken to disagree."""


def signal_delays(fit: ClockFit, confidence: float) -> tuple[SignalDelay, ...]:
    """Return the delay of each signal beside the clock of all, by one step of its own; none where there is one signal.

    A signal that says nothing by itself has none.
    """
    if len(fit.signals) < 2:
        return ()
    found = []
    for signal in fit.signals:
        own = _own_step(signal)
        if own is not None:
            step, spread = own
            half = spread.half(confidence)
            found.append(
                SignalDelay(signal.trace.name, -step, (-step - half, -step + half), spread.deviation, spread.freedom)
            )
    return tuple(found)


def _own_step(signal: SignalFit) -> tuple[float, Spread] | None:
    smooth = signal.smooth[0]
    information = float((smooth * signal.exact[0]).sum())
    length = float(np.sqrt((smooth**2).sum()))
    if not information > 1e-6 * length**2:
        return None
    weight = smooth / information
    step = float((weight * signal.residual).sum())
    time = signal.log_time
    sums = SpreadSums(float(time[0]), float(time[-1]))
    bins = sums.bins(time)
    sums.add(bins, weight, signal.residual - step * smooth, signal.noise, signal.columns)
    sums.hide(weight, signal.off_lines, signal.off_jumps * signal.farther)
    spread = sums.spread(np.asarray([np.bincount(bins, weight * signal.noise * smooth / length, BINS)]))
    return (step, spread) if 0.0 < spread.deviation < np.inf else None


def signals_agree(delays: Sequence[SignalDelay]) -> bool:
    """Return whether delays differ by no more than chance: weighted squares about their mean against F.

    Source: W. G. Cochran, The combination of estimates from different experiments, Biometrics 10 (1954).
    """
    from scipy.special import fdtri

    if len(delays) < 2:
        return True
    delay = np.array([one.delay for one in delays])
    weight = np.array([one.deviation for one in delays]) ** -2.0
    mean = float((weight * delay).sum() / weight.sum())
    squares = float((weight * (delay - mean) ** 2).sum()) / (len(delays) - 1)
    return squares <= float(fdtri(len(delays) - 1, min(one.freedom for one in delays), 1.0 - _DISAGREE))
