"""Mean of 1/|r| over a segment and over a triangle: the potential of uniform bodies, without their cancellations.

Points are triples relative to the point the distance is measured from. For the distance to a line, project the corners
along the line first (one coordinate 0): the formula is the same, and the mean stays finite where the projected area is
0. Accuracy holds when each coordinate of the corners is accurate to its own size and the triangle subtends at most an
octant at the origin, because the nearest point is then never much nearer than the nearest corner.

Segment from p to q, length L, unit tangent t, R- = |p|, R+ = |q|, s- = p.t, s+ = q.t, R0 the distance of its line:

    int ds/sqrt(s^2 + R0^2) = ln((S + L)/(S - L)) = 2 atanh(L/S),    S = R- + R+,
    S^2 - L^2 = 2 (R0^2 + R- R+ + s- s+),

where the last bracket is R0^2 (1 + (R0^2 + s-^2 + s+^2)/(R- R+ - s- s+)) when s- s+ < 0 makes it cancel.

Triangle, closed form: in its plane, edge i with outward normal m and P = m.a, d the height of the origin above the
plane, f the segment integral above:

    int dA/|r| = sum_i P f_i - |d| sum_i [atan2(P s+, R0^2 + |d| R+) - atan2(P s-, R0^2 + |d| R-)]   (Wilton 1984).

Its terms grow like the distance to the origin while their sum does not, so a triangle that is far away in terms of its
size is integrated by a product Gauss rule instead. A sliver seen from farther than its own width cancels likewise: it
is split at the foot of its height, and each half is integrated exactly along the rays from its far corner e,

    mean = 2 int_0^1 dv int_0^1 u du / |e + u (k(v) - e)|,   k(v) on the short edge,  a = |k - e|,
    int_0^1 u du / |...| = ((s_e + s_k)/(R_e + R_k) - s_e f/a) / a,

with a Gauss rule across (v), which converges fast because the origin is farther than the sliver is wide.
"""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats
from replay.numerics.gauss import (
    NODES_4,
    NODES_8,
    NODES_12,
    NODES_16,
    WEIGHTS_4,
    WEIGHTS_8,
    WEIGHTS_12,
    WEIGHTS_16,
)
from replay.numerics.jit import kernel, leaf_kernel
from replay.numerics.triples import UNDERFLOW, Triple, along, cross, dot, minus, norm

_FAR = 3.0
"""Distance of the centroid in longest edges from which a triangle is integrated by a Gauss rule."""

_TINY = 1e-60
"""Size below which a triangle is scaled up, so that fourth powers stay above UNDERFLOW."""


@leaf_kernel
def _segment_integral(length: float, near: float, height: float, r_near: float, r_far: float) -> float:
    """Return int ds/sqrt(s^2 + R0^2) over s = near .. near + length, near >= -length/2; inf through the origin."""
    total = r_near + r_far
    if total > 2.0 * length:
        return 2.0 * math.atanh(length / total)
    far = near + length
    product = near * far
    squared = height * height
    if product >= 0.0:
        bracket = squared + r_near * r_far + product
    else:
        if height > 0.0 and squared < UNDERFLOW:
            # the same by logarithms, numerator and denominator over `far`
            gap = r_near * (r_far / far) - near
            ratio, steep = near / far, height / far
            numerator = far * (1.0 + ratio * ratio + steep * steep) + gap
            return 2.0 * (math.log(total + length) - math.log(height)) - math.log(2.0 * numerator) + math.log(gap)
        bracket = squared * (1.0 + (squared + near * near + far * far) / (r_near * r_far - product))
    if bracket <= 0.0:
        return math.inf
    square = (total + length) * (total + length)
    if bracket < 1e-100 * square:
        # the quotient might overflow
        return math.log(square) - math.log(2.0 * bracket)
    return math.log(square / (2.0 * bracket))


@leaf_kernel
def mean_over_segment(p: Triple, q: Triple) -> float:
    """Return the mean of 1/|r| [1/m] over the segment from p to q [m]; inf when it contains the origin."""
    r_near, r_far = norm(p), norm(q)
    if r_far < r_near:
        p, q = q, p
        r_near, r_far = r_far, r_near
    if r_near <= 0.0:
        return math.inf
    edge = minus(q, p)
    length = norm(edge)
    if length <= 1e-12 * r_near:
        return 2.0 / (r_near + r_far)
    near = dot(p, edge) / length
    height = norm(cross(p, edge)) / length
    return _segment_integral(length, near, height, r_near, r_far) / length


