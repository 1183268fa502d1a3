"""The thesis's own steps for a triangle in a cone, to the letter, as a model version to compare with.

R is the foot of the apex on the triangle's plane, S the point where the cone's axis meets the plane, alpha / 2 = h.
1. R, if it lies in the triangle and in the cone.
2. Else the border of the conic section on the ray from R towards S: the smallest root t >= 0 of
     (v · x)^2 = |x|^2 cos^2 h,  x = R + t (S - R),  v · x >= 0, if it lies in the triangle.
3. The roots of the same quadratic on the edges, x = a + t (b - a), 0 <= t <= 1.
4. The feet of the apex on the edges, in the cone.
5. The corners in the cone, where in the cone means v · x >= |x| cos h.
The closest of 2 to 5 is the answer.

Where the quadratic's root is a double one (an edge through the apex, a plane that touches the cone) it is right to 1e-7
of the farthest corner only: the border point may lie that far outside the cone, and the reading be that much too near.

Its failures are kept, for they are what a comparison should show. A plane parallel to the axis has no S, one that
leaves the axis slowly has it behind the apex, so that the ray from R runs away from the cone; when R = S there is no
ray: step 2 then finds nothing, and the reading is too far or missing. Where the quadratic's leading coefficient
vanishes (an edge parallel to the border, to rounding) step 3 finds nothing. An apex on a face reads what rounding says:
0, the gap, or what is behind. Below apertures of about 2e-8 rad cos h rounds to 1: a quarter of the triangles in front
of a needle are missed, the others are right to 1e-6 only. Above 180 deg steps 2 and 3 look at the mirrored cone. A
triangle without area has edges only. Measured in tests/sensing/distance/test_models.py.
Source: J. Huijgens, TU Eindhoven 2015, chapter on the distance sensor.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.numerics.arrays import Floats
from replay.numerics.constants import EPSILON
from replay.numerics.jit import entry, kernel
from replay.numerics.triples import Triple, combined, cross, dot, minus, norm, scaled
from replay.sensing.distance.cone import CONIC_BORDER, CORNER, EDGE_BORDER, EDGE_FOOT, FOOT, NOTHING
from replay.sensing.distance.exact import axis_of, same_pose
from replay.sensing.distance.readings import NEAREST_TYPE, Nearest

_VANISHING = 8.0 * EPSILON
"""Rounding of the quadratic's leading coefficient, as part of the direction's square: less than this is nothing."""


@kernel
def _in_triangle(x: Triple, a: Triple, b: Triple, c: Triple, normal: Triple) -> bool:
    if dot(normal, cross(minus(b, a), minus(x, a))) < 0.0:
        return False
    if dot(normal, cross(minus(c, b), minus(x, b))) < 0.0:
        return False
    return dot(normal, cross(minus(a, c), minus(x, c))) >= 0.0


@kernel
def _roots(p: Triple, e: Triple, v: Triple, cos_half: float) -> tuple[float, float]:
    """Return the roots of (v · x)^2 = |x|^2 cos^2 h on x = p + t e, the smaller first; NaN when there are none."""
    square = cos_half * cos_half
    leading = dot(v, e) * dot(v, e) - square * dot(e, e)
    middle = dot(v, p) * dot(v, e) - square * dot(p, e)
    last = dot(v, p) * dot(v, p) - square * dot(p, p)
    discriminant = middle * middle - leading * last
    if abs(leading) <= _VANISHING * dot(e, e) or not discriminant >= 0.0:
        return np.nan, np.nan
    root = math.sqrt(discriminant)
    t1, t2 = (-middle - root) / leading, (-middle + root) / leading
    return min(t1, t2), max(t1, t2)


@kernel
def thesis_triangle(a: Triple, b: Triple, c: Triple, v: Triple, cos_half: float) -> tuple[float, Triple, int]:
    """Return distance (inf when none), point and case of a triangle relative to the apex, by the thesis's steps."""
    best, point, case = np.inf, a, NOTHING

    # 1: R
    normal = cross(minus(b, a), minus(c, a))
    area = norm(normal)
    if area > 0.0:
        n = scaled(1.0 / area, normal)
        height = dot(n, a)
        R = scaled(height, n)
        if dot(v, R) >= norm(R) * cos_half and _in_triangle(R, a, b, c, n):
            return norm(R), R, FOOT
        # 2: the ray from R towards S
        lean = dot(n, v)
        if lean != 0.0:
            towards = minus(scaled(height / lean, v), R)
            t1, t2 = _roots(R, towards, v, cos_half)
            for t in (t2, t1):
                x = combined(1.0, R, t, towards)
                if t >= 0.0 and dot(v, x) >= 0.0 and _in_triangle(x, a, b, c, n) and norm(x) < np.inf:
                    best, point, case = norm(x), x, CONIC_BORDER

    # 3, 4 and 5: edges and corners
    first = a
    for edge in range(3):
        p = first
        q = b if edge == 0 else (c if edge == 1 else a)
        first = q
        e = minus(q, p)
        t1, t2 = _roots(p, e, v, cos_half)
        for t in (t1, t2):
            x = combined(1.0, p, t, e)
            if 0.0 <= t <= 1.0 and dot(v, x) >= 0.0 and norm(x) < best:
                best, point, case = norm(x), x, EDGE_BORDER
        square = dot(e, e)
        if square > 0.0:
            t = -dot(p, e) / square
            x = combined(1.0, p, t, e)
            if 0.0 <= t <= 1.0 and dot(v, x) >= norm(x) * cos_half and norm(x) < best:
                best, point, case = norm(x), x, EDGE_FOOT
        if dot(v, p) >= norm(p) * cos_half and norm(p) < best:
            best, point, case = norm(p), p, CORNER
    return best, point, case


@entry(float64[:, :, ::1], float64[:, :, ::1], float64, float64, int64, NEAREST_TYPE)
@kernel
def sweep_thesis(
    triangles: Floats, T_target_sensor: Floats, cos_half: float, reach: float, target: int, nearest: Nearest
) -> None:
    """As `replay.sensing.distance.exact.sweep_exact`, by the thesis's steps on every triangle."""
    best, point, triangle, case = np.inf, (np.nan, np.nan, np.nan), -1, NOTHING
    for i in range(len(T_target_sensor)):
        if i == 0 or not same_pose(T_target_sensor, i, i - 1):
            pose = T_target_sensor[i]
            v = axis_of(pose)
            best, triangle = np.inf, -1
            for k in range(len(triangles)):
                t = triangles[k]
                a = (t[0, 0] - pose[0, 3], t[0, 1] - pose[1, 3], t[0, 2] - pose[2, 3])
                b = (t[1, 0] - pose[0, 3], t[1, 1] - pose[1, 3], t[1, 2] - pose[2, 3])
                c = (t[2, 0] - pose[0, 3], t[2, 1] - pose[1, 3], t[2, 2] - pose[2, 3])
                distance, x, which = thesis_triangle(a, b, c, v, cos_half)
                if distance < best:
                    best, point, triangle, case = distance, x, k, which
        if triangle >= 0 and best <= reach and best < nearest.distance[i]:
            nearest.distance[i] = best
            for k in range(3):
                nearest.offset[i, k] = point[k]
            nearest.target[i] = target
            nearest.triangle[i] = triangle
            nearest.case[i] = case
