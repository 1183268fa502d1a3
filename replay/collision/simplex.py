"""The point nearest to the origin on a simplex of 1..4 points, in doubles.

This is the fast half of GJK's inner step. It may err on nearly degenerate simplices; it never says so itself, because
`gjk_kernel` accepts nothing without a verified bound and hands every doubtful query to `exact_simplex`.

The nearest point is returned as a direction of any length, its squared distance, and the corners' shares in it: weights
times a common positive factor, 0 for corners without a part. So nothing is divided that is not compared.

Triangle with corners a, b, c and normal n = (b - a) x (c - a): the foot of the perpendicular from the origin has the
barycentric coordinates n.(b x c), n.(c x a), n.(a x b), over n.n. The Voronoi regions of its corners and edges follow
C. Ericson, Real-Time Collision Detection, 5.1.5. In the face region the nearest point is n (n.a)/(n.n): its direction,
+-n, is as good as the normal, however near the origin is, where a weighted sum of corners would cancel.

Segment with ends a, b and e = b - a: the foot of the perpendicular is e x (a x e)/(e.e), orthogonal to e to its own
last digit, which a + t e is only to the last digit of a.

Tetrahedron p0..p3: with D_ijk = p_i.(p_j x p_k), the barycentric coordinates of the origin are D_123, -D_023, D_013,
-D_012 over their sum, the (six-fold) volume. The origin is inside iff all four have the sign of the sum.
"""

from __future__ import annotations

import math

from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.triples import Triple, cross, dot, minus

Near2 = tuple[Triple, float, float, float]
Near3 = tuple[Triple, float, float, float, float]
Near4 = tuple[int, Triple, float, float, float, float, float]

OUTSIDE = 0
INSIDE = 1
UNSURE = 2

DETERMINANT_ERROR = 64.0 * 2.0**-53
"""Bound of the rounding error of D_ijk over size max|p|^2; each product, each sum and each p_i contributes."""


@inlined_kernel
def nearest_on_segment(a: Triple, b: Triple) -> Near2:
    """Return direction and squared distance of the segment's point nearest to the origin, and the shares of a and b."""
    e = minus(b, a)
    along = -dot(a, e)
    total = dot(e, e)
    if along <= 0.0 or total == 0.0:
        return a, dot(a, a), 1.0, 0.0
    rest = total - along
    if rest <= 0.0:
        return b, dot(b, b), 0.0, 1.0
    v = cross(e, cross(a if along <= rest else b, e))
    return v, dot(v, v) / (total * total), rest, along


@inlined_kernel
def nearest_on_triangle(a: Triple, b: Triple, c: Triple) -> Near3:
    """Return direction and squared distance of the triangle's point nearest to the origin, and the corners' shares."""
    u, v = minus(b, a), minus(c, a)
    # corner regions
    au, av = -dot(u, a), -dot(v, a)
    if au <= 0.0 and av <= 0.0:
        return a, dot(a, a), 1.0, 0.0, 0.0
    bu, bv = -dot(u, b), -dot(v, b)
    if bu >= 0.0 and bv <= bu:
        return b, dot(b, b), 0.0, 1.0, 0.0
    cu, cv = -dot(u, c), -dot(v, c)
    if cv >= 0.0 and cu <= cv:
        return c, dot(c, c), 0.0, 0.0, 1.0
    # edge regions: the corner opposite has no positive share
    n = cross(u, v)
    total = dot(n, n)
    share_c = dot(n, cross(a, b))
    share_b = dot(n, cross(c, a))
    share_a = total - share_b - share_c
    if share_c <= 0.0 and au >= 0.0 and bu <= 0.0:
        point, square, wa, wb = nearest_on_segment(a, b)
        return point, square, wa, wb, 0.0
    if share_b <= 0.0 and av >= 0.0 and cv <= 0.0:
        point, square, wa, wc = nearest_on_segment(a, c)
        return point, square, wa, 0.0, wc
    if share_a <= 0.0 and bv >= bu and cu >= cv:
        point, square, wb, wc = nearest_on_segment(b, c)
        return point, square, 0.0, wb, wc
    if not (share_a > 0.0 and share_b > 0.0 and share_c > 0.0):
        return _nearest_on_border(a, b, c)
    # face region
    height = dot(n, a)
    if height < 0.0:
        n = (-n[0], -n[1], -n[2])
    return n, height * height / total, share_a, share_b, share_c


@leaf_kernel
def _nearest_on_border(a: Triple, b: Triple, c: Triple) -> Near3:
    """Let the three edges of a triangle compete: for one that is degenerate or contradicts itself."""
    point, square, wa, wb = nearest_on_segment(a, b)
    wc = 0.0
    other, closer, va, vc = nearest_on_segment(a, c)
    if closer < square:
        point, square, wa, wb, wc = other, closer, va, 0.0, vc
    other, closer, vb, vc = nearest_on_segment(b, c)
    if closer < square:
        point, square, wa, wb, wc = other, closer, 0.0, vb, vc
    return point, square, wa, wb, wc


@inlined_kernel
def nearest_on_tetrahedron(a: Triple, b: Triple, c: Triple, d: Triple, size: float) -> Near4:
    """Return (OUTSIDE | INSIDE | UNSURE, direction, squared distance, shares of a, b, c, d).

    UNSURE if rounding may put the origin on either side. The point is the tetrahedron's nearest to the origin if
    OUTSIDE; if INSIDE it is the origin. `size` bounds the coordinates that the corners are differences of.
    """
    ab, cd = cross(a, b), cross(c, d)
    sa, sb, sc, sd = dot(b, cd), -dot(a, cd), dot(d, ab), -dot(c, ab)
    limit = DETERMINANT_ERROR * size * max(dot(a, a), dot(b, b), dot(c, c), dot(d, d))
    volume = sa + sb + sc + sd
    if volume < 0.0:
        sa, sb, sc, sd, volume = -sa, -sb, -sc, -sd, -volume
    least = min(sa, sb, sc, sd)
    origin = (0.0, 0.0, 0.0)
    if volume > 4.0 * limit:
        if least > limit:
            return INSIDE, origin, 0.0, sa, sb, sc, sd
        if least >= -limit:
            return UNSURE, origin, 0.0, 0.0, 0.0, 0.0, 0.0
    else:
        limit = math.inf
    # outside, or flat: the faces that the origin is beyond, or may be, compete
    best = math.inf
    nearest = origin
    wa, wb, wc, wd = 0.0, 0.0, 0.0, 0.0
    if sd <= limit:
        nearest, best, wa, wb, wc = nearest_on_triangle(a, b, c)
    if sc <= limit:
        point, square, wp, wq, wr = nearest_on_triangle(a, b, d)
        if square < best:
            nearest, best, wa, wb, wc, wd = point, square, wp, wq, 0.0, wr
    if sb <= limit:
        point, square, wp, wq, wr = nearest_on_triangle(a, c, d)
        if square < best:
            nearest, best, wa, wb, wc, wd = point, square, wp, 0.0, wq, wr
    if sa <= limit:
        point, square, wp, wq, wr = nearest_on_triangle(b, c, d)
        if square < best:
            nearest, best, wa, wb, wc, wd = point, square, 0.0, wp, wq, wr
    return OUTSIDE, nearest, best, wa, wb, wc, wd
