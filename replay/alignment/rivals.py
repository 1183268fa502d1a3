"""Whether a clock is more than chance, and whether another one is out of the question beside it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from replay.alignment.clock_fit import ClockFit, SignalFit
from replay.numerics.arrays import Floats

_CERTAIN = 6.0
"""Logarithm of the odds at which a clock is out of the question."""

_ALIKE_RESIDUALS = 2.0
"""Residuals that are no more times as large, at another time and in proportion, are alike."""

_CHANCE = 1e-4
"""Probability that what has nothing to do with the simulated signals is taken for them."""

_WHITE = 0.8
"""Errors are independent where they are worth this part of their number."""

_ALIKE = 0.9
"""Part of the variance above which coloured errors are a model's."""

_LOOSE = 4.0
"""Lines are off by so many times what they are in the mean where a corner or a jump is between frames."""

_FITTED = 3.0
"""Scale, offset, and one more as the best of neighbours is taken."""


def is_refuted(fit: ClockFit, better: ClockFit) -> bool:
    """Return whether a clock is out of the question, as another explains the same samples better.

    Samples that only the other explains say nothing against it: of a periodic motion, the one with the largest overlap
    is not the likelier one. With the noise n of the better fit, the samples of this one say

        2 log odds = sum over those of both (r^2 - r_better^2) / n^2  +  sum over its own (r / f n)^2 - 1,

    the second sum if it is above 0: it has the variance 2 for each sample. What was done twice is not explained better
    where it was done at a smaller amplitude, as jitter and errors of models grow with it, nor are these the same at all
    times: f is 2, and as many times more as the scale is larger. Errors that last several samples make all of it larger
    by their number. What lines between frames may be off is as large as its square more or less in the one and in the
    other, at corners and jumps up to `_LOOSE` times as much.
    """
    best = {signal.trace.name: signal for signal in better.signals}
    odds, own, hidden, alone = 0.0, 0.0, 0.0, 0
    for signal in fit.signals:
        other = best.get(signal.trace.name)
        if other is None:
            continue
        noise = other.noise**2
        both, mine = other.used[signal.used], signal.residual**2 / noise
        theirs = other.residual[signal.used[other.used]] ** 2 / noise
        odds += 0.5 * float(np.sum(mine[both]) - np.sum(theirs))
        louder = _ALIKE_RESIDUALS**2 * max(1.0, (signal.scale / other.scale) ** 2)
        own += 0.5 * float(np.sum(mine[~both] / louder - 1.0))
        hidden += 0.5 * _LOOSE**2 * float(np.sum(signal.off_lines**2 + signal.off_jumps**2)) / noise
        alone += int(np.sum(~both))
    independent = sum(map(_independent, better.signals))
    certain = (_CERTAIN + 3.0 * np.sqrt(0.5 * alone)) * better.samples / independent
    return bool(odds + max(own, 0.0) > certain + hidden)


def is_significant(fit: ClockFit, places: int) -> bool:
    """Return whether a clock explains more than it would, at the best of so many places, of what wanders by itself.

    Of each signal the part R^2 of the variance that is explained, of which the gain is the logarithm, is held against
    chance as in a regression: 1 - R^2 of n independent errors, p of them fitted, has a beta distribution of (n - p) / 2
    and p / 2. Chances of several signals are taken together as by Fisher (1925). A signal that is like a plain curve
    says nothing.
    """
    from scipy.special import betainc, gammaincc

    surprise = 0.0
    for signal in fit.signals:
        free = _independent_by_chance(signal) - _FITTED - 1.0
        if free > 0.0 and not is_plain(signal):
            left = float(np.exp(-2.0 * signal.gain / len(signal.residual)))
            surprise -= float(np.log(max(betainc(0.5 * free, 0.5 * _FITTED, left), 1e-300)))
    return float(gammaincc(len(fit.signals), surprise)) * places < _CHANCE


def is_noticed(signals: Sequence[SignalFit], places: int) -> bool:
    """Return whether signals say more for a clock than white noise does for the best of so many places.

    Of what a motion is that was done again at a small amplitude little is seen, down to what noise leaves of it.
    """
    odds = sum(signal.gain * _independent(signal) / len(signal.residual) for signal in signals if not is_plain(signal))
    return bool(odds > _CERTAIN + np.log(places))


def is_plain(signal: SignalFit) -> bool:
    """Return whether a curve that anything is like for a while explains what was measured as well as the simulation.

    A straight line is the same at any offset, and must be clearly worse; a cubic curve and one jump have as many
    unknowns as scale, bias and offset, or one more, and must not be clearly better.
    """
    y, size = signal.measured, len(signal.residual)
    total = float((y**2).sum())
    time = signal.log_time - signal.log_time[0]
    powers = np.polynomial.legendre.legvander(2.0 * time / time[-1] - 1.0, 3)
    line, cubic = (_left(y, powers[:, : degree + 1]) for degree in (1, 3))
    before = np.arange(1, size)
    jump = total - float(np.max(np.cumsum(y)[:-1] ** 2 * size / (before * (size - before))))
    certain = _CERTAIN * size / _independent(signal)
    gains = (signal.gain_of(left) + sure for left, sure in ((line, certain), (cubic, -certain), (jump, -certain)))
    return max(gains) > signal.gain


def _left(y: Floats, columns: Floats) -> float:
    """Return the sum of squares that a regression leaves."""
    basis = np.linalg.qr(columns)[0]
    along = np.einsum("nk,n->k", basis, y)
    return float(((y - np.einsum("nk,k->n", basis, along)) ** 2).sum())


def _independent(signal: SignalFit) -> float:
    """Return how many independent errors a signal's samples are worth to its scale.

    Of two series of n samples with the autocorrelations a and b, the correlation varies as if there were
    n / (1 + 2 sum (1 - l/n) a_l b_l) independent ones (Bartlett 1935); here they are residual and simulated signal.
    """
    return _worth(signal.residual, signal.simulated)


def _independent_by_chance(signal: SignalFit) -> float:
    """Return how many it would be worth if it had nothing to do with the simulated signal.

    Then all of it is error. What fits to noise, or nearly, is like the simulated signal down to what is not: only
    where residuals are large and coloured is it asked how often two such signals are that much alike.
    """
    number, n = _independent(signal), len(signal.residual)
    explained = 1.0 - float(np.exp(-2.0 * signal.gain / n))
    if number > _WHITE * n or explained > _ALIKE:
        return number
    return min(number, _worth(signal.measured, signal.simulated))


def _worth(first: Floats, second: Floats) -> float:
    n = len(first)
    products = _autocorrelation(first) * _autocorrelation(second)
    return n / max(1.0, 1.0 + 2.0 * float(np.sum((1.0 - np.arange(1, n) / n) * products[1:])))


def _autocorrelation(values: Floats) -> Floats:
    from scipy.fft import irfft, next_fast_len, rfft

    length = next_fast_len(2 * len(values), real=True)
    products = irfft(np.abs(rfft(values, length)) ** 2, length)[: len(values)]
    return np.asarray(products / products[0] if products[0] > 0.0 else np.zeros(len(values)))
