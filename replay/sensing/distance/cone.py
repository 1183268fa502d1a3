"""The closest point of one triangle to the apex of a cone, inside the cone: exact, by cases.

The apex is the origin, v the unit axis, h = aperture / 2 in (0, pi], a b c the corners. The sensed volume V holds x
when angle(x, v) <= h. One candidate of the triangle's plane and three of its edges are enough.

Plane. n is the unit normal with delta = n · x > 0 on the triangle, phi = angle(n, v), psi = phi - h. A point of the
plane at the angle beta from n is delta / cos(beta) away, so the closest point of plane ∩ V has the smallest beta that V
allows: beta = 0 (the foot R = delta n, case 1) when psi <= 0, else beta = psi, on the border ray
  r = cos h v + sin h g,   g = unit part of n orthogonal to v,   distance delta / cos psi   (case 2)
and none when psi >= 90 deg. If it lies in the triangle, it is the answer: for h <= 90 deg plane ∩ V is convex; above, V
is the complement of a convex cone, and a second local minimum on the conic does not exist (the far vertex of the conic
is farther from R than its radius of curvature). If it does not, the answer lies on an edge. The axis is never
intersected with the plane, and one sign decides between foot and border, so rounding cannot lose both.

Edge a b. m is the unit normal of the plane through apex and edge, mu = v · m, s k = m × v, w = k × m. In the basis
(w, k) the cone is the sector between the rays
  r∓ = (cos h, ∓D) / s,   D^2 = (sin h - mu)(sin h + mu) = (s - cos h)(s + cos h)
(two forms of the same number: the first is accurate for narrow cones, the second for wide ones) and the edge turns
from a to b counter-clockwise by less than 180 deg. So it can only enter through r- and leave through r+, and it crosses
a ray exactly when a lies before it and b after it: signs of 2x2 cross products, no quadratic, no root on the mirrored
cone. The crossing is |a × b| / (r × e) along the ray, e = b - a: a point of the border by construction (case 3). The
foot of the apex on the edge, e × (a × b) / |e|^2 (case 4), and the corners (case 5) compete when they lie in the
sector. Above 90 deg the sector is that of the complement (axis -v, half angle 180 deg - h), and its outside counts. An
edge on a line through the apex has no such plane: its corners compete by membership,
  |v × x| cos h <= (v · x) sin h.

Slivers need no case of their own: their normal is formed in twice the working precision. Nearness to the apex below
`TOUCH` of the farthest corner is rounding of the corners themselves: the apex is on the triangle.
Source: J. Huijgens, TU Eindhoven 2015, for the five cases; the forms used are derived here.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from replay.numerics.jit import kernel
from replay.sensing.distance.vectors import (
    Vector,
    accurate_cross,
    accurate_normal,
    combined,
    cross,
    dot,
    norm,
    scaled,
    subtract,
)

EPSILON = float(np.finfo(np.float64).eps)

TOUCH = 40.0 * EPSILON
"""An apex nearer to the triangle than this part of its farthest corner lies on it.

Corners are rounded, often in a frame where they are larger than seen from the apex: 5 ulps occur in the hard cases.
"""

_LATERAL = 4.0 * EPSILON
"""A plane candidate this far outside an edge, as part of the farthest corner, is taken as on it: it was rounded."""

_DIRECTION = 4.0 * EPSILON
"""Rounding of a direction [rad] in the membership test."""

_SLIVER = 1e-4
"""Below this (doubled area / longest edge squared), squared, the plain normal is too rough."""

NOTHING, FOOT, CONIC_BORDER, EDGE_BORDER, EDGE_FOOT, CORNER = range(6)
"""The thesis's cases."""


class Cone(NamedTuple):
    """A cone with its apex at the origin: unit axis, cosine and sine of the half angle."""

    vx: float
    vy: float
    vz: float
    cos_half: float
    sin_half: float


def half_angle(aperture: float) -> tuple[float, float]:
    """Return cosine and sine of half the aperture [rad]; exact for the half space and the full sphere."""
    if aperture >= 2.0 * math.pi:
        return -1.0, 0.0
    if aperture == math.pi:
        return 0.0, 1.0
    return math.cos(0.5 * aperture), math.sin(0.5 * aperture)


