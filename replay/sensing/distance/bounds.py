"""Lower bounds of the distance from the apex to what lies in the cone, eight boxes or eight triangles at a time.

The apex is the origin, v the axis, h the half angle; f(x) = |x| sin(h - theta), theta the angle of x to v, is positive
inside the cone and changes by no more than the way a point moves. For h <= 90 deg f is concave and, for every unit r
orthogonal to v, f(x) <= g · x with g = sin h v - cos h r, a unit vector; where r points at x, they are equal. Points
that leave the cone by rounding, up to the slack of `query_slack`, count as in it.

Box, centre C, half widths h_i along the axes e_i. The distance to the box; and no point of it is in the cone when
f(C) + |half widths| < 0, nor, for h <= 90 deg, when g · C + sum h_i |g · e_i| < 0, r pointing at C, nor when the box is
behind the apex, v · C + sum h_i |v · e_i| < 0.

Triangle, cone. A point x = sum l_i c_i of the corners has |x|^2 = sum l_i |c_i|^2 - sum_{i<j} l_i l_j |c_i - c_j|^2,
where the last sum is at most L^2 / 3, L the longest edge. Above 90 deg f is convex, hence largest on a corner. Below, f
is a linear function minus cos h times the distance to the axis, whose curvature is at most 1 / (that distance), so f
exceeds its largest corner value by at most cos h (L^2 / 3) / (2 distance), and by at most the way to the nearest
corner, L / sqrt 3.

Triangle, distance. For any vector s, every point x of the triangle has |x| |s| >= x · s >= min c_i · s. With s the
closest point of the triangle this is the distance to it, and it is a bound whatever rounding did to s.

The loops have no branch, write to one array and run over its length, so that they compile to vector instructions:
19 ns for eight boxes and 35 ns for eight triangles where one exact triangle takes 75 ns. Indices begin with the lane:
only then does the compiler see that they are not negative, and loads neighbours at once.
"""

from __future__ import annotations

import math

import numpy as np

from replay.geometry.surface_boxes import AXES, CENTRE, HALVES, SHORT
from replay.geometry.wide_tree import LANES
from replay.numerics.arrays import Floats, Singles
from replay.numerics.constants import EPSILON
from replay.numerics.jit import kernel
from replay.numerics.triples import Triple, combined, cross, dot, minus, norm, scaled
from replay.sensing.distance.cone import Cone

_THIRD = 1.0 / 3.0


@kernel
def single_vector(numbers: Singles, first: int, lane: int) -> Triple:
    """Return three numbers of a lane, in double precision."""
    return (
        np.float64(numbers[lane + LANES * first]),
        np.float64(numbers[lane + LANES * first + LANES]),
        np.float64(numbers[lane + LANES * first + 2 * LANES]),
    )


@kernel
def corner_from(apex: Triple, corners: Floats, corner: int, lane: int) -> Triple:
    """Return a corner of a lane's triangle, seen from the apex."""
    return (
        corners[lane + 3 * LANES * corner] - apex[0],
        corners[lane + 3 * LANES * corner + LANES] - apex[1],
        corners[lane + 3 * LANES * corner + 2 * LANES] - apex[2],
    )


