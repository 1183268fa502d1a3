"""Whether a clock is more than chance, and whether another one is out of the question beside it."""

from __future__ import annotations

import numpy as np

from replay.alignment.clock_fit import ClockFit
from replay.numerics.arrays import Floats

_CERTAIN = 6.0
"""Logarithm of the odds at which a clock is out of the question."""

_CHANCE = 1e-4
"""Probability that what has nothing to do with the simulated signals is taken for them."""


def is_refuted(fit: ClockFit, better: ClockFit) -> bool:
    """Return whether a clock is out of the question, as another explains the same samples better.

    Samples that only the other explains say nothing against it: of a periodic motion, the one with the largest overlap
    is not the likelier one. With the noise n of the better fit, the samples of this one say

        2 log odds = sum r^2 / n^2 - 1  -  sum over those of both  r_better^2 / n^2 - 1,

    of which the first sum has the variance 2 for each sample that is not in the second. Errors that last several
    samples make all of it larger by their number.
    """
    best = {signal.trace.name: signal for signal in better.signals}
    odds, alone = 0.0, 0
    for signal in fit.signals:
        other = best.get(signal.trace.name)
        if other is None:
            continue
        noise = other.noise**2
        mine, theirs = (np.zeros(len(signal.used)) for _ in range(2))
        mine[signal.used] = signal.residual**2 / noise - 1.0
        theirs[other.used] = other.residual**2 / noise - 1.0
        odds += 0.5 * float(np.sum(mine[signal.used]) - np.sum(theirs[signal.used & other.used]))
        alone += int(np.sum(signal.used & ~other.used))
    return bool(odds > (_CERTAIN + 3.0 * np.sqrt(0.5 * alone)) * better.samples / _independent(better))


def is_significant(fit: ClockFit, places: int) -> bool:
    """Return whether a clock explains more than it would, at the best of so many places, of what wanders by itself.

    The part R^2 of the variance that is explained, of which the gain is the logarithm, is held against chance as in a
    regression: 1 - R^2 of n independent errors, p of them fitted, has a beta distribution of (n - p) / 2 and p / 2.
    """
    from scipy.special import betainc

    fitted = len(fit.signals) + 2  # their scales, the offset, and one more as the best of neighbours is taken
    free = _independent(fit) - fitted - 1.0
    if not free > 0.0:
        return False
    left = float(np.exp(-2.0 * fit.gain / fit.samples))
    return float(betainc(0.5 * free, 0.5 * fitted, left)) * places < _CHANCE


def _independent(fit: ClockFit) -> float:
    """Return how many independent errors a fit's samples are worth to its scales.

    Of two series of n samples with the autocorrelations a and b, the correlation varies as if there were
    n / (1 + 2 sum (1 - l/n) a_l b_l) independent ones (Bartlett 1935); here they are residual and simulated signal.
    """
    number = 0.0
    for signal in fit.signals:
        n = len(signal.residual)
        products = _autocorrelation(signal.residual) * _autocorrelation(signal.simulated)
        number += n / max(1.0, 1.0 + 2.0 * float(np.sum((1.0 - np.arange(1, n) / n) * products[1:])))
    return number


def _autocorrelation(values: Floats) -> Floats:
    from scipy.fft import irfft, next_fast_len, rfft

    length = next_fast_len(2 * len(values), real=True)
    products = irfft(np.abs(rfft(values, length)) ** 2, length)[: len(values)]
    return np.asarray(products / products[0] if products[0] > 0.0 else np.zeros(len(values)))