@kernel
def in_cone(x: Vector, cone: Cone) -> bool:
    """Return whether x lies in the cone; accurate for needles and for 180 deg."""
    v = (cone.vx, cone.vy, cone.vz)
    outside = norm(accurate_cross(v, x)) * cone.cos_half - dot(v, x) * cone.sin_half
    return outside <= _DIRECTION * norm(x)


@kernel
def _beside(p: Vector, corner: Vector, e: Vector, normal: Vector, slack: float) -> bool:
    """Return whether p, in the triangle's plane, lies outside the edge e at `corner` by more than the slack [m]."""
    side = dot(normal, cross(e, subtract(p, corner)))
    return side < 0.0 and side * side > slack * slack * dot(e, e)


@kernel
def _in_triangle(p: Vector, a: Vector, b: Vector, c: Vector, normal: Vector, slack: float) -> bool:
    """Return whether p, in the plane of a b c with that unit normal, lies in the triangle or within the slack [m]."""
    if _beside(p, a, subtract(b, a), normal, slack):
        return False
    if _beside(p, b, subtract(c, b), normal, slack):
        return False
    return not _beside(p, c, subtract(a, c), normal, slack)


@kernel
def _radial_edge(a: Vector, b: Vector, length_a: float, length_b: float, cone: Cone) -> tuple[float, Vector, int]:
    """Return the candidate of an edge that is a point or lies on a line through the apex."""
    if dot(a, b) < 0.0:
        return 0.0, (0.0, 0.0, 0.0), EDGE_FOOT
    a_inside = in_cone(a, cone)
    if in_cone(b, cone) and (length_b < length_a or not a_inside):
        return length_b, b, CORNER
    if a_inside:
        return length_a, a, CORNER
    return np.inf, a, NOTHING


@kernel
def closest_on_edge(
    a: Vector, b: Vector, length_a: float, length_b: float, cone: Cone, touch: float
) -> tuple[float, Vector, int]:
    """Return distance (inf when none), point and case of the edge's closest point in the cone."""
    area = accurate_cross(a, b)
    e = subtract(b, a)
    doubled = norm(area)
    squared = dot(e, e)
    if doubled == 0.0 or squared == 0.0:
        return _radial_edge(a, b, length_a, length_b, cone)

    # Foot of the apex on the edge
    off_line = doubled / math.sqrt(squared)
    has_foot = dot(a, e) < 0.0 < dot(b, e)
    nearest = off_line if has_foot else min(length_a, length_b)
    if has_foot and off_line <= touch:
        return 0.0, (0.0, 0.0, 0.0), EDGE_FOOT
    foot = scaled(1.0 / squared, cross(e, area))

    # The sector that the plane through apex and edge cuts from the cone, or, above 90 deg, from its complement
    wide = cone.cos_half < 0.0
    flip = -1.0 if wide else 1.0
    cos_half = flip * cone.cos_half
    v = (flip * cone.vx, flip * cone.vy, flip * cone.vz)
    m = scaled(1.0 / doubled, area)
    mu = dot(v, m)
    k = accurate_cross(m, v)
    s = norm(k)
    if cos_half > cone.sin_half:
        opening = (cone.sin_half - mu) * (cone.sin_half + mu)
    else:
        opening = (s - cos_half) * (s + cos_half)
    if opening < 0.0 or s == 0.0:
        if not wide and opening < 0.0:
            return np.inf, a, NOTHING
        if has_foot:
            return off_line, foot, EDGE_FOOT
        if length_b < length_a:
            return length_b, b, CORNER
        return length_a, a, CORNER
    k = scaled(1.0 / s, k)
    w = cross(k, m)
    D = math.sqrt(opening)

    # Where foot and corners lie in the sector: before r- (entry > 0), after r+ (exit < 0)
    foot_x, foot_y = dot(foot, w), dot(foot, k)
    if has_foot and _in_volume(-foot_x * D - foot_y * cos_half, foot_x * D - foot_y * cos_half, wide):
        return off_line, foot, EDGE_FOOT
    a_x, a_y, b_x, b_y = dot(a, w), dot(a, k), dot(b, w), dot(b, k)
    entry_a, exit_a = -a_x * D - a_y * cos_half, a_x * D - a_y * cos_half
    entry_b, exit_b = -b_x * D - b_y * cos_half, b_x * D - b_y * cos_half
    distance, point, case = np.inf, a, NOTHING
    if _in_volume(entry_a, exit_a, wide):
        distance, case = length_a, CORNER
    if length_b < distance and _in_volume(entry_b, exit_b, wide):
        distance, point, case = length_b, b, CORNER

    # Crossings of the border
    for side in (-1.0, 1.0):
        before = entry_a if side < 0.0 else exit_a
        after = entry_b if side < 0.0 else exit_b
        if before > 0.0 and after < 0.0:
            turn = cos_half * dot(e, k) - side * D * dot(e, w)
            along = nearest
            if turn > 0.0:
                along = min(max(doubled * s / turn, nearest), max(length_a, length_b))
            if along < distance:
                distance, case = along, EDGE_BORDER
                point = combined(along * cos_half / s, w, along * side * D / s, k)
    return distance, point, case


