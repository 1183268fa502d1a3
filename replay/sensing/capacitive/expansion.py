"""Legendre's expansion of 1/dist over a cluster, by its moments up to the fourth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel
from replay.sensing.capacitive.clusters import FOURTH, SECOND, THIRD

Floats = NDArray[np.float64]
Form = tuple[float, float, float, float, float, float]

# Legendre's fourth polynomial, 35 t^2 - 30 t + 3 = 35 (t - _T1)(t - _T2) in t = cos^2, lets one product of forms do.
_T1 = (30.0 + math.sqrt(480.0)) / 70.0
_T2 = (30.0 - math.sqrt(480.0)) / 70.0


@inlined_kernel
def _combine(a: float, t: Form, b: float, q: Form) -> Form:
    return (
        a * t[0] + b * q[0],
        a * t[1] + b * q[1],
        a * t[2] + b * q[2],
        a * t[3] + b * q[3],
        a * t[4] + b * q[4],
        a * t[5] + b * q[5],
    )


@inlined_kernel
def mean_by_moments(moments: Floats, index: int, T: Floats, u: float, v: float, z: float, r: float) -> float:
    """Return the mean of 1/dist over a node, from its moments up to the fourth.

    With n the unit vector of r in the body's frame, t = (n.d)^2 and q = |Pd|^2 are quadratic forms of d, by their
    coefficients of xx, yy, zz, xy, xz, yz. Orders 2, 3, 4 are the means of (3 t - q)/2, n.d (5 t - 3 q)/2 and
    (35 t^2 - 30 t q + 3 q^2)/8 = 35/8 (t - _T1 q)(t - _T2 q).
    """
    inverse = 1.0 / r
    n0 = (T[0, 0] * u + T[1, 0] * v + T[2, 0] * z) * inverse
    n1 = (T[0, 1] * u + T[1, 1] * v + T[2, 1] * z) * inverse
    n2 = (T[0, 2] * u + T[1, 2] * v + T[2, 2] * z) * inverse
    drop_x, drop_y = 1.0 if u == 0.0 else 0.0, 1.0 if v == 0.0 else 0.0
    x0, x1, x2, y0, y1, y2 = T[0, 0], T[0, 1], T[0, 2], T[1, 0], T[1, 1], T[1, 2]
    t = (n0 * n0, n1 * n1, n2 * n2, 2.0 * n0 * n1, 2.0 * n0 * n2, 2.0 * n1 * n2)
    q = (
        1.0 - drop_x * x0 * x0 - drop_y * y0 * y0,
        1.0 - drop_x * x1 * x1 - drop_y * y1 * y1,
        1.0 - drop_x * x2 * x2 - drop_y * y2 * y2,
        -2.0 * (drop_x * x0 * x1 + drop_y * y0 * y1),
        -2.0 * (drop_x * x0 * x2 + drop_y * y0 * y2),
        -2.0 * (drop_x * x1 * x2 + drop_y * y1 * y2),
    )
    a = _combine(1.5, t, -0.5, q)
    order2 = 0.0
    for k in range(6):
        order2 += a[k] * moments[index, SECOND + k]
    a = _combine(2.5, t, -1.5, q)
    order3 = n0 * a[0] * moments[index, THIRD] + n1 * a[1] * moments[index, THIRD + 1]
    order3 += n2 * a[2] * moments[index, THIRD + 2]
    order3 += (n0 * a[3] + n1 * a[0]) * moments[index, THIRD + 3]
    order3 += (n0 * a[4] + n2 * a[0]) * moments[index, THIRD + 4]
    order3 += (n1 * a[3] + n0 * a[1]) * moments[index, THIRD + 5]
    order3 += (n1 * a[5] + n2 * a[1]) * moments[index, THIRD + 6]
    order3 += (n2 * a[4] + n0 * a[2]) * moments[index, THIRD + 7]
    order3 += (n2 * a[5] + n1 * a[2]) * moments[index, THIRD + 8]
    order3 += (n0 * a[5] + n1 * a[4] + n2 * a[3]) * moments[index, THIRD + 9]
    a, b = _combine(1.0, t, -_T1, q), _combine(1.0, t, -_T2, q)
    order4 = a[0] * b[0] * moments[index, FOURTH] + a[1] * b[1] * moments[index, FOURTH + 1]
    order4 += a[2] * b[2] * moments[index, FOURTH + 2]
    order4 += (a[0] * b[1] + a[1] * b[0] + a[3] * b[3]) * moments[index, FOURTH + 3]
    order4 += (a[0] * b[2] + a[2] * b[0] + a[4] * b[4]) * moments[index, FOURTH + 4]
    order4 += (a[1] * b[2] + a[2] * b[1] + a[5] * b[5]) * moments[index, FOURTH + 5]
    more = (a[0] * b[3] + a[3] * b[0]) * moments[index, FOURTH + 6]
    more += (a[0] * b[4] + a[4] * b[0]) * moments[index, FOURTH + 7]
    more += (a[1] * b[3] + a[3] * b[1]) * moments[index, FOURTH + 8]
    more += (a[1] * b[5] + a[5] * b[1]) * moments[index, FOURTH + 9]
    more += (a[2] * b[4] + a[4] * b[2]) * moments[index, FOURTH + 10]
    more += (a[2] * b[5] + a[5] * b[2]) * moments[index, FOURTH + 11]
    more += (a[0] * b[5] + a[5] * b[0] + a[3] * b[4] + a[4] * b[3]) * moments[index, FOURTH + 12]
    more += (a[1] * b[4] + a[4] * b[1] + a[3] * b[5] + a[5] * b[3]) * moments[index, FOURTH + 13]
    more += (a[2] * b[3] + a[3] * b[2] + a[4] * b[5] + a[5] * b[4]) * moments[index, FOURTH + 14]
    order4 = 35.0 / 8.0 * (order4 + more)
    return inverse * (1.0 + inverse * inverse * (order2 - inverse * (order3 - inverse * order4)))  # type: ignore[no-any-return]
