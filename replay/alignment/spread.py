"""How far an estimate may be off, where the errors it rests on are coloured and are not equal everywhere.

An estimate is off by  sum_j a_j e_j, a_j its sensitivity to sample j, e_j that sample's error, of which the residual
is what we see. If errors were independent and of one size, its variance would be  sum a_j^2 s_j^2. Errors of models,
of rounding and of time stamps are neither. Let u in 0..1 be the share of sum a_j^2 s_j^2 that lies before sample j,
and

    L_k = sum_j cos(pi k u_j) a_j r_j,   k = 1 .. m.

Each L_k is as large as the estimate's error in the mean, as long as errors forget within a m-th of the whole, whatever
their colour and wherever they are large; they are orthogonal to the estimate itself, whose sum is 0. Their mean square
is the variance, and (estimate - truth) / spread has Student's t-distribution of m degrees of freedom, nearly.

How nearly is known for errors that are independent: residuals are r = M e, M being the projection off what was fitted,
so that the L_k have the covariance  K_kl = q_k' M q_l  with  q_kj = cos(pi k u_j) a_j s_j. The mean square is divided
by trace K / sum a_j^2 s_j^2, and (trace K)^2 / |K|^2 are the degrees of freedom: m for many samples, fewer where few
samples decide.

Source: U. K. Müller, HAC corrections for strongly autocorrelated time series, J. Bus. Econ. Stat. 32 (2014), for
cosines; E. Lazarus, D. J. Lewis, J. H. Stock, M. W. Watson, HAR inference, J. Bus. Econ. Stat. 36 (2018), for their
equal weights; R. M. Bell and D. F. McCaffrey, Survey Methodology 28 (2002), for K. The time u of information: derived
here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.numerics.arrays import Floats, Integers

COSINES = 12
"""With them an interval is 1.11 of what it would be if the variance were known."""

BINS = 1024
"""Parts of the time in which samples are taken together."""


@dataclass(frozen=True)
class Spread:
    """What is known of an estimate's error.

    Attributes:
        seen: standard deviation that residuals show, in the estimate's unit.
        freedom: degrees of freedom of that number.
        hidden: standard deviation by what is interpolated and may be off.
    """

    seen: float
    freedom: float
    hidden: float

    @property
    def deviation(self) -> float:
        """Standard deviation, in the estimate's unit."""
        return float(np.hypot(self.seen, self.hidden))

    def half(self, confidence: float, besides: float = 0.0) -> float:
        """Return half the width of the interval that covers the truth with a probability.

        Args:
            confidence: the probability.
            besides: standard deviation of an error of another cause, in the estimate's unit.
        """
        from scipy.special import ndtri, stdtrit

        upper = 0.5 + 0.5 * confidence
        seen = stdtrit(self.freedom, upper) * np.hypot(self.seen, besides)
        return float(np.hypot(seen, ndtri(upper) * self.hidden))


class SpreadSums:
    """Sums over samples, by bins of time, from which the spread of one estimate follows.

    Attributes:
        first, last: between these times all samples lie [s].
    """

    def __init__(self, first: float, last: float) -> None:
        self.first = first
        self.last = last
        self.errors = np.zeros(BINS)
        self.information = np.zeros(BINS)
        self.hidden, self.common = 0.0, 0.0
        self.fitted: list[Floats] = []

    def bins(self, time: Floats) -> Integers:
        """Return the bin of each time."""
        return np.clip((time - self.first) * (BINS / max(self.last - self.first, 1e-300)), 0, BINS - 1).astype(np.int64)

    def add(self, bins: Integers, weight: Floats, residual: Floats, noise: float, columns: Floats) -> None:
        """Take in the samples of one signal.

        Args:
            bins: (n,) of its samples.
            weight: (n,) the estimate's sensitivity to them.
            residual: (n,)
            noise: standard deviation of the residuals.
            columns: (p, n) orthonormal; what was fitted to this signal alone.
        """
        self.errors += np.bincount(bins, weight * residual, BINS)
        self.information += np.bincount(bins, (weight * noise) ** 2, BINS)
        self.fitted.extend(np.asarray(np.bincount(bins, weight * noise * column, BINS)) for column in columns)

    def hide(self, weight: Floats, off_lines: Floats, off_jumps: Floats) -> None:
        """Take in how far what is interpolated may be off, which residuals may hide: they are fitted.

        Args:
            weight: (n,) as in `add`.
            off_lines: (n,) at each sample by itself.
            off_jumps: (n,) at all alike: jumps at round times are all as far from the frame before.
        """
        self.hidden += float(((weight * off_lines) ** 2).sum())
        self.common += float(np.abs(weight * off_jumps).sum())

    def spread(self, shared: Floats) -> Spread:
        """Return the spread.

        Args:
            shared: (p, BINS) sums of weight * noise * column, for orthonormal columns fitted to all signals together.
        """
        total = float(self.information.sum())
        if not total > 0.0:
            return Spread(0.0, float(COSINES), 0.0)
        u = (np.cumsum(self.information) - 0.5 * self.information) / total
        cosines = np.cos(np.pi * np.arange(1, COSINES + 1)[:, None] * u)
        seen = (cosines * self.errors).sum(axis=1)
        K = np.einsum("kb,lb,b->kl", cosines, cosines, self.information)
        off = np.einsum("pb,kb->pk", np.vstack([*self.fitted, *shared]), cosines)
        K -= np.einsum("pk,pl->kl", off, off)
        trace = float(np.trace(K))
        if not trace > 1e-9 * total:
            return Spread(np.inf, 1.0, 0.0)
        variance = float((seen**2).sum()) / trace * total
        freedom = max(trace**2 / float(np.sum(K * K)), 1.0)
        return Spread(float(np.sqrt(variance)), freedom, float(np.hypot(np.sqrt(self.hidden), self.common)))
