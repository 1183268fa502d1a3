"""Mean of 1/z over a triangle on which z is linear: the second divided difference of z ln z.

By the Hermite-Genocchi formula the mean of F'' over a triangle with corner values z0, z1, z2 is twice the divided
difference F[z0, z1, z2]; F'' = 1/z has F = z ln z, with F(0) = 0. With z0 <= z1 <= z2 and all values scaled by z1
(F[k z] = F[z] / k, since z ln k is linear and drops out), a = (z1 - z0)/z1, b = (z2 - z1)/z1:

    F[z0, z1, z2] = (f12 - f01) / (a + b) / z1,    f01 = -(1 - a) ln(1 - a) / a,    f12 = (1 + b) ln(1 + b) / b.

f01 <= 1 <= f12, so the difference loses digits only when the values are close; there the series about their mean m,
e_i = (z_i - m)/m, stands in:

    F[z0, z1, z2] = 1/m sum_k (-1)^k h_k(e) / ((k + 1)(k + 2)),

h_k the complete homogeneous polynomials, which obey h_k = -c2 h_(k-2) + c3 h_(k-3) because e0 + e1 + e2 = 0.
"""

from __future__ import annotations

import math

from replay.numerics.jit import leaf_kernel

_SERIES_SPREAD = 0.1
"""Largest (z2 - z0)/m for the series: |e| <= 0.067, so that term 13 is below 1e-16."""

_SERIES_TERMS = 13

_NEGLIGIBLE = 1e-100
"""z1/z2 below which 1 + 1/b is 1 and the logarithm of a quotient that may overflow is a difference."""


@leaf_kernel
def mean_inverse_linear(z0: float, z1: float, z2: float) -> float:
    """Return the mean of 1/z [1/m] over a triangle on which z >= 0 is linear with corner values z0, z1, z2 [m].

    inf when two corner values are 0. Accuracy: 7e-15 relative (test_log_difference). Source: Hermite-Genocchi; the
    scaling and the series are derived above.
    """
    if z0 > z1:
        z0, z1 = z1, z0
    if z1 > z2:
        z1, z2 = z2, z1
    if z0 > z1:
        z0, z1 = z1, z0
    if z1 <= 0.0:
        return math.inf
    # close values: the series about their mean
    m = z1 + ((z0 - z1) + (z2 - z1)) / 3.0
    if z2 - z0 <= _SERIES_SPREAD * m:
        e1 = (z1 - m) / m
        e2 = (z2 - m) / m
        e0 = -(e1 + e2)
        c2 = e0 * e1 + e0 * e2 + e1 * e2
        c3 = e0 * e1 * e2
        before, last, current = 1.0, 0.0, -c2
        total = 0.5 + current / 12.0
        sign = -1.0
        for k in range(3, _SERIES_TERMS):
            before, last, current = last, current, c3 * before - c2 * last
            total += sign * current / ((k + 1.0) * (k + 2.0))
            sign = -sign
        return 2.0 * total / m
    # f01 and f12
    a = (z1 - z0) / z1
    b = (z2 - z1) / z1
    f01 = 1.0
    if a >= 1.0:
        f01 = 0.0
    elif a > 0.0:
        f01 = -(z0 / z1) * math.log1p(-a) / a if a < 0.5 else -(z0 / z1) * math.log(z0 / z1) / a
    f12 = 1.0
    if z1 < _NEGLIGIBLE * z2:
        f12 = math.log(z2) - math.log(z1)
    elif b > 0.0:
        f12 = (z2 / z1) * math.log1p(b) / b
    return 2.0 * (f12 - f01) / (z2 - z0)
