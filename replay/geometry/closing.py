"""Caps that close an open surface, and how open it is: what its inside is measured with.

The boundary of a surface is the edges that are walked oftener one way than the other. A cone of triangles from one
apex over them, walked the other way, closes it: surface and caps together wind about a point a whole number of times,
which a ray counts, and the caps' own share is a sum over few triangles. So the generalised winding number of the
surface (Jacobson, Kavan and Sorkine-Hornung 2013) is known to rounding at the cost of one ray and the caps.

On the surface that number is half-way between both sides: 1/2 if it is closed, and off by the share of the sky that its
holes take up, seen from there: its defect, 1/2 all over a flat sheet. A defect of 1/3 on average parts what has an
inside (a cube without a face: 0.1, half a sphere: 0.2, half a pipe: 0.25, the most open of 505 parts of robots: 0.28)
from sheets (a quarter of a pipe: 0.375).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numba import float64

from replay.geometry.solid_angle import winding_number
from replay.geometry.winding import corner_indices, sides
from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel

MOST_OPEN: Final = 1.0 / 3.0
"""Surfaces whose winding number has a smaller defect than this, on average over their area, have an inside."""

NO_CAPS: Final[Floats] = np.zeros((0, 3, 3))

_ASIDE = np.array([0.0711, 0.1093, 0.0837])
"""Where the apex lies about the middle of the boundary, in its extents: in no plane that a sheet is likely to have."""

_SAMPLES = 1000
_FEWEST, _WORK = 60, 20_000_000  # samples, and samples times caps


class Openness(NamedTuple):
    """The defect of a surface's winding number, seen from the surface: on average over its area, and the largest."""

    mean: float
    largest: float

    @property
    def has_inside(self) -> bool:
        """Whether the surface is closed enough to have an inside."""
        return self.mean < MOST_OPEN


def caps(triangles: Floats) -> Floats:
    """Return triangles (m, 3, 3) that close a surface (n, 3, 3) [m]; none if it is closed. Corners join where equal."""
    points, faces = corner_indices(triangles)
    found = sides(faces)
    balance = found.balance
    rim = np.flatnonzero(balance)
    if len(rim) == 0:
        return NO_CAPS
    ends = found.ends[rim]
    forward = balance[rim] > 0
    ends = np.repeat(np.where(forward[:, None], ends[:, ::-1], ends), np.abs(balance[rim]), axis=0)
    rims = points[np.unique(ends)]
    apex = rims.mean(axis=0) + float(np.max(np.ptp(rims, axis=0))) * _ASIDE
    return np.stack([np.broadcast_to(apex, (len(ends), 3)), points[ends[:, 0]], points[ends[:, 1]]], axis=1)


def openness(triangles: Floats, closing: Floats) -> Openness:
    """Return how open a surface (n, 3, 3) [m] is that `closing` (m, 3, 3) closes, seen from up to 1000 triangles."""
    if len(closing) == 0:
        return Openness(0.0, 0.0)
    a, b, c = np.moveaxis(triangles, 1, 0)
    area = np.sqrt(np.sum(np.cross(b - a, c - a) ** 2, axis=1))
    total = np.cumsum(area / np.max(area))
    count = min(_SAMPLES, max(_FEWEST, _WORK // len(closing)))
    seen = np.minimum(np.searchsorted(total, (np.arange(count) + 0.5) / count * total[-1]), len(total) - 1)
    off = _shares(np.ascontiguousarray(triangles[seen].mean(axis=1)), np.ascontiguousarray(closing))
    off = np.abs(off - np.round(off))
    return Openness(float(off.mean()), float(off.max()))


@entry(float64[:, ::1], float64[:, :, ::1])
@kernel
def _shares(points: Floats, closing: Floats) -> Floats:
    result = np.empty(len(points))
    for k in range(len(points)):
        result[k] = winding_number(points[k], closing)
    return result