@kernel
def _gauss_mean(a: Triple, b: Triple, c: Triple, nodes: Floats, weights: Floats) -> float:
    """Return the mean of 1/|r| over a triangle by the product rule collapsed into corner a."""
    total = 0.0
    for j in range(len(nodes)):
        k = along(minus(b, a), nodes[j], minus(c, b))
        row = 0.0
        for i in range(len(nodes)):
            row += weights[i] * nodes[i] / norm(along(a, nodes[i], k))
        total += weights[j] * row
    return 2.0 * total


@kernel
def _far_mean(a: Triple, b: Triple, c: Triple, ratio: float) -> float:
    """Return the mean of 1/|r| over a triangle whose centroid is `ratio` >= _FAR longest edges away."""
    if ratio > 1e4:
        return _gauss_mean(a, b, c, NODES_4, WEIGHTS_4)
    if ratio > 12.0:
        return _gauss_mean(a, b, c, NODES_8, WEIGHTS_8)
    return _gauss_mean(a, b, c, NODES_16, WEIGHTS_16)


@kernel
def _ray_mean(e: Triple, f: Triple, c: Triple) -> float:
    """Return the mean of 1/|r| over a triangle with corner e far from its short edge from f to c."""
    r_e = norm(e)
    short = minus(c, f)
    start = minus(f, e)
    total = 0.0
    for j in range(len(NODES_12)):
        k = along(f, NODES_12[j], short)
        ray = along(start, NODES_12[j], short)
        a = norm(ray)
        r_k = norm(k)
        if r_k < r_e:
            s_k = dot(k, ray) / a
            s_e = s_k - a
            height = norm(cross(k, ray)) / a
            integral = _segment_integral(a, -s_k, height, r_k, r_e)
        else:
            s_e = dot(e, ray) / a
            s_k = s_e + a
            height = norm(cross(e, ray)) / a
            integral = _segment_integral(a, s_e, height, r_e, r_k)
        total += WEIGHTS_12[j] * ((s_e + s_k) / (r_e + r_k) - s_e * integral / a) / a
    return 2.0 * total


@kernel
def _half_sliver_mean(e: Triple, f: Triple, c: Triple) -> float:
    longest = max(norm(minus(e, f)), norm(minus(e, c)))
    if longest <= 0.0:
        return 1.0 / norm(e)
    ratio = norm(along(along(e, 1.0, f), 1.0, c)) / (3.0 * longest)
    if ratio > _FAR:
        return _far_mean(e, f, c, ratio)
    return _ray_mean(e, f, c)


@kernel
def _closed_form(base: int, offset: Triple, length: float, foot: float, back: float, width: float) -> float:
    """Return int dA/|r| over the triangle A (0, 0), B (length, 0), C (foot, width) of its own plane.

    `back` is foot - length. `offset` is corner `base` (0, 1, 2: the nearest to the origin) along the edge AB, across it
    and normal to the plane; the other corners are taken from that one, so that rounding is relative to its distance.
    """
    x, y, z = offset
    if base == 0:
        a, b, c = (x, y), (x + length, y), (x + foot, y + width)
    elif base == 1:
        a, b, c = (x - length, y), (x, y), (x + back, y + width)
    else:
        a, b, c = (x - foot, y - width), (x - back, y - width), (x, y)
    depth = abs(z)
    result = _edge_term(a, b, length, 0.0, depth)
    result += _edge_term(b, c, back, width, depth)
    return result + _edge_term(c, a, -foot, -width, depth)


@kernel
def _edge_term(p: tuple[float, float], q: tuple[float, float], along: float, across: float, depth: float) -> float:
    """Return what the edge from p to q = p + (along, across) adds to the closed form."""
    length = norm((along, across, 0.0))
    if length <= 0.0:
        return 0.0
    tx, ty = along / length, across / length
    r_p = norm((p[0], p[1], depth))
    r_q = norm((q[0], q[1], depth))
    if r_p <= r_q:
        outward = p[0] * ty - p[1] * tx
        s_p = p[0] * tx + p[1] * ty
        s_q = s_p + length
    else:
        outward = q[0] * ty - q[1] * tx
        s_q = q[0] * tx + q[1] * ty
        s_p = s_q - length
    if outward == 0.0:
        return 0.0
    squared = outward * outward + depth * depth
    near = s_p if r_p <= r_q else -s_q
    height = norm((outward, depth, 0.0))
    result = outward * _segment_integral(length, near, height, min(r_p, r_q), max(r_p, r_q))
    if depth > 0.0:
        result -= depth * math.atan2(outward * s_q, squared + depth * r_q)
        result += depth * math.atan2(outward * s_p, squared + depth * r_p)
    return result


