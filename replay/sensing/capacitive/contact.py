"""Touching and saturation: what the plate has in common with a triangle, and whether it is inside a body.

Whether a triangle meets the plate, and whether its integral is infinite, is decided by signs, before integrating.

Let T' be the triangle (side both) or the closure of its part with z > 0 (side front). The integral of 1/dist over T'
is infinite if and only if T' has positive area and meets the closed rectangle in more than one point (METHODS 4).

What a triangle has in common with the plane z = 0 is nothing, a point, a segment or, coplanar, all of it. An end of the
segment is kept as the four signs of its distances u beyond the plate's borders (1 = outside). Where an edge from P
(zP > 0) to N (zN < 0) crosses the plane, u has the sign of zP uN - zN uP. Two borders across x and y, at distances u
and v, are passed in the order that a determinant tells: with p where the triangle's boundary, walked from corner a to
b to c, comes down to z = 0 (from above, or from 0 on the way below), and q where it comes up,

    sign(u_p v_q - v_p u_q) = sign det[(u_a, v_a, z_a), (u_b, v_b, z_b), (u_c, v_c, z_c)],

whose zero says that the triangle's plane holds the plate's corner u = v = z = 0. Coordinates are exact as given and
all signs are exact, so a contact at a single point is told from one along a segment.

Whether a plate is inside a body, or lies flush on one and faces into it, is asked of plates that no triangle saturates.
Then, just before the plate, the body's surface is met at single points at most, so all of that layer is inside the body
or none of it. If only faces count that face the plate's centre, and it is outside, others are too: on the way in from
there is a face that faces it. So three points about the centre tell; not the centre itself, which the tip of a body may
touch, or which a wall that does not face it may go through. They lie before the plate by more than what rounding takes
for touching it, so a body that the plate's back lies flush on does not hold them, and one that its front lies flush on
does.
"""

from __future__ import annotations

import numpy as np
from numba import float64

from replay.geometry.containment import inside
from replay.geometry.tree import TREE_TYPE, Tree
from replay.numerics.arrays import Flags, Floats
from replay.numerics.double_double import Pair, two_sum
from replay.numerics.exact_sign import has_area, sign_of_determinant, sign_of_difference
from replay.numerics.jit import entry, inlined_kernel, kernel
from replay.numerics.triples import Triple

CLEAR = 0
TOUCHING = 1
SATURATED = 2  # and touching

Borders = tuple[Pair, Pair, Pair, Pair]
Signs = tuple[int, int, int, int]

_POINTS = 1e-3 * np.array([[0.37, 0.21], [-0.29, 0.31], [0.05, -0.43]])
"""About the plate's centre, in its half sizes."""

_BEFORE = 16.0
"""How far before the plate, in what rounding takes for touching."""


@kernel
def borders(x: float, y: float, half_x: float, half_y: float) -> Borders:
    """Return the signed distances of (x, y) beyond the borders x = hx, x = -hx, y = hy, y = -hy, exactly."""
    return two_sum(x, -half_x), two_sum(-half_x, -x), two_sum(y, -half_y), two_sum(-half_y, -y)


@kernel
def _sign(x: float) -> int:
    return 1 if x > 0.0 else (-1 if x < 0.0 else 0)


@kernel
def _corner_signs(p: Borders) -> Signs:
    return _sign(p[0][0]), _sign(p[1][0]), _sign(p[2][0]), _sign(p[3][0])


@kernel
def _crossing_signs(z_p: float, p: Borders, z_n: float, n: Borders) -> Signs:
    """Return the signs at the point where the edge from P (zP > 0) to N (zN < 0) crosses z = 0."""
    return (
        sign_of_difference(z_p, n[0], z_n, p[0]),
        sign_of_difference(z_p, n[1], z_n, p[1]),
        sign_of_difference(z_p, n[2], z_n, p[2]),
        sign_of_difference(z_p, n[3], z_n, p[3]),
    )


@kernel
def _point_meets(p: Signs) -> bool:
    return p[0] <= 0 and p[1] <= 0 and p[2] <= 0 and p[3] <= 0


@kernel
def _segment_meets(p: Signs, q: Signs, a: Borders, b: Borders, c: Borders, z_a: float, z_b: float, z_c: float) -> int:
    """Return how many points the segment from p, down, to q, up, shares with the rectangle: 0 none, 1 one, 2 more.

    The segment is inside border k for t up to or from p_k/(p_k - q_k); it meets the rectangle where every entry
    (p_k > 0) comes before every exit (q_k > 0). Of opposite borders the entry always comes first.
    """
    result = 2
    for enter in range(4):
        if p[enter] > 0 and q[enter] > 0:
            return 0
        if (p[enter] > 0 and q[enter] == 0) or (p[enter] == 0 and q[enter] > 0):
            result = 1
        if p[enter] <= 0:
            continue
        for leave in range(4):
            if q[leave] <= 0 or leave // 2 == enter // 2:
                continue
            order = sign_of_determinant((a[enter], a[leave], z_a), (b[enter], b[leave], z_b), (c[enter], c[leave], z_c))
            if order > 0:
                return 0
            if order == 0:
                result = 1
    return result


