"""The closest point of one triangle to the apex of a cone, inside the cone: exact, by cases.

The apex is the origin, v the unit axis, h = aperture / 2 in (0, pi], a b c the corners. The sensed volume V holds x
when angle(x, v) <= h. One candidate of the triangle's plane and three of its edges are enough.

Plane. n is the unit normal with delta = n · x > 0 on the triangle, phi = angle(n, v), psi = phi - h. A point of the
plane at the angle beta from n is delta / cos(beta) away, so the closest point of plane ∩ V has the smallest beta that V
allows: beta = 0 (the foot R = delta n, case 1) when psi <= 0, else beta = psi, on the border ray
  r = cos h v + sin h g,   g = unit part of n orthogonal to v,   distance delta / cos psi   (case 2)
and none when psi >= 90 deg. If it lies in the triangle, it is the answer: for h <= 90 deg plane ∩ V is convex; above, V
is the complement of a convex cone, and a second local minimum on the conic does not exist (the far vertex of the conic
is farther from R than its radius of curvature). If it does not, the answer lies on an edge (`edge`, cases 3 to 5). The
axis is never intersected with the plane, and one sign decides between foot and border, so rounding cannot lose both.

Slivers need no case of their own: their normal is formed in twice the working precision; those no wider than rounding
are their edges. A distance below what rounding
the corners' coordinates (`TOUCH`) or of the apex can do to it is none: the apex is on the triangle.
Source: J. Huijgens, TU Eindhoven 2015, for the cases; the forms used are derived here.
"""

from __future__ import annotations

import math

from replay.numerics.constants import EPSILON
from replay.numerics.jit import kernel
from replay.numerics.triples import Triple, combined, cross, dot, minus, norm, scaled
from replay.sensing.distance.cone import CONIC_BORDER, CORNER, FOOT, Cone, touches
from replay.sensing.distance.edge import closest_on_edge
from replay.sensing.distance.products import accurate_cross, accurate_normal

_LATERAL = 4.0 * EPSILON
"""A plane candidate this far outside an edge, as part of the farthest corner, is taken as on it: it was rounded."""

_SLIVER = 1e-4
"""Below this (doubled area / longest edge squared), squared, the plain normal is too rough."""


@kernel
def _beside(p: Triple, corner: Triple, e: Triple, normal: Triple, slack: float) -> bool:
    """Return whether p, in the triangle's plane, lies outside the edge e at `corner` by more than the slack [m]."""
    side = dot(normal, cross(e, minus(p, corner)))
    return side < 0.0 and side * side > slack * slack * dot(e, e)


@kernel
def _in_triangle(p: Triple, a: Triple, b: Triple, c: Triple, normal: Triple, slack: float) -> bool:
    """Return whether p, in the plane of a b c with that unit normal, lies in the triangle or within the slack [m].

    Beyond the tip of a needle p may be far away and yet within the slack of both edges' lines; its coordinates tell.
    """
    for k in range(3):
        if p[k] < min(a[k], b[k], c[k]) - slack or p[k] > max(a[k], b[k], c[k]) + slack:
            return False
    if _beside(p, a, minus(b, a), normal, slack):
        return False
    if _beside(p, b, minus(c, b), normal, slack):
        return False
    return not _beside(p, c, minus(a, c), normal, slack)


@kernel
def _border_ray(n: Triple, v: Triple, cos_half: float, sin_half: float) -> Triple:
    """Return the unit vector on the cone's border that is closest to n; any one of them when n is -v."""
    k = accurate_cross(n, v)
    length = norm(k)
    if length == 0.0:
        k = cross(v, (0.0, 0.0, 1.0)) if abs(v[2]) < 0.5 else cross(v, (1.0, 0.0, 0.0))
        length = norm(k)
    return combined(cos_half, v, sin_half / length, cross(v, k))


@kernel
def closest_on_triangle(a: Triple, b: Triple, c: Triple, cone: Cone) -> tuple[float, Triple, int]:
    """Return distance [m] (inf when none), point and case of the triangle's closest point to the origin in the cone.

    Args:
        a, b, c: corners relative to the apex [m]; any triangle, also a segment or a point.
        cone: axis and half angle.

    Accuracy: 2e-12 of the farthest corner in every family of tests/sensing/distance/test_cone_search.py, 1e-15 as a
        rule. An edge that only just reaches into the cone, by the part g of it, is known to 1e-15 / sqrt(g): that is
        what rounding the corners does to it.
    """
    length_a, length_b, length_c = norm(a), norm(b), norm(c)
    extent = max(length_a, length_b, length_c)
    size = (
        max(abs(a[0]), abs(b[0]), abs(c[0])),
        max(abs(a[1]), abs(b[1]), abs(c[1])),
        max(abs(a[2]), abs(b[2]), abs(c[2])),
    )
    # Apex on a corner
    near = cone.rounding
    if touches(a, length_a, size, near) or touches(b, length_b, size, near) or touches(c, length_c, size, near):
        return 0.0, (0.0, 0.0, 0.0), CORNER

    # Plane
    ab, ac = minus(b, a), minus(c, a)
    bc = minus(c, b)
    longest = max(dot(ab, ab), dot(ac, ac), dot(bc, bc))
    area = accurate_cross(ab, ac)
    squared = dot(area, area)
    if squared < _SLIVER * longest * longest:
        area = accurate_normal(a, b, c)
        squared = dot(area, area)
    # no wider than the slack it is its edges, and its normal may be nothing but rounding
    slack = _LATERAL * extent
    if squared > slack * slack * longest:
        # divided, so that the normal of a plane across an axis is exact, and with it the distance of a wall
        length = math.sqrt(squared)
        turned = (area[0] / length, area[1] / length, area[2] / length)
        nearest = a
        if length_b <= length_a and length_b <= length_c:
            nearest = b
        elif length_c <= length_a:
            nearest = c
        delta = dot(turned, nearest)
        n = turned
        if delta < 0.0:
            delta = -delta
            n = scaled(-1.0, turned)
        foot = scaled(delta, n)
        if touches(foot, delta, size, near):
            if _in_triangle(foot, a, b, c, turned, slack):
                return 0.0, (0.0, 0.0, 0.0), FOOT
        else:
            v = (cone.vx, cone.vy, cone.vz)
            cos_phi = dot(n, v)
            sin_phi = norm(accurate_cross(n, v))
            # psi <= 0: the foot R (case 1)
            if sin_phi * cone.cos_half - cos_phi * cone.sin_half <= 0.0:
                if _in_triangle(foot, a, b, c, turned, slack):
                    return delta, foot, FOOT
            else:
                # psi > 0: the border ray r (case 2), none from 90 deg on
                cos_psi = cos_phi * cone.cos_half + sin_phi * cone.sin_half
                if cos_psi > 0.0 and delta <= 2.0 * extent * cos_psi:
                    along = delta / cos_psi
                    border = scaled(along, _border_ray(n, v, cone.cos_half, cone.sin_half))
                    if _in_triangle(border, a, b, c, turned, slack):
                        return along, border, CONIC_BORDER

    # Edges
    distance, point, case = closest_on_edge(a, b, length_a, length_b, cone, size)
    other, other_point, other_case = closest_on_edge(b, c, length_b, length_c, cone, size)
    if other < distance:
        distance, point, case = other, other_point, other_case
    other, other_point, other_case = closest_on_edge(c, a, length_c, length_a, cone, size)
    if other < distance:
        distance, point, case = other, other_point, other_case
    return distance, point, case
