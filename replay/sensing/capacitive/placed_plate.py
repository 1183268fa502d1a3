"""A plate as a body sees it, and where the body's points and triangles lie about it.

Across x and across y, space is divided by the plate's borders: a point's distance to the plate has the components u and
v beyond the borders, 0 between them, and z.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from replay.numerics.arrays import Floats
from replay.numerics.jit import inlined_kernel, kernel
from replay.numerics.triples import Triple

Row = tuple[float, float, float, float]
Pose = tuple[Row, Row, Row]
"""The first three rows of a transform, as numbers: kernels keep them in registers."""

_ROUNDING = 1e-15
"""Rounding of a place in the plate's frame against that of the body."""


class PlacedPlate(NamedTuple):
    """A plate |x| <= hx, |y| <= hy, z = 0 in one pose, and which triangles of the body count.

    Attributes:
        T_plate_body: three rows.
        half_x, half_y: hx and hy [m].
        both: whether what lies behind the plate, z < 0, counts too.
        facing: whether only triangles count whose outer side the plate's centre lies on.
        centre: the plate's centre in the body's frame [m].
        rounding: of places [m]: a corner no farther than this from z = 0 or from a border's plane is in it, a plane no
            farther from the centre goes through it.
        blur: how far off a place in `Clusters.outlines` may be, seen from the plate [m].
    """

    T_plate_body: Pose
    half_x: float
    half_y: float
    both: bool
    facing: bool
    centre: Triple
    rounding: float
    blur: float


@kernel
def placed_plate(
    T: Floats, half_x: float, half_y: float, both: bool, facing: bool, rounding: float, blur_of_body: float
) -> PlacedPlate:
    """Return a plate at T_plate_body; `blur_of_body` [m] is how far off places are in the body's frame."""
    centre = (
        -(T[0, 0] * T[0, 3] + T[1, 0] * T[1, 3] + T[2, 0] * T[2, 3]),
        -(T[0, 1] * T[0, 3] + T[1, 1] * T[1, 3] + T[2, 1] * T[2, 3]),
        -(T[0, 2] * T[0, 3] + T[1, 2] * T[1, 3] + T[2, 2] * T[2, 3]),
    )
    blur = blur_of_body + _ROUNDING * (abs(T[0, 3]) + abs(T[1, 3]) + abs(T[2, 3]))
    blur = max(blur, 2.0 * rounding)
    rows = (
        (T[0, 0], T[0, 1], T[0, 2], T[0, 3]),
        (T[1, 0], T[1, 1], T[1, 2], T[1, 3]),
        (T[2, 0], T[2, 1], T[2, 2], T[2, 3]),
    )
    return PlacedPlate(rows, half_x, half_y, both, facing, centre, rounding, blur)


@inlined_kernel
def place(T: Pose, x: float, y: float, z: float) -> Triple:
    """Return a point of the body in the plate's frame."""
    return (
        T[0][0] * x + T[0][1] * y + T[0][2] * z + T[0][3],
        T[1][0] * x + T[1][1] * y + T[1][2] * z + T[1][3],
        T[2][0] * x + T[2][1] * y + T[2][2] * z + T[2][3],
    )


@inlined_kernel
def place_corner(T: Pose, rounding: float, x: float, y: float, z: float) -> Triple:
    """Return a corner in the plate's frame; one that is on z = 0 to rounding is on it."""
    corner = place(T, x, y, z)
    return corner[0], corner[1], corner[2] if abs(corner[2]) > rounding else 0.0


@inlined_kernel
def _on_border(x: float, half: float, rounding: float) -> float:
    """Return x, or the border that it is on to rounding."""
    return x if abs(abs(x) - half) > rounding else math.copysign(half, x)


@inlined_kernel
def _place_exactly(plate: PlacedPlate, x: float, y: float, z: float) -> Triple:
    """Return a corner in the plate's frame; one that is on z = 0 or in a border's plane to rounding is in it."""
    rounding = plate.rounding
    corner = place_corner(plate.T_plate_body, rounding, x, y, z)
    return _on_border(corner[0], plate.half_x, rounding), _on_border(corner[1], plate.half_y, rounding), corner[2]


@inlined_kernel
def place_triangle(plate: PlacedPlate, rows: Floats, index: int) -> tuple[Triple, Triple, Triple]:
    """Return the corners, in the plate's frame, of a triangle: the first nine numbers of a row of (n, >= 9).

    Corners in the planes of the plate and of its borders are in them exactly.
    """
    return (
        _place_exactly(plate, rows[index, 0], rows[index, 1], rows[index, 2]),
        _place_exactly(plate, rows[index, 3], rows[index, 4], rows[index, 5]),
        _place_exactly(plate, rows[index, 6], rows[index, 7], rows[index, 8]),
    )


@inlined_kernel
def write_triangle(a: Triple, b: Triple, c: Triple, triangle: Floats) -> None:
    """Write corners to `triangle` (3, 3), as the closed forms take them."""
    for axis in range(3):
        triangle[0, axis], triangle[1, axis], triangle[2, axis] = a[axis], b[axis], c[axis]


@inlined_kernel
def faces_centre(a: Triple, b: Triple, c: Triple, rounding: float) -> bool:
    """Return whether the outer side of a triangle in the plate's frame holds the plate's centre, n.(0 - a) > 0.

    A centre no farther from the triangle's plane than `rounding` [m] is in it.
    """
    bx, by, bz, cx, cy, cz = b[0] - a[0], b[1] - a[1], b[2] - a[2], c[0] - a[0], c[1] - a[1], c[2] - a[2]
    nx, ny, nz = by * cz - bz * cy, bz * cx - bx * cz, bx * cy - by * cx
    outward = nx * a[0] + ny * a[1] + nz * a[2]
    return outward < 0.0 and outward * outward > rounding * rounding * (nx * nx + ny * ny + nz * nz)


@inlined_kernel
def beyond_borders(x: float, y: float, half_x: float, half_y: float) -> tuple[float, float]:
    """Return the components u and v [m] of a point's distance to the plate."""
    return max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)


@inlined_kernel
def region_of(x: float, y: float, half_x: float, half_y: float) -> float:
    """Return the region of a point: 3 sx + sy, s = 1 or -1 beyond the border on that side, 0 between the borders."""
    sx = 1.0 if x > half_x else (-1.0 if x < -half_x else 0.0)
    return 3.0 * sx + (1.0 if y > half_y else (-1.0 if y < -half_y else 0.0))


@inlined_kernel
def sides_of(region: float) -> tuple[float, float]:
    """Return sx and sy of a region."""
    sx = 1.0 if region > 1.5 else (-1.0 if region < -1.5 else 0.0)
    return sx, region - 3.0 * sx
