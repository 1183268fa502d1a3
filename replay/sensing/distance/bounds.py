"""Lower bounds of the distance from the apex to what lies in the cone, eight boxes or eight triangles at a time.

The apex is the origin, v the axis, h the half angle; f(x) = |x| sin(h - theta), theta the angle of x to v, is positive
inside the cone and changes by no more than the way a point moves. For h <= 90 deg f is concave and, for every unit r
orthogonal to v, f(x) <= g · x with g = sin h v - cos h r; where r points at x, they are equal. "No point in the cone"
below means: none with f >= -slack, and bounds hold up to the slack, see `query_slack`.

Box, centre C, half widths h_i along the axes e_i. The distance to the box itself; and no point is in the cone when
f(C) + |half widths| < 0, nor, for h <= 90 deg, when g · C + sum h_i |g · e_i| < 0, r pointing at C, nor when all of the
box is behind the apex.

Triangle, cone. A point x = sum l_i c_i of the corners has |x|^2 = sum l_i |c_i|^2 - sum_{i<j} l_i l_j |c_i - c_j|^2.
Above 90 deg f is convex, hence largest on a corner. Below, f is a linear function minus cos h times the distance to the
axis, whose curvature is at most 1 / (that distance), so f exceeds its largest corner value by at most
cos h (L^2 / 3) / (2 distance), L the longest edge, and by at most the way to the nearest corner, L / sqrt 3.

Triangle, distance. For any vector s, every point x of the triangle has |x| |s| >= x · s >= min c_i · s. With s the
closest point of the triangle this is the distance to it, and it is a bound whatever rounding did to s.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.geometry.wide_tree import AXES, CENTRE, HALVES, LANES, SHORT
from replay.numerics.jit import kernel
from replay.sensing.distance.cone import EPSILON, Cone
from replay.sensing.distance.vectors import Vector

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]

_THIRD = 1.0 / 3.0

X, Y, Z = LANES * CENTRE, LANES * (CENTRE + 1), LANES * (CENTRE + 2)
E, H = LANES * AXES, LANES * HALVES


@kernel
def box_bounds(boxes: Singles, middle: Vector, cone: Cone, slack: float, bounds: Floats) -> None:
    """Write lower bounds of the squared distances [m^2] of a node's boxes; inf when nothing of it is in the cone.

    Args:
        boxes: (BOX * LANES,) as in `WideTree`.
        middle: what the centres are seen from, seen from the apex [m].
        bounds: (LANES,); a NaN after an overflow says nothing.
    """
    cos_half, sin_half = cone.cos_half, cone.sin_half
    vx, vy, vz = cone.vx, cone.vy, cone.vz
    convex = cos_half >= 0.0
    for lane in range(len(bounds)):
        x, y, z = boxes[X + lane] + middle[0], boxes[Y + lane] + middle[1], boxes[Z + lane] + middle[2]
        e00, e01, e02 = boxes[E + lane], boxes[E + LANES + lane], boxes[E + 2 * LANES + lane]
        e10, e11, e12 = boxes[E + 3 * LANES + lane], boxes[E + 4 * LANES + lane], boxes[E + 5 * LANES + lane]
        e20, e21, e22 = boxes[E + 6 * LANES + lane], boxes[E + 7 * LANES + lane], boxes[E + 8 * LANES + lane]
        h0, h1, h2 = (
            np.float64(boxes[H + lane]),
            np.float64(boxes[H + LANES + lane]),
            np.float64(boxes[H + 2 * LANES + lane]),
        )
        c0, c1, c2 = e00 * x + e01 * y + e02 * z, e10 * x + e11 * y + e12 * z, e20 * x + e21 * y + e22 * z
        v0, v1, v2 = e00 * vx + e01 * vy + e02 * vz, e10 * vx + e11 * vy + e12 * vz, e20 * vx + e21 * vy + e22 * vz
        gap0, gap1, gap2 = max(abs(c0) - h0, 0.0), max(abs(c1) - h1, 0.0), max(abs(c2) - h2, 0.0)
        along = vx * x + vy * y + vz * z
        kx, ky, kz = vy * z - vz * y, vz * x - vx * z, vx * y - vy * x
        across = math.sqrt(kx * kx + ky * ky + kz * kz)
        outside = across * cos_half - along * sin_half - slack  # -f(C)

        # g · e_i, times the distance to the axis
        turned = sin_half * across + cos_half * along
        g0, g1, g2 = abs(turned * v0 - cos_half * c0), abs(turned * v1 - cos_half * c1), abs(turned * v2 - cos_half * c2)
        rounding = 16.0 * EPSILON * (across + abs(along)) * (h0 + h1 + h2)
        beside = outside * across > h0 * g0 + h1 * g1 + h2 * g2 + rounding
        behind = along + h0 * abs(v0) + h1 * abs(v1) + h2 * abs(v2) < -slack
        far = (outside > 0.0) & (outside * outside > h0 * h0 + h1 * h1 + h2 * h2)
        missed = far | (convex & (beside | behind))
        near = (1.0 - SHORT) * (gap0 * gap0 + gap1 * gap1 + gap2 * gap2)
        bounds[lane] = np.inf if missed else near


@kernel
def triangle_bounds(corners: Floats, apex: Vector, cone: Cone, slack: float, bounds: Floats) -> None:
    """Write lower bounds of the squared distances [m^2] of a leaf's triangles; inf when none of it is in the cone.

    Args:
        corners: (9 * LANES,) as in `WideTree`.
        bounds: (LANES,).
    """
    cos_half, sin_half = cone.cos_half, cone.sin_half
    vx, vy, vz = cone.vx, cone.vy, cone.vz
    for lane in range(len(bounds)):
        ax, ay, az = (
            corners[lane] - apex[0],
            corners[LANES + lane] - apex[1],
            corners[2 * LANES + lane] - apex[2],
        )
        bx, by, bz = (
            corners[3 * LANES + lane] - apex[0],
            corners[4 * LANES + lane] - apex[1],
            corners[5 * LANES + lane] - apex[2],
        )
        cx, cy, cz = (
            corners[6 * LANES + lane] - apex[0],
            corners[7 * LANES + lane] - apex[1],
            corners[8 * LANES + lane] - apex[2],
        )
        ux, uy, uz = bx - ax, by - ay, bz - az
        wx, wy, wz = cx - bx, cy - by, cz - bz
        tx, ty, tz = ax - cx, ay - cy, az - cz
        uu, ww, tt = ux * ux + uy * uy + uz * uz, wx * wx + wy * wy + wz * wz, tx * tx + ty * ty + tz * tz

        # Cone
        sag = max(max(uu, ww), tt) * _THIRD
        reach = math.sqrt(sag)
        along_a, along_b, along_c = (
            ax * vx + ay * vy + az * vz,
            bx * vx + by * vy + bz * vz,
            cx * vx + cy * vy + cz * vz,
        )
        kx, ky, kz = vy * az - vz * ay, vz * ax - vx * az, vx * ay - vy * ax
        across_a = math.sqrt(kx * kx + ky * ky + kz * kz)
        kx, ky, kz = vy * bz - vz * by, vz * bx - vx * bz, vx * by - vy * bx
        across_b = math.sqrt(kx * kx + ky * ky + kz * kz)
        kx, ky, kz = vy * cz - vz * cy, vz * cx - vx * cz, vx * cy - vy * cx
        across_c = math.sqrt(kx * kx + ky * ky + kz * kz)
        outside_a = across_a * cos_half - along_a * sin_half
        outside_b = across_b * cos_half - along_b * sin_half
        outside_c = across_c * cos_half - along_c * sin_half
        outside = min(min(outside_a, outside_b), outside_c) - slack
        free = min(min(across_a, across_b), across_c) - reach
        bent = (free > 0.0) & (outside * free > 0.5 * sag * cos_half)
        missed = (outside > 0.0) & ((outside > reach) | bent | (cos_half <= 0.0))

        # Distance: s is the closest point of the triangle, on an edge or inside
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        nn = nx * nx + ny * ny + nz * nz
        height = (nx * ax + ny * ay + nz * az) / nn
        inner_u = nx * (uy * az - uz * ay) + ny * (uz * ax - ux * az) + nz * (ux * ay - uy * ax) <= 0.0
        inner_w = nx * (wy * bz - wz * by) + ny * (wz * bx - wx * bz) + nz * (wx * by - wy * bx) <= 0.0
        inner_t = nx * (ty * cz - tz * cy) + ny * (tz * cx - tx * cz) + nz * (tx * cy - ty * cx) <= 0.0
        at = min(max(-(ax * ux + ay * uy + az * uz) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
        sx, sy, sz = ax + at * ux, ay + at * uy, az + at * uz
        ss = sx * sx + sy * sy + sz * sz
        at = min(max(-(bx * wx + by * wy + bz * wz) / ww, 0.0), 1.0) if ww > 0.0 else 0.0
        qx, qy, qz = bx + at * wx, by + at * wy, bz + at * wz
        qq = qx * qx + qy * qy + qz * qz
        nearer = qq < ss
        sx, sy, sz, ss = qx if nearer else sx, qy if nearer else sy, qz if nearer else sz, qq if nearer else ss
        at = min(max(-(cx * tx + cy * ty + cz * tz) / tt, 0.0), 1.0) if tt > 0.0 else 0.0
        qx, qy, qz = cx + at * tx, cy + at * ty, cz + at * tz
        nearer = qx * qx + qy * qy + qz * qz < ss
        sx, sy, sz = qx if nearer else sx, qy if nearer else sy, qz if nearer else sz
        inner = inner_u & inner_w & inner_t & (nn > 0.0)
        sx, sy, sz = height * nx if inner else sx, height * ny if inner else sy, height * nz if inner else sz
        least = min(min(ax * sx + ay * sy + az * sz, bx * sx + by * sy + bz * sz), cx * sx + cy * sy + cz * sz)
        least = max(least, 0.0)
        near = least / (sx * sx + sy * sy + sz * sz) * least
        bounds[lane] = np.inf if missed else (near if near >= 0.0 else 0.0)
