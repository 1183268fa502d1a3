"""Legendre's expansion of 1/dist over a cluster, by its moments up to the fourth."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel
from replay.sensing.capacitive.tree.clusters import FOURTH, SECOND, THIRD
from replay.sensing.capacitive.tree.lanes import LANES
from replay.sensing.capacitive.placed_plate import Triple

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
def mean_by_moments(lanes: Floats, i: int, T: Floats, sides: tuple[float, float], components: Triple) -> float:
    """Return the mean of 1/dist [1/m] over a node, from its moments up to the fourth, the first columns of lane i.

    T is T_plate_body, `sides` those of the centroid's region, and `components` u, v and z [m] of its distance.

    With n the unit vector of r in the body's frame, t = (n.d)^2 and q = |Pd|^2 are quadratic forms of d, by their
    coefficients of xx, yy, zz, xy, xz, yz. Orders 2, 3, 4 are the means of (3 t - q)/2, n.d (5 t - 3 q)/2 and
    (35 t^2 - 30 t q + 3 q^2)/8 = 35/8 (t - _T1 q)(t - _T2 q).
    """
    u, v, z = components
    inverse = 1.0 / math.sqrt(u * u + v * v + z * z)
    n0 = (T[0, 0] * u + T[1, 0] * v + T[2, 0] * z) * inverse
    n1 = (T[0, 1] * u + T[1, 1] * v + T[2, 1] * z) * inverse
    n2 = (T[0, 2] * u + T[1, 2] * v + T[2, 2] * z) * inverse
    drop_x, drop_y = 1.0 - abs(sides[0]), 1.0 - abs(sides[1])
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
    order2 = a[0] * lanes[SECOND * LANES + i] + a[1] * lanes[(SECOND + 1) * LANES + i]
    order2 += a[2] * lanes[(SECOND + 2) * LANES + i] + a[3] * lanes[(SECOND + 3) * LANES + i]
    order2 += a[4] * lanes[(SECOND + 4) * LANES + i] + a[5] * lanes[(SECOND + 5) * LANES + i]
    a = _combine(2.5, t, -1.5, q)
    order3 = n0 * a[0] * lanes[THIRD * LANES + i] + n1 * a[1] * lanes[(THIRD + 1) * LANES + i]
    order3 += n2 * a[2] * lanes[(THIRD + 2) * LANES + i]
    order3 += (n0 * a[3] + n1 * a[0]) * lanes[(THIRD + 3) * LANES + i]
    order3 += (n0 * a[4] + n2 * a[0]) * lanes[(THIRD + 4) * LANES + i]
    order3 += (n1 * a[3] + n0 * a[1]) * lanes[(THIRD + 5) * LANES + i]
    order3 += (n1 * a[5] + n2 * a[1]) * lanes[(THIRD + 6) * LANES + i]
    order3 += (n2 * a[4] + n0 * a[2]) * lanes[(THIRD + 7) * LANES + i]
    order3 += (n2 * a[5] + n1 * a[2]) * lanes[(THIRD + 8) * LANES + i]
    order3 += (n0 * a[5] + n1 * a[4] + n2 * a[3]) * lanes[(THIRD + 9) * LANES + i]
    a, b = _combine(1.0, t, -_T1, q), _combine(1.0, t, -_T2, q)
    order4 = a[0] * b[0] * lanes[FOURTH * LANES + i] + a[1] * b[1] * lanes[(FOURTH + 1) * LANES + i]
    order4 += a[2] * b[2] * lanes[(FOURTH + 2) * LANES + i]
    order4 += (a[0] * b[1] + a[1] * b[0] + a[3] * b[3]) * lanes[(FOURTH + 3) * LANES + i]
    order4 += (a[0] * b[2] + a[2] * b[0] + a[4] * b[4]) * lanes[(FOURTH + 4) * LANES + i]
    order4 += (a[1] * b[2] + a[2] * b[1] + a[5] * b[5]) * lanes[(FOURTH + 5) * LANES + i]
    more = (a[0] * b[3] + a[3] * b[0]) * lanes[(FOURTH + 6) * LANES + i]
    more += (a[0] * b[4] + a[4] * b[0]) * lanes[(FOURTH + 7) * LANES + i]
    more += (a[1] * b[3] + a[3] * b[1]) * lanes[(FOURTH + 8) * LANES + i]
    more += (a[1] * b[5] + a[5] * b[1]) * lanes[(FOURTH + 9) * LANES + i]
    more += (a[2] * b[4] + a[4] * b[2]) * lanes[(FOURTH + 10) * LANES + i]
    more += (a[2] * b[5] + a[5] * b[2]) * lanes[(FOURTH + 11) * LANES + i]
    more += (a[0] * b[5] + a[5] * b[0] + a[3] * b[4] + a[4] * b[3]) * lanes[(FOURTH + 12) * LANES + i]
    more += (a[1] * b[4] + a[4] * b[1] + a[3] * b[5] + a[5] * b[3]) * lanes[(FOURTH + 13) * LANES + i]
    more += (a[2] * b[3] + a[3] * b[2] + a[4] * b[5] + a[5] * b[4]) * lanes[(FOURTH + 14) * LANES + i]
    order4 = 35.0 / 8.0 * (order4 + more)
    return inverse * (1.0 + inverse * inverse * (order2 - inverse * (order3 - inverse * order4)))  # type: ignore[no-any-return]
