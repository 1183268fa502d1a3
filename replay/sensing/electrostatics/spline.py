"""The cubic spline through keys whose third derivative does not jump at the second and the last but one (not-a-knot).

With h_i the distance of keys i and i + 1 and M_i the second derivatives, h_(i-1) M_(i-1) + 2 (h_(i-1) + h_i) M_i + h_i
M_(i+1) = 6 (slope_i - slope_(i-1)); the ends follow from M_0 = M_1 + (M_1 - M_2) h_0/h_1 and alike, so what is left is
solved by elimination along the diagonal. Two keys make a line, three a parabola.
"""

from __future__ import annotations

import numpy as np

from replay.numerics.arrays import Floats

_UNSEEN = 1e-4
"""Mean square of a guide about its straight line that counts half: what it tells of less is doubtful."""


def guided(keys: Floats, values: Floats, at: Floats, guide: Floats, guide_at: Floats) -> Floats:
    """Return the values (m, c) at m places of b guide + spline through n >= 1 keys.

    b is, of each column, the slope by which values follow their guide, both taken from their straight lines over the
    keys: what a guide that is known everywhere explains, with all its kinks, the spline need not follow.

    Args:
        keys, values, at: see `spline`.
        guide, guide_at: (n, c) and (m, c), the guide at the keys and at the places.
    """
    e, y = _bent(keys, guide), _bent(keys, values)
    slope = (e * y).sum(axis=0) / ((e * e).sum(axis=0) + _UNSEEN * len(keys))
    return np.asarray(slope * guide_at + spline(keys, values - slope * guide, at))


def _bent(keys: Floats, values: Floats) -> Floats:
    """Return what is left of values (n, c) without their straight line of least squares."""
    t = keys - keys.mean()
    values = values - values.mean(axis=0)
    return np.asarray(values - t[:, None] * ((t[:, None] * values).sum(axis=0) / max((t * t).sum(), 1e-300)))


def spline(keys: Floats, values: Floats, at: Floats) -> Floats:
    """Return the values (m, c) at m places of splines through n >= 1 keys.

    Args:
        keys: (n,), ascending.
        values: (n, c).
        at: (m,) between the first key and the last.
    """
    n = len(keys)
    if n == 1:
        return np.repeat(values, len(at), axis=0)
    h = np.diff(keys)
    slope = np.diff(values, axis=0) / h[:, None]
    M = _second_derivatives(h, slope)
    k = np.clip(np.searchsorted(keys, at, side="right") - 1, 0, n - 2)
    t, width = (at - keys[k])[:, None], h[k][:, None]
    rise = slope[k] - width * (2.0 * M[k] + M[k + 1]) / 6.0
    return np.asarray(values[k] + t * (rise + t * (0.5 * M[k] + t * (M[k + 1] - M[k]) / (6.0 * width))))


def _second_derivatives(h: Floats, slope: Floats) -> Floats:
    n = len(h) + 1
    M = np.zeros((n, slope.shape[1]))
    if n == 2:
        return M
    if n == 3:
        M[:] = 2.0 * (slope[1] - slope[0]) / (h[0] + h[1])
        return M
    right = 6.0 * np.diff(slope, axis=0)
    low, middle, high = h[:-1].copy(), 2.0 * (h[:-1] + h[1:]), h[1:].copy()
    first, last = h[0] / h[1], h[-1] / h[-2]
    middle[0] += h[0] * (1.0 + first)
    high[0] -= h[0] * first
    middle[-1] += h[-1] * (1.0 + last)
    low[-1] -= h[-1] * last
    for i in range(1, n - 2):
        share = low[i] / middle[i - 1]
        middle[i] -= share * high[i - 1]
        right[i] -= share * right[i - 1]
    M[n - 2] = right[-1] / middle[-1]
    for i in range(n - 4, -1, -1):
        M[i + 1] = (right[i] - high[i] * M[i + 2]) / middle[i]
    M[0] = M[1] + (M[1] - M[2]) * first
    M[-1] = M[-2] + (M[-2] - M[-3]) * last
    return M