@kernel
def _edge_meets(p: Borders, q: Borders) -> int:
    """Return how many points an edge in z = 0 shares with the rectangle: the third row makes the order that of p, q."""
    return _segment_meets(_corner_signs(p), _corner_signs(q), p, q, p, 0.0, 0.0, 1.0)


@kernel
def _coplanar_meets(triangle: Floats, a: Borders, b: Borders, c: Borders) -> int:
    shared = max(_edge_meets(a, b), _edge_meets(b, c), _edge_meets(c, a))
    if shared == 2:
        return 2
    # no edge runs inside the rectangle: the triangle holds all of it, and so its centre, or at most a point
    turns = 0
    for k in range(3):
        p, q = triangle[k], triangle[(k + 1) % 3]
        turns += sign_of_difference(p[0], (q[1], 0.0), p[1], (q[0], 0.0))
    return 2 if abs(turns) == 3 else shared


@kernel
def contact(triangle: Floats, half_x: float, half_y: float, both: bool) -> int:
    """Return CLEAR, TOUCHING or SATURATED for a triangle (3, 3) [m] in the plate's frame."""
    z0, z1, z2 = triangle[0, 2], triangle[1, 2], triangle[2, 2]
    if (z0 > 0.0 and z1 > 0.0 and z2 > 0.0) or (z0 < 0.0 and z1 < 0.0 and z2 < 0.0):
        return CLEAR
    for axis in range(2):
        half = half_x if axis == 0 else half_y
        x0, x1, x2 = triangle[0, axis], triangle[1, axis], triangle[2, axis]
        if (x0 > half and x1 > half and x2 > half) or (x0 < -half and x1 < -half and x2 < -half):
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
    return SATURATED if shared == 2 and has_front and has_area(triangle) else TOUCHING


@kernel
def _plane_cut_meets(z_a: float, z_b: float, z_c: float, a: Borders, b: Borders, c: Borders) -> int:
    """Return how many points the rectangle shares with the segment or point in which a triangle meets z = 0."""
    down, up = _corner_signs(a), _corner_signs(a)
    for k in range(3):
        z_k = z_a if k == 0 else (z_b if k == 1 else z_c)
        z_next = z_b if k == 0 else (z_c if k == 1 else z_a)
        z_last = z_c if k == 0 else (z_a if k == 1 else z_b)
        p = a if k == 0 else (b if k == 1 else c)
        q = b if k == 0 else (c if k == 1 else a)
        if z_k == 0.0:
            point = _corner_signs(p)
            if (z_last > 0.0 and z_next > 0.0) or (z_last < 0.0 and z_next < 0.0):
                return 1 if _point_meets(point) else 0
            if z_last > 0.0 or z_next < 0.0:
                down = point
            else:
                up = point
        elif z_k > 0.0 > z_next:
            down = _crossing_signs(z_k, p, z_next, q)
        elif z_k < 0.0 < z_next:
            up = _crossing_signs(z_next, q, z_k, p)
    return _segment_meets(down, up, a, b, c, z_a, z_b, z_c)


@inlined_kernel
def may_touch(a: Triple, b: Triple, c: Triple, half_x: float, half_y: float) -> bool:
    """Return False only if `contact` finds a triangle in the plate's frame CLEAR, by the first of its tests."""
    return (
        min(a[2], b[2], c[2]) <= 0.0 <= max(a[2], b[2], c[2])
        and min(a[0], b[0], c[0]) <= half_x
        and max(a[0], b[0], c[0]) >= -half_x
        and min(a[1], b[1], c[1]) <= half_y
        and max(a[1], b[1], c[1]) >= -half_y
    )


@entry(float64[:, :, ::1], TREE_TYPE, float64[:, :, ::1], float64[:, :, :, ::1], float64[:, ::1], float64[::1])
@kernel
def plates_inside(
    triangles: Floats, tree: Tree, closing: Floats, T_plate_body: Floats, half_sizes: Floats, rounding: Floats
) -> Flags:
    """Return which plates (n, p) are inside a body that has an inside.

    Args:
        triangles, tree, closing: of the body, in its link's frame.
        T_plate_body: (n, p, 4, 4) poses of the link.
        half_sizes: (p, 2) [m].
        rounding: (n,) [m], corners no farther than this from a plate's plane are on it.
    """
    n, plates = T_plate_body.shape[0], T_plate_body.shape[1]
    found = np.empty((n, plates), np.bool_)
    point = np.empty(3)
    for frame in range(n):
        for plate in range(plates):
            T = T_plate_body[frame, plate]
            held = False
            for k in range(len(_POINTS)):
                x = half_sizes[plate, 0] * _POINTS[k, 0] - T[0, 3]
                y = half_sizes[plate, 1] * _POINTS[k, 1] - T[1, 3]
                z = _BEFORE * rounding[frame] - T[2, 3]
                for axis in range(3):
                    point[axis] = T[0, axis] * x + T[1, axis] * y + T[2, axis] * z
                if not held and inside(point, triangles, tree, closing) == 1:
                    held = True
            found[frame, plate] = held
    return found
