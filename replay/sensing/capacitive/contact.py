"""Whether a triangle meets the plate, and whether its integral is infinite: decided by signs, before integrating.

Let T' be the triangle (side both) or the closure of its part with z > 0 (side front). The integral of 1/dist over T'
is infinite if and only if T' has positive area and meets the closed rectangle in more than one point (METHODS 4).

What a triangle has in common with the plane z = 0 is nothing, a point, a segment or, coplanar, all of it. An end of the
segment is kept as its four signed distances beyond the plate's borders (positive = outside), each to 32 digits and, for
a point where an edge crosses the plane, multiplied by a positive number: zP uN - zN uP instead of its quotient by
zP - zN. All decisions below are about signs, so that factor does not matter.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from replay.numerics.double_double import Pair, difference_of_products, two_sum
from replay.numerics.jit import kernel

CLEAR = 0
TOUCHING = 1
SATURATED = 2  # and touching

Floats = NDArray[np.float64]
Borders = tuple[Pair, Pair, Pair, Pair]


@kernel
def borders(x: float, y: float, half_x: float, half_y: float) -> Borders:
    """Return the signed distances of (x, y) beyond the borders x = hx, x = -hx, y = hy, y = -hy, exactly."""
    return two_sum(x, -half_x), two_sum(-half_x, -x), two_sum(y, -half_y), two_sum(-half_y, -y)


@kernel
def crossing(z_p: float, p: Borders, z_n: float, n: Borders) -> Borders:
    """Return `borders`, times zP - zN, of the point where the edge from P (zP > 0) to N (zN < 0) crosses z = 0."""
    zp, zn = (z_p, 0.0), (z_n, 0.0)
    return (
        difference_of_products(zp, n[0], zn, p[0]),
        difference_of_products(zp, n[1], zn, p[1]),
        difference_of_products(zp, n[2], zn, p[2]),
        difference_of_products(zp, n[3], zn, p[3]),
    )


@kernel
def _point_meets(p: Borders) -> bool:
    return p[0][0] <= 0.0 and p[1][0] <= 0.0 and p[2][0] <= 0.0 and p[3][0] <= 0.0


@kernel
def _segment_meets(p: Borders, q: Borders) -> int:
    """Return how many points the segment (p != q) shares with the rectangle: 0 none, 1 one, 2 more.

    The segment is inside border k for t up to or from p_k/(p_k - q_k); it meets the rectangle where every entry
    (p_k > 0) comes before every exit (q_k > 0), which is compared by cross multiplication.
    """
    result = 2
    for entry in range(4):
        p_in, q_in = p[entry], q[entry]
        if p_in[0] > 0.0 and q_in[0] > 0.0:
            return 0
        if (p_in[0] > 0.0 and q_in[0] == 0.0) or (p_in[0] == 0.0 and q_in[0] > 0.0):
            result = 1
        if not p_in[0] > 0.0:
            continue
        for leave in range(4):
            p_out, q_out = p[leave], q[leave]
            if not q_out[0] > 0.0:
                continue
            order = difference_of_products(p_in, q_out, p_out, q_in)[0]
            if order > 0.0:
                return 0
            if order == 0.0:
                result = 1
    return result


@kernel
def _coplanar_meets(triangle: Floats, a: Borders, b: Borders, c: Borders) -> int:
    shared = max(_segment_meets(a, b), _segment_meets(b, c), _segment_meets(c, a))
    if shared == 2:
        return 2
    # no edge runs inside the rectangle: the triangle holds all of it, and so its centre, or at most a point
    turns = 0
    for k in range(3):
        p, q = triangle[k], triangle[(k + 1) % 3]
        turn = difference_of_products((p[0], 0.0), (q[1], 0.0), (p[1], 0.0), (q[0], 0.0))[0]
        turns += 1 if turn > 0.0 else (-1 if turn < 0.0 else 0)
    return 2 if abs(turns) == 3 else shared


@kernel
def contact(triangle: Floats, area: float, half_x: float, half_y: float, both: bool) -> int:
    """Return CLEAR, TOUCHING or SATURATED for a triangle (3, 3) [m] of known area in the plate's frame."""
    z0, z1, z2 = triangle[0, 2], triangle[1, 2], triangle[2, 2]
    if (z0 > 0.0 and z1 > 0.0 and z2 > 0.0) or (z0 < 0.0 and z1 < 0.0 and z2 < 0.0):
        return CLEAR
    for axis in range(2):
        half = half_x if axis == 0 else half_y
        a, b, c = triangle[0, axis], triangle[1, axis], triangle[2, axis]
        if (a > half and b > half and c > half) or (a < -half and b < -half and c < -half):
            return CLEAR
    a = borders(triangle[0, 0], triangle[0, 1], half_x, half_y)
    b = borders(triangle[1, 0], triangle[1, 1], half_x, half_y)
    c = borders(triangle[2, 0], triangle[2, 1], half_x, half_y)
    if z0 == 0.0 and z1 == 0.0 and z2 == 0.0:
        shared = _coplanar_meets(triangle, a, b, c)
    else:
        shared = _plane_cut_meets(z0, z1, z2, a, b, c)
    if shared == 0:
        return CLEAR
    has_front = both or z0 > 0.0 or z1 > 0.0 or z2 > 0.0
    return SATURATED if shared == 2 and area > 0.0 and has_front else TOUCHING


@kernel
def _plane_cut_meets(z0: float, z1: float, z2: float, a: Borders, b: Borders, c: Borders) -> int:
    """Return how many points the rectangle shares with the segment or point in which a triangle meets z = 0."""
    count = 0
    first = a
    last = a
    for k in range(3):
        z_k = z0 if k == 0 else (z1 if k == 1 else z2)
        z_l = z1 if k == 0 else (z2 if k == 1 else z0)
        p = a if k == 0 else (b if k == 1 else c)
        q = b if k == 0 else (c if k == 1 else a)
        if z_k == 0.0:
            point = p
        elif z_k > 0.0 > z_l:
            point = crossing(z_k, p, z_l, q)
        elif z_k < 0.0 < z_l:
            point = crossing(z_l, q, z_k, p)
        else:
            continue
        if count == 0:
            first = point
        last = point
        count += 1
    if count == 0:
        return 0
    if count == 1:
        return 1 if _point_meets(first) else 0
    return _segment_meets(first, last)