@kernel
def box_bounds(boxes: Singles, middle: Triple, cone: Cone, slack: float, bounds: Floats) -> None:
    """Write lower bounds of the squared distances [m^2] of a node's boxes; inf when nothing of it is in the cone.

    Args:
        boxes: (BOX * LANES,) as in `WideTree`.
        middle: what the centres are seen from, seen from the apex [m].
        cone: axis and half angle.
        slack: see `query_slack` [m].
        bounds: (LANES,); NaN where numbers overflow.
    """
    cos_half, sin_half = cone.cos_half, cone.sin_half
    v = (cone.vx, cone.vy, cone.vz)
    narrow = cos_half >= 0.0
    for lane in range(len(bounds)):
        c = single_vector(boxes, CENTRE, lane)
        c = (c[0] + middle[0], c[1] + middle[1], c[2] + middle[2])
        e0, e1, e2 = (
            single_vector(boxes, AXES, lane),
            single_vector(boxes, AXES + 3, lane),
            single_vector(boxes, AXES + 6, lane),
        )
        h = single_vector(boxes, HALVES, lane)
        c0, c1, c2 = dot(e0, c), dot(e1, c), dot(e2, c)
        v0, v1, v2 = dot(e0, v), dot(e1, v), dot(e2, v)
        # Distance to the box
        gap = (max(abs(c0) - h[0], 0.0), max(abs(c1) - h[1], 0.0), max(abs(c2) - h[2], 0.0))

        # f(C) + |half widths| < 0
        along, across = dot(v, c), norm(cross(v, c))
        outside = across * cos_half - along * sin_half - slack  # -f(C)
        far = (outside > 0.0) & (outside * outside > dot(h, h))
        # g · C + sum h_i |g · e_i| < 0
        turned = sin_half * across + cos_half * along
        g = (abs(turned * v0 - cos_half * c0), abs(turned * v1 - cos_half * c1), abs(turned * v2 - cos_half * c2))
        rounding = 16.0 * EPSILON * (across + abs(along)) * (h[0] + h[1] + h[2])
        beside = outside * across > dot(h, g) + rounding  # both sides times `across`
        # v · C + sum h_i |v · e_i| < 0
        behind = along + dot(h, (abs(v0), abs(v1), abs(v2))) < -slack
        bounds[lane] = np.inf if far | (narrow & (beside | behind)) else (1.0 - SHORT) * dot(gap, gap)


@kernel
def _clamped(a: Triple, e: Triple, squared: float) -> Triple:
    """Return the point of the edge from a to a + e that is closest to the origin; `squared` is |e|^2."""
    t = -dot(a, e) / squared if squared > 0.0 else 0.0
    return combined(1.0, a, min(max(t, 0.0), 1.0), e)


@kernel
def _either(first: bool, a: Triple, b: Triple) -> Triple:
    return a[0] if first else b[0], a[1] if first else b[1], a[2] if first else b[2]


@kernel
def triangle_bounds(corners: Floats, apex: Triple, cone: Cone, slack: float, bounds: Floats) -> None:
    """Write lower bounds of the squared distances [m^2] of a leaf's triangles; inf when nothing of it is in the cone.

    Args:
        corners: (9 * LANES,) as in `WideTree`.
        apex: [m].
        cone: axis and half angle.
        slack: see `query_slack` [m].
        bounds: (LANES,); 0 where numbers overflow.
    """
    cos_half, sin_half = cone.cos_half, cone.sin_half
    v = (cone.vx, cone.vy, cone.vz)
    wide = cos_half <= 0.0
    for lane in range(len(bounds)):
        a, b, c = (
            corner_from(apex, corners, 0, lane),
            corner_from(apex, corners, 1, lane),
            corner_from(apex, corners, 2, lane),
        )
        ab, bc, ca = minus(b, a), minus(c, b), minus(a, c)
        ab2, bc2, ca2 = dot(ab, ab), dot(bc, bc), dot(ca, ca)

        # Cone
        sag = max(ab2, bc2, ca2) * _THIRD
        reach = math.sqrt(sag)
        across_a, across_b, across_c = norm(cross(v, a)), norm(cross(v, b)), norm(cross(v, c))
        outside = min(
            across_a * cos_half - dot(a, v) * sin_half,
            across_b * cos_half - dot(b, v) * sin_half,
            across_c * cos_half - dot(c, v) * sin_half,
        )
        outside -= slack
        nearest_axis = min(across_a, across_b, across_c) - reach
        clear = (nearest_axis > 0.0) & (outside * nearest_axis > 0.5 * sag * cos_half)
        missed = (outside > 0.0) & (wide | (outside > reach) | clear)

        # Distance
        normal = cross(ab, bc)
        squared = dot(normal, normal)
        s, other = _clamped(a, ab, ab2), _clamped(b, bc, bc2)
        s = _either(dot(other, other) < dot(s, s), other, s)
        other = _clamped(c, ca, ca2)
        s = _either(dot(other, other) < dot(s, s), other, s)
        inner = (
            (dot(normal, cross(ab, a)) <= 0.0)
            & (dot(normal, cross(bc, b)) <= 0.0)
            & (dot(normal, cross(ca, c)) <= 0.0)
            & (squared > 0.0)
        )
        s = _either(inner, scaled(dot(normal, a) / squared, normal), s)
        least = max(min(dot(a, s), dot(b, s), dot(c, s)), 0.0)
        near = least / dot(s, s) * least
        bounds[lane] = np.inf if missed else (near if near >= 0.0 else 0.0)
