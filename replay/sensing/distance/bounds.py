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

Triangle, distance. With any vector s and any w = s + k g, k >= 0, the points x of the triangle in the cone have
  |x| |w| >= x · w = x · s + k x · g >= min c_i · s,   hence   |x| >= min c_i · s / |w|,
whatever rounding did to s. It is tight when w is the closest point of the triangle in the half space g · x >= 0, and
s the way to it from k g. That k puts the closest point of the triangle's plane on the border of the half space.
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

_STEEP = 0.01
"""Least part 1 - (n · g)^2 that k is divided by: a smaller one makes k large and loses digits."""

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
    convex = cos_half > 0.0
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
        sag = max(max(uu, ww), tt) / 3.0
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

        # g for the direction of the centroid, and k
        nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
        nn = nx * nx + ny * ny + nz * nz
        along = (along_a + along_b + along_c) / 3.0
        rx, ry, rz = (ax + bx + cx) / 3.0 - along * vx, (ay + by + cy) / 3.0 - along * vy, (az + bz + cz) / 3.0 - along * vz
        along = rx * vx + ry * vy + rz * vz  # of rounding
        rx, ry, rz = rx - along * vx, ry - along * vy, rz - along * vz
        part = cos_half / math.sqrt(rx * rx + ry * ry + rz * rz)
        gx, gy, gz = sin_half * vx - part * rx, sin_half * vy - part * ry, sin_half * vz - part * rz
        ng = nx * gx + ny * gy + nz * gz
        k = -(nx * ax + ny * ay + nz * az) * ng / max(nn - ng * ng, _STEEP * nn)
        k = k if convex & (k > 0.0) else 0.0
        px, py, pz = (k * gx, k * gy, k * gz) if k > 0.0 else (0.0, 0.0, 0.0)

        # s: from k g to the closest point of the triangle
        dx, dy, dz = ax - px, ay - py, az - pz
        t = min(max(-(dx * ux + dy * uy + dz * uz) / uu, 0.0), 1.0) if uu > 0.0 else 0.0
        sx, sy, sz = dx + t * ux, dy + t * uy, dz + t * uz
        ss = sx * sx + sy * sy + sz * sz
        inner = nx * (uy * dz - uz * dy) + ny * (uz * dx - ux * dz) + nz * (ux * dy - uy * dx) <= 0.0
        height = (nx * dx + ny * dy + nz * dz) / nn
        dx, dy, dz = bx - px, by - py, bz - pz
        inner &= nx * (wy * dz - wz * dy) + ny * (wz * dx - wx * dz) + nz * (wx * dy - wy * dx) <= 0.0
        t = min(max(-(dx * wx + dy * wy + dz * wz) / ww, 0.0), 1.0) if ww > 0.0 else 0.0
        dx, dy, dz = dx + t * wx, dy + t * wy, dz + t * wz
        dd = dx * dx + dy * dy + dz * dz
        sx, sy, sz, ss = (dx, dy, dz, dd) if dd < ss else (sx, sy, sz, ss)
        dx, dy, dz = cx - px, cy - py, cz - pz
        inner &= nx * (ty * dz - tz * dy) + ny * (tz * dx - tx * dz) + nz * (tx * dy - ty * dx) <= 0.0
        t = min(max(-(dx * tx + dy * ty + dz * tz) / tt, 0.0), 1.0) if tt > 0.0 else 0.0
        dx, dy, dz = dx + t * tx, dy + t * ty, dz + t * tz
        dd = dx * dx + dy * dy + dz * dz
        sx, sy, sz = (dx, dy, dz) if dd < ss else (sx, sy, sz)
        sx, sy, sz = (height * nx, height * ny, height * nz) if inner & (nn > 0.0) else (sx, sy, sz)

        qx, qy, qz = sx + px, sy + py, sz + pz
        least = min(min(ax * sx + ay * sy + az * sz, bx * sx + by * sy + bz * sz), cx * sx + cy * sy + cz * sz)
        least = max(least - k * slack, 0.0)
        near = least / (qx * qx + qy * qy + qz * qz) * least
        bounds[lane] = np.inf if missed else (near if near >= 0.0 else 0.0)
