"""Whether two bounding volumes meet, each given in its own link's frame, with the relative pose T_a_b between them.

A test that says "apart" must be right, since the broad phase drops the pair then; "meet" may be wrong by rounding. So
both sides of every inequality are computed with an error of at most a few eps of the lengths involved, and `_slack`
times their sum is given in favour of meeting. It also covers axes and poses that are rotations only within rounding.
"""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats
from replay.numerics.constants import EPSILON
from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.triples import Triple

_SLACK = 64.0 * EPSILON

_NEARLY_PARALLEL = 1e-4
"""Square of the sine of the angle between two edges, below which their product is no axis for a gap."""


@leaf_kernel
def spheres_meet(center_a: Floats, radius_a: float, center_b: Floats, radius_b: float, T_a_b: Floats) -> bool:
    """Return whether two spheres meet: |c_b - c_a|^2 <= (r_a + r_b)^2, centres (3,) and radii in [m]."""
    square, size = 0.0, radius_a + radius_b
    for i in range(3):
        offset = T_a_b[i, 3] - center_a[i]
        size += _SLACK * (abs(T_a_b[i, 3]) + abs(center_a[i]) + abs(center_b[i]))
        for j in range(3):
            offset += T_a_b[i, j] * center_b[j]
        square += offset * offset
    size += _SLACK * size
    return square <= size * size


@leaf_kernel
def aabbs_meet(center_a: Floats, half_a: Floats, center_b: Floats, half_b: Floats, T_a_b: Floats) -> bool:
    """Return whether box a and the box around b along a's axes meet, on each axis |c_b - c_a| <= w_a + |R| w_b."""
    slack = _sizes(center_a, half_a, center_b, half_b, T_a_b)
    for i in range(3):
        offset = T_a_b[i, 3] - center_a[i]
        reach = half_a[i] + slack
        for j in range(3):
            offset += T_a_b[i, j] * center_b[j]
            reach += abs(T_a_b[i, j]) * half_b[j]
        if abs(offset) > reach:
            return False
    return True


@leaf_kernel
def obbs_meet(
    center_a: Floats, half_a: Floats, axes_a: Floats, center_b: Floats, half_b: Floats, axes_b: Floats, T_a_b: Floats
) -> bool:
    """Return whether two oriented boxes meet: no separating axis among the 15 (Gottschalk, Lin, Manocha 1996).

    With a_i and b_j the axes, r_ij = a_i . b_j and t = c_b - c_a along the a_i, the boxes are apart along
        a_i:        |t_i| > w_i + sum_j W_j |r_ij|
        b_j:        |sum_i t_i r_ij| > W_j + sum_i w_i |r_ij|
        a_i x b_j:  |t_k r_lj - t_l r_kj| > w_k |r_lj| + w_l |r_kj| + W_m |r_in| + W_n |r_im|
    with (i, l, k) and (j, m, n) cyclic up to sign. For edges that are nearly parallel both sides of the last are
    roundings, which the slack outweighs: such an axis does not separate.

    Args:
        center_a, half_a, axes_a: (3,) [m], (3,) [m], (3, 3) unit rows, in link a; b likewise in link b.
        T_a_b: (4, 4) pose of link b in link a.
    """
    slack = _sizes(center_a, half_a, center_b, half_b, T_a_b)
    offset = (
        T_a_b[0, 0] * center_b[0] + T_a_b[0, 1] * center_b[1] + T_a_b[0, 2] * center_b[2] + T_a_b[0, 3] - center_a[0],
        T_a_b[1, 0] * center_b[0] + T_a_b[1, 1] * center_b[1] + T_a_b[1, 2] * center_b[2] + T_a_b[1, 3] - center_a[1],
        T_a_b[2, 0] * center_b[0] + T_a_b[2, 1] * center_b[1] + T_a_b[2, 2] * center_b[2] + T_a_b[2, 3] - center_a[2],
    )
    t = _turned(axes_a, offset)
    r0 = _column(axes_a, axes_b[0], T_a_b)
    r1 = _column(axes_a, axes_b[1], T_a_b)
    r2 = _column(axes_a, axes_b[2], T_a_b)
    s0 = (abs(r0[0]), abs(r0[1]), abs(r0[2]))
    s1 = (abs(r1[0]), abs(r1[1]), abs(r1[2]))
    s2 = (abs(r2[0]), abs(r2[1]), abs(r2[2]))
    # a_i
    for i in range(3):
        if abs(t[i]) > half_a[i] + half_b[0] * s0[i] + half_b[1] * s1[i] + half_b[2] * s2[i] + slack:
            return False
    # b_j
    if _face_apart(t, r0, s0, half_a, half_b[0] + slack):
        return False
    if _face_apart(t, r1, s1, half_a, half_b[1] + slack):
        return False
    if _face_apart(t, r2, s2, half_a, half_b[2] + slack):
        return False
    # a_i x b_j
    if _edges_apart(t, r0, s0, s1, s2, half_a, half_b[1], half_b[2], slack):
        return False
    if _edges_apart(t, r1, s1, s2, s0, half_a, half_b[2], half_b[0], slack):
        return False
    return not _edges_apart(t, r2, s2, s0, s1, half_a, half_b[0], half_b[1], slack)