@kernel
def _mean_over_triangle(a: Triple, b: Triple, c: Triple) -> float:
    # the longest edge becomes the one from a to b
    ab, bc, ca = norm(minus(b, a)), norm(minus(c, b)), norm(minus(a, c))
    if bc >= ab and bc >= ca:
        a, b, c = b, c, a
        length = bc
    elif ca >= ab and ca >= bc:
        a, b, c = c, a, b
        length = ca
    else:
        length = ab
    # two long edges of a needle are equal to the last digit: c's foot beyond an end says that the other one is longer
    edge = minus(b, a)
    if dot(minus(c, a), edge) < 0.0:
        a, c = c, a
        length = norm(minus(b, a))
    elif dot(minus(c, b), edge) > 0.0:
        b, c = c, b
        length = norm(minus(b, a))
    # the origin in a corner: along the rays from it, twice the mean over the opposite edge
    r_a, r_b, r_c = norm(a), norm(b), norm(c)
    if r_a <= 0.0:
        return 2.0 * mean_over_segment(b, c)
    if r_b <= 0.0:
        return 2.0 * mean_over_segment(c, a)
    if r_c <= 0.0:
        return 2.0 * mean_over_segment(a, b)
    if length <= 0.0:
        return 1.0 / r_a
    # far away: Gauss
    ratio = norm(along(along(a, 1.0, b), 1.0, c)) / (3.0 * length)
    if ratio > _FAR:
        return _far_mean(a, b, c, ratio)
    t = minus(b, a)
    t = (t[0] / length, t[1] / length, t[2] / length)
    # height of c over the longest edge, its foot measured from the nearer end; rounding may put it just beyond an end
    from_a, from_b = minus(c, a), minus(c, b)
    if dot(from_a, from_a) <= dot(from_b, from_b):
        foot = dot(from_a, t)
        back = foot - length
        across = along(from_a, -foot, t)
    else:
        back = dot(from_b, t)
        foot = length + back
        across = along(from_b, -back, t)
    across = along(across, -dot(across, t), t)
    width = norm(across)
    # distance of the origin to the longest edge
    if r_a <= r_b:
        s_a = dot(a, t)
        s_b = s_a + length
        height = along(a, -s_a, t)
    else:
        s_b = dot(b, t)
        s_a = s_b - length
        height = along(b, -s_b, t)
    distance = r_a if s_a > 0.0 else (r_b if s_b < 0.0 else norm(height))
    # a sliver: two halves, by rays from their far corners
    if distance > 2.0 * width:
        foot_point = minus(c, across)
        first = _half_sliver_mean(a, foot_point, c) if foot != 0.0 else 0.0
        second = _half_sliver_mean(b, foot_point, c) if back != 0.0 else 0.0
        return (foot * first - back * second) / length
    # closed form, in the triangle's own plane
    m = (across[0] / width, across[1] / width, across[2] / width)
    n = cross(t, m)
    base = 0 if r_a <= r_b and r_a <= r_c else (1 if r_b <= r_c else 2)
    nearest = a if base == 0 else (b if base == 1 else c)
    offset = (dot(nearest, t), dot(nearest, m), dot(nearest, n))
    return _closed_form(base, offset, length, foot, back, width) / (0.5 * length * width)


@kernel
def mean_over_triangle(a: Triple, b: Triple, c: Triple) -> float:
    """Return the mean of 1/|r| [1/m] over the triangle with corners a, b, c [m], which may be degenerate.

    inf when the triangle is degenerate and contains the origin in its interior or along an edge of positive length.
    Accuracy: 1e-14 relative, slivers included (test_inverse_distance). Source: derived in the module's text.
    """
    largest = max(abs(a[0]), abs(a[1]), abs(a[2]))
    largest = max(largest, abs(b[0]), abs(b[1]), abs(b[2]))
    largest = max(largest, abs(c[0]), abs(c[1]), abs(c[2]))
    if 0.0 < largest < _TINY:
        # twice, so that the power of two is finite for denormal numbers too
        factor = math.ldexp(1.0, -math.frexp(largest)[1] // 2)
        a = (a[0] * factor * factor, a[1] * factor * factor, a[2] * factor * factor)
        b = (b[0] * factor * factor, b[1] * factor * factor, b[2] * factor * factor)
        c = (c[0] * factor * factor, c[1] * factor * factor, c[2] * factor * factor)
        return _mean_over_triangle(a, b, c) * factor * factor
    return _mean_over_triangle(a, b, c)
