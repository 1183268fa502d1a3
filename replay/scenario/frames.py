"""The times of a scenario's frames, in exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np

from replay.errors import InvalidValue
from replay.numerics.arrays import Floats, Integers
from replay.numerics.constants import SECOND

_SAFE = 2**62


def time_ns(rate: Fraction, begin: int, end: int) -> Integers:
    """Return the times (end - begin,) [ns] of frames begin..end-1: k / rate, rounded half to even.

    Args:
        rate: frames per second.
        begin, end: frame indices, 0 <= begin <= end.

    Raises:
        InvalidValue: a time does not fit into 64 bits.
    """
    # k / rate = k (q + r / n) ns with q, r = divmod(10^9 d, n) for a rate of n / d
    n, d = rate.numerator, rate.denominator
    q, r = divmod(SECOND * d, n)
    if end * (q + 1) >= _SAFE:
        raise InvalidValue("end", end, f"frames at {rate} Hz that late do not fit into 64 bits of nanoseconds")
    if end * r < _SAFE and 2 * n < _SAFE:
        k = np.arange(begin, end, dtype=np.int64)
        whole = k * q + (k * r) // n
        twice = 2 * ((k * r) % n)
        up = (twice > n) | ((twice == n) & (whole % 2 == 1))
        return np.where(up, whole + 1, whole)
    return np.array([round(Fraction(k) * SECOND / rate) for k in range(begin, end)], dtype=np.int64)


def seconds(rate: Fraction, begin: int, end: int) -> Floats:
    """Return the times (end - begin,) [s] of frames begin..end-1: the doubles nearest to their nanoseconds.

    A frame is computed at the time that is recorded, so that a recording plays back to the same bits.
    """
    return time_ns(rate, begin, end) / 1e9