@leaf_kernel
def obbs_gap(
    center_a: Floats, half_a: Floats, axes_a: Floats, center_b: Floats, half_b: Floats, axes_b: Floats, T_a_b: Floats
) -> float:
    """Return a lower bound on the distance [m] of two oriented boxes: the widest gap along the 15 axes of `obbs_meet`.

    Not above 0 where they meet. Edges that are nearly parallel have no axis. Arguments as of `obbs_meet`.
    """
    slack = _sizes(center_a, half_a, center_b, half_b, T_a_b)
    offset = (
        T_a_b[0, 0] * center_b[0] + T_a_b[0, 1] * center_b[1] + T_a_b[0, 2] * center_b[2] + T_a_b[0, 3] - center_a[0],
        T_a_b[1, 0] * center_b[0] + T_a_b[1, 1] * center_b[1] + T_a_b[1, 2] * center_b[2] + T_a_b[1, 3] - center_a[1],
        T_a_b[2, 0] * center_b[0] + T_a_b[2, 1] * center_b[1] + T_a_b[2, 2] * center_b[2] + T_a_b[2, 3] - center_a[2],
    )
    t = _turned(axes_a, offset)
    r = (
        _column(axes_a, axes_b[0], T_a_b),
        _column(axes_a, axes_b[1], T_a_b),
        _column(axes_a, axes_b[2], T_a_b),
    )
    gap = -math.inf
    for i in range(3):
        reach = half_a[i] + half_b[0] * abs(r[0][i]) + half_b[1] * abs(r[1][i]) + half_b[2] * abs(r[2][i])
        gap = max(gap, abs(t[i]) - reach)
    for j in range(3):
        x, y, z = r[j]
        reach = half_b[j] + half_a[0] * abs(x) + half_a[1] * abs(y) + half_a[2] * abs(z)
        gap = max(gap, abs(t[0] * x + t[1] * y + t[2] * z) - reach)
        m, n = (j + 1) % 3, (j + 2) % 3
        for i in range(3):
            k, l = (i + 1) % 3, (i + 2) % 3
            square = r[j][k] * r[j][k] + r[j][l] * r[j][l]
            if square > _NEARLY_PARALLEL:
                reach = half_a[k] * abs(r[j][l]) + half_a[l] * abs(r[j][k])
                reach += half_b[m] * abs(r[n][i]) + half_b[n] * abs(r[m][i])
                gap = max(gap, (abs(t[k] * r[j][l] - t[l] * r[j][k]) - reach - slack) / math.sqrt(square))
    return gap - slack


@inlined_kernel
def _face_apart(t: Triple, r: Triple, s: Triple, half_a: Floats, half_b: float) -> bool:
    reach = half_b + half_a[0] * s[0] + half_a[1] * s[1] + half_a[2] * s[2]
    distance: float = abs(t[0] * r[0] + t[1] * r[1] + t[2] * r[2])
    apart: bool = distance > reach
    return apart


@inlined_kernel
def _edges_apart(
    t: Triple,
    r: Triple,
    s: Triple,
    s_m: Triple,
    s_n: Triple,
    half_a: Floats,
    half_m: float,
    half_n: float,
    slack: float,
) -> bool:
    """Test the three axes a_i x b_j of one edge direction b_j; r = (a_i . b_j), s = |r|, s_m and s_n of the others."""
    for i in range(3):
        k, l = (i + 1) % 3, (i + 2) % 3
        reach = half_a[k] * s[l] + half_a[l] * s[k] + half_m * s_n[i] + half_n * s_m[i] + slack
        if abs(t[k] * r[l] - t[l] * r[k]) > reach:
            return True
    return False


@inlined_kernel
def _turned(axes: Floats, v: Triple) -> Triple:
    return (
        axes[0, 0] * v[0] + axes[0, 1] * v[1] + axes[0, 2] * v[2],
        axes[1, 0] * v[0] + axes[1, 1] * v[1] + axes[1, 2] * v[2],
        axes[2, 0] * v[0] + axes[2, 1] * v[1] + axes[2, 2] * v[2],
    )


@inlined_kernel
def _column(axes_a: Floats, axis_b: Floats, T_a_b: Floats) -> Triple:
    """Return (a_i . b) for one axis b of box b."""
    turned = (
        T_a_b[0, 0] * axis_b[0] + T_a_b[0, 1] * axis_b[1] + T_a_b[0, 2] * axis_b[2],
        T_a_b[1, 0] * axis_b[0] + T_a_b[1, 1] * axis_b[1] + T_a_b[1, 2] * axis_b[2],
        T_a_b[2, 0] * axis_b[0] + T_a_b[2, 1] * axis_b[1] + T_a_b[2, 2] * axis_b[2],
    )
    return _turned(axes_a, turned)


@inlined_kernel
def _sizes(center_a: Floats, half_a: Floats, center_b: Floats, half_b: Floats, T_a_b: Floats) -> float:
    """Return the slack [m]: _SLACK times all lengths that enter."""
    total = 0.0
    for i in range(3):
        total += abs(T_a_b[i, 3]) + abs(center_a[i]) + abs(center_b[i]) + half_a[i] + half_b[i]
    return _SLACK * total
