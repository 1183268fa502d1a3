"""The closest point of one edge to the apex of a cone, inside the cone.

The apex is the origin, v the axis, h the half angle, a and b the ends, e = b - a. m is the unit normal of the plane
through apex and edge, mu = v · m, s k = m × v, w = k × m. In the basis (w, k) the cone is the sector between the rays
  r∓ = (cos h, ∓D) / s,   D^2 = (sin h - mu)(sin h + mu) = (s - cos h)(s + cos h)
(two forms of the same number: the first is accurate for narrow cones, the second for wide ones) and the edge turns
from a to b counter-clockwise by less than 180 deg. So it can only enter through r- and leave through r+, and it crosses
a ray exactly when a lies before it and b after it: signs of 2x2 cross products, no quadratic, no root on the mirrored
cone. The crossing is |a × b| / (r × e) along the ray: a point of the border by construction (case 3). The foot of the
apex on the edge, e × (a × b) / |e|^2 (case 4), and the corners (case 5) compete when they lie in the sector.

Above 90 deg the sector is that of the complement (axis -v, half angle 180 deg - h), and its outside counts. An edge on
a line through the apex has no such plane: its corners compete by membership.
Source: J. Huijgens, TU Eindhoven 2015, for the cases; the forms used are derived here.
"""

from __future__ import annotations

import math

import numpy as np

from replay.numerics.jit import kernel
from replay.numerics.triples import Triple, combined, cross, dot, minus, norm, scaled
from replay.sensing.distance.cone import CORNER, EDGE_BORDER, EDGE_FOOT, NOTHING, Cone, in_cone, touches
from replay.sensing.distance.products import accurate_cross


@kernel
def _radial_edge(a: Triple, b: Triple, length_a: float, length_b: float, cone: Cone) -> tuple[float, Triple, int]:
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
def _in_volume(x: float, entry: float, exit: float, wide: bool) -> bool:
    """Return whether a point is in the sector, or, for a wide cone, not inside the complement's.

    Its component x along w decides where the plane only touches the cone: entry and exit are 0 behind the apex as well.
    """
    if wide:
        return not (entry < 0.0 and exit > 0.0)
    return entry <= 0.0 and exit >= 0.0 and x >= 0.0


@kernel
def _foot(a: Triple, e: Triple, area: Triple, doubled: float, squared: float) -> tuple[float, Triple]:
    """Return distance and place of the foot of the apex on an edge's line.

    On a line along an axis it takes two coordinates from the corner as they are, so that a range that ends on the edge
    of a box senses it.
    """
    if e[1] == 0.0 and e[2] == 0.0:
        foot = (0.0, a[1], a[2])
    elif e[2] == 0.0 and e[0] == 0.0:
        foot = (a[0], 0.0, a[2])
    elif e[0] == 0.0 and e[1] == 0.0:
        foot = (a[0], a[1], 0.0)
    else:
        return doubled / math.sqrt(squared), scaled(1.0 / squared, cross(e, area))
    return norm(foot), foot


@kernel
def closest_on_edge(
    a: Triple, b: Triple, length_a: float, length_b: float, cone: Cone, size: Triple
) -> tuple[float, Triple, int]:
    """Return distance (inf when none), point and case of the closest point in the cone; see `touches` for `size`."""
    area = accurate_cross(a, b)
    e = minus(b, a)
    doubled = norm(area)
    squared = dot(e, e)
    # No plane: an edge on a line through the apex
    if doubled == 0.0 or squared == 0.0:
        return _radial_edge(a, b, length_a, length_b, cone)

    # Foot of the apex on the edge (case 4)
    off_line, foot = _foot(a, e, area, doubled, squared)
    has_foot = dot(a, e) < 0.0 < dot(b, e)
    nearest = off_line if has_foot else min(length_a, length_b)
    if has_foot and touches(foot, off_line, size, cone.rounding):
        return 0.0, (0.0, 0.0, 0.0), EDGE_FOOT

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
    # The plane misses the cone, or its complement, or is orthogonal to the axis
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
    if has_foot and _in_volume(foot_x, -foot_x * D - foot_y * cos_half, foot_x * D - foot_y * cos_half, wide):
        return off_line, foot, EDGE_FOOT
    # Corners (case 5)
    a_x, a_y, b_x, b_y = dot(a, w), dot(a, k), dot(b, w), dot(b, k)
    entry_a, exit_a = -a_x * D - a_y * cos_half, a_x * D - a_y * cos_half
    entry_b, exit_b = -b_x * D - b_y * cos_half, b_x * D - b_y * cos_half
    distance, point, case = np.inf, a, NOTHING
    if _in_volume(a_x, entry_a, exit_a, wide):
        distance, case = length_a, CORNER
    if length_b < distance and _in_volume(b_x, entry_b, exit_b, wide):
        distance, point, case = length_b, b, CORNER

    # Crossings of the border (case 3)
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
