"""A cone with its apex at the origin: who is in it, and what counts as at its apex.

The unit axis is v and the half angle h = aperture / 2 in (0, pi]; x is in the cone when angle(x, v) <= h, tested as
  |v × x| cos h <= (v · x) sin h,
which is accurate for needles, where cos h rounds to 1, and for 180 deg, where tan h has no value.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from replay.numerics.constants import EPSILON
from replay.numerics.jit import kernel
from replay.numerics.triples import Triple, dot, norm
from replay.sensing.distance.products import accurate_cross

TOUCH = 256.0 * EPSILON
"""Rounding of a coordinate of a corner, as part of the largest such coordinate of the triangle, seen from the apex.

Corners are rounded in a frame where they are larger than seen from the apex (5 ulps of the latter in the hard cases):
this covers triangles a hundred times smaller than their distance to the origin they were rounded at.
"""

_DIRECTION = 4.0 * EPSILON
"""Rounding of a direction [rad] in the membership test."""

NOTHING, FOOT, CONIC_BORDER, EDGE_BORDER, EDGE_FOOT, CORNER = range(6)
"""The thesis's cases."""


class Cone(NamedTuple):
    """A cone with its apex at the origin: unit axis, cosine and sine of the half angle, rounding of the apex [m]."""

    vx: float
    vy: float
    vz: float
    cos_half: float
    sin_half: float
    rounding: float


def half_angle(aperture: float) -> tuple[float, float]:
    """Return cosine and sine of half the aperture [rad]; exact for the half space and the full sphere."""
    if aperture >= 2.0 * math.pi:
        return -1.0, 0.0
    if aperture == math.pi:
        return 0.0, 1.0
    return math.cos(0.5 * aperture), math.sin(0.5 * aperture)


@kernel
def touches(q: Triple, length: float, size: Triple, apex: float) -> bool:
    """Return whether q is no farther from the origin than rounding the apex or the corners could have put it.

    Moving each coordinate i of the corners by `TOUCH` size_i changes the distance along q by their weighted sum. Of a
    face across an axis that is nothing: there the rounding of the apex decides.

    Args:
        q: a point of the triangle, its line or its plane.
        length: |q|.
        size: largest absolute coordinates of the corners.
        apex: rounding of the apex [m].
    """
    if length <= apex:
        return True
    rounding = abs(q[0]) * size[0] + abs(q[1]) * size[1] + abs(q[2]) * size[2]
    return length * length <= TOUCH * rounding


@kernel
def in_cone(x: Triple, cone: Cone) -> bool:
    """Return whether x lies in the cone; accurate for needles and for 180 deg."""
    v = (cone.vx, cone.vy, cone.vz)
    outside = norm(accurate_cross(v, x)) * cone.cos_half - dot(v, x) * cone.sin_half
    return outside <= _DIRECTION * norm(x)
