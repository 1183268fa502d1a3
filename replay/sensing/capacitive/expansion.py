"""Legendre's expansion of 1/dist over a cluster, by its moments up to the fourth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import leaf_kernel
from replay.sensing.capacitive.clusters import FOURTH, SECOND, THIRD

Floats = NDArray[np.float64]

# Legendre's fourth polynomial, 35 t^2 - 30 t + 3 = 35 (t - _T1)(t - _T2) in t = cos^2, lets one product of M4 do.
_T1 = (30.0 + math.sqrt(480.0)) / 70.0
_T2 = (30.0 - math.sqrt(480.0)) / 70.0


@leaf_kernel
def mean_by_moments(moments: Floats, index: int, T: Floats, u: float, v: float, z: float, r: float) -> float:
    """Return the mean of 1/dist over a node, from its moments up to the fourth.

    With n the unit vector of r in the body's frame, t = (n.d)^2 and q = |Pd|^2 are quadratic forms of d. Orders 2, 3, 4
    are the means of (3 t - q)/2, n.d (5 t - 3 q)/2 and (35 t^2 - 30 t q + 3 q^2)/8 = 35/8 (t - _T1 q)(t - _T2 q).
    """
    inverse = 1.0 / r
    n0 = (T[0, 0] * u + T[1, 0] * v + T[2, 0] * z) * inverse
    n1 = (T[0, 1] * u + T[1, 1] * v + T[2, 1] * z) * inverse
    n2 = (T[0, 2] * u + T[1, 2] * v + T[2, 2] * z) * inverse
    drop_x, drop_y = 1.0 if u == 0.0 else 0.0, 1.0 if v == 0.0 else 0.0
    x0, x1, x2, y0, y1, y2 = T[0, 0], T[0, 1], T[0, 2], T[1, 0], T[1, 1], T[1, 2]
    # entries xy, xz, yz count twice
    t = (n0 * n0, n1 * n1, n2 * n2, 2.0 * n0 * n1, 2.0 * n0 * n2, 2.0 * n1 * n2)
    q = (
        1.0 - drop_x * x0 * x0 - drop_y * y0 * y0,
        1.0 - drop_x * x1 * x1 - drop_y * y1 * y1,
        1.0 - drop_x * x2 * x2 - drop_y * y2 * y2,
        -2.0 * (drop_x * x0 * x1 + drop_y * y0 * y1),
        -2.0 * (drop_x * x0 * x2 + drop_y * y0 * y2),
        -2.0 * (drop_x * x1 * x2 + drop_y * y1 * y2),
    )
    order2, order3, order4 = 0.0, 0.0, 0.0
    place = FOURTH
    for i in range(6):
        order2 += (1.5 * t[i] - 0.5 * q[i]) * moments[index, SECOND + i]
        along = (
            n0 * moments[index, THIRD + i] + n1 * moments[index, THIRD + 6 + i] + n2 * moments[index, THIRD + 12 + i]
        )
        order3 += (2.5 * t[i] - 1.5 * q[i]) * along
        first, second = t[i] - _T1 * q[i], t[i] - _T2 * q[i]
        order4 += first * second * moments[index, place]
        place += 1
        for j in range(i + 1, 6):
            order4 += (first * (t[j] - _T2 * q[j]) + second * (t[j] - _T1 * q[j])) * moments[index, place]
            place += 1
    order4 *= 35.0 / 8.0
    return inverse * (1.0 + inverse * inverse * (order2 - inverse * (order3 - inverse * order4)))
