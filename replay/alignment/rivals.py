"""Whether one clock explains a log so much better than another that the other is out of the question."""

from __future__ import annotations

import numpy as np

from replay.alignment.clock_fit import ClockFit, SignalFit, spreads

_CERTAIN = 6.0
"""Logarithm of the odds at which a clock is out of the question."""

_CHANCE = 1e-4
"""Probability that noise alone is taken for a signal."""


def is_refuted(fit: ClockFit, better: ClockFit) -> bool:
    """Return whether a clock is out of the question, as another explains the same samples better.

    Samples that only the other explains say nothing against it: of a periodic motion, the clock with the largest
    overlap is not the likelier one. With the noise n of the better fit, on the samples of this one

        2 log odds = sum r^2 / n^2 - 1  -  sum over those of both  r_better^2 / n^2 - 1,

    of which the first sum has the variance 2 for each sample that is not in the second. Coloured errors make all of it
    larger by their colour.
    """
    best = {signal.trace.name: signal for signal in better.signals}
    odds, alone = 0.0, 0
    for signal in fit.signals:
        other = best.get(signal.trace.name)
        if other is None:
            continue
        noise = other.noise**2 + _between_frames(other) ** 2
        mine, theirs = (np.zeros(len(signal.used)) for _ in range(2))
        mine[signal.used] = signal.residual**2 / noise - 1.0
        theirs[other.used] = other.residual**2 / noise - 1.0
        odds += 0.5 * float(np.sum(mine[signal.used]) - np.sum(theirs[signal.used & other.used]))
        alone += int(np.sum(signal.used & ~other.used))
    return bool(odds > (_CERTAIN + 3.0 * np.sqrt(0.5 * alone)) * max(1.0, spreads(better)[0].colour))


def is_significant(fit: ClockFit, places: int) -> bool:
    """Return whether a clock explains more than chance does at the best of so many places."""
    from scipy.special import chdtri

    needed = 0.5 * float(chdtri(len(fit.signals), _CHANCE / places))
    return fit.gain / max(1.0, spreads(fit)[0].colour) > needed


def _between_frames(signal: SignalFit) -> float:
    """Return how far lines between frames may be off: an eighth of the second differences, root mean square."""
    value = signal.trace.value
    bends = value[2:] - 2.0 * value[1:-1] + value[:-2]
    bends = bends[np.isfinite(bends)]
    return abs(signal.scale) * float(np.sqrt(np.mean(bends**2))) / 8.0 if len(bends) else 0.0