@kernel
def _in_volume(entry: float, exit: float, wide: bool) -> bool:
    """Return whether a point is in the sector, or, for a wide cone, not inside the complement's."""
    if wide:
        return not (entry < 0.0 and exit > 0.0)
    return entry <= 0.0 and exit >= 0.0


@kernel
def _border_ray(n: Vector, v: Vector, cos_half: float, sin_half: float) -> Vector:
    """Return the unit vector on the cone's border that is closest to n; any one of them when n is -v."""
    k = accurate_cross(n, v)
    length = norm(k)
    if length == 0.0:
        k = cross(v, (0.0, 0.0, 1.0)) if abs(v[2]) < 0.5 else cross(v, (1.0, 0.0, 0.0))
        length = norm(k)
    return combined(cos_half, v, sin_half / length, cross(v, k))


@kernel
def closest_on_triangle(a: Vector, b: Vector, c: Vector, cone: Cone) -> tuple[float, Vector, int]:
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
    touch = TOUCH * extent
    if min(length_a, length_b, length_c) <= touch:
        return 0.0, (0.0, 0.0, 0.0), CORNER

    # Plane
    ab, ac = subtract(b, a), subtract(c, a)
    bc = subtract(c, b)
    longest = max(dot(ab, ab), dot(ac, ac), dot(bc, bc))
    area = accurate_cross(ab, ac)
    squared = dot(area, area)
    if squared < _SLIVER * longest * longest:
        area = accurate_normal(a, b, c)
        squared = dot(area, area)
    if squared > 0.0:
        turned = scaled(1.0 / math.sqrt(squared), area)
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
        slack = _LATERAL * extent
        if delta <= touch:
            if _in_triangle(scaled(delta, n), a, b, c, turned, slack):
                return 0.0, (0.0, 0.0, 0.0), FOOT
        else:
            v = (cone.vx, cone.vy, cone.vz)
            cos_phi = dot(n, v)
            sin_phi = norm(accurate_cross(n, v))
            if sin_phi * cone.cos_half - cos_phi * cone.sin_half <= 0.0:
                foot = scaled(delta, n)
                if _in_triangle(foot, a, b, c, turned, slack):
                    return delta, foot, FOOT
            else:
                cos_psi = cos_phi * cone.cos_half + sin_phi * cone.sin_half
                if cos_psi > 0.0 and delta <= 2.0 * extent * cos_psi:
                    along = delta / cos_psi
                    border = scaled(along, _border_ray(n, v, cone.cos_half, cone.sin_half))
                    if _in_triangle(border, a, b, c, turned, slack):
                        return along, border, CONIC_BORDER

    # Edges
    distance, point, case = closest_on_edge(a, b, length_a, length_b, cone, touch)
    other, other_point, other_case = closest_on_edge(b, c, length_b, length_c, cone, touch)
    if other < distance:
        distance, point, case = other, other_point, other_case
    other, other_point, other_case = closest_on_edge(c, a, length_c, length_a, cone, touch)
    if other < distance:
        distance, point, case = other, other_point, other_case
    return distance, point, case
