"""The exact integral of 1/dist(x, plate) over a triangle: clipping by the plate's regions, then closed forms.

The plate is |x| <= hx, |y| <= hy in z = 0 of its own frame. A point's distance has the components u = max(|x| - hx, 0),
v = max(|y| - hy, 0) and z; region I has u = v = 0, region II one of them, region III both. The triangle is clipped by
z = 0 and by the four border planes into at most 9 convex pieces a side, each is fanned into triangles, and

    int dA/dist = area sum over the fans of share x mean of 1/|(u, v, z)|,

u, v and z being linear on a piece. All terms are positive. What makes it exact to rounding:

- A corner of a piece keeps its barycentric coordinates in the triangle: no area is lost, however small the triangle is
  against its coordinates, or the piece against the triangle (see `area_share`).
- It also keeps its z and its four distances beyond the borders. Each is a convex combination of the triangle's corners,
  which are exact differences; on a border just cut its distance is exactly 0 and the opposite one's the plate's width.
  So every coordinate of a piece is accurate to its own size, and a piece lies in one octant, which is what the closed
  forms ask for.
- Where an edge crosses z = 0 or a border in x, the distances beyond the other borders may cancel; they are formed there
  with twice the digits. (Cuts in y come last and combine only distances of one sign.)
- An edge is cut at the same point, to the last digit, whichever of its two pieces asks.
- A piece that lies in a border plane belongs to the slab between the borders: it is beyond a border only if one of its
  corners is, strictly. What lies in z = 0 counts as above. So every piece is counted once.
"""

from __future__ import annotations

import math

from replay.numerics.arrays import Floats
from replay.numerics.double_double import difference_of_products
from replay.numerics.inverse_distance import mean_over_triangle
from replay.numerics.jit import kernel
from replay.numerics.log_difference import mean_inverse_linear
from replay.sensing.capacitive.area_share import (
    COLUMNS,
    EAST,
    HEIGHT,
    LOW,
    NORTH,
    SHARE_A,
    SHARE_B,
    SHARE_C,
    SOUTH,
    WEST,
    share,
)
from replay.sensing.capacitive.contact import SATURATED, Borders, borders, contact

NONE = -1
_SEVERAL = 2
_ROUNDING_SHARE = 1e-12
SCRATCH = (4, 12, COLUMNS)
"""Shape of the scratch memory of `integral_over_triangle`: four polygons of up to 12 corners."""


@kernel
def integral_over_triangle(
    triangle: Floats, area: float, half_x: float, half_y: float, both: bool, scratch: Floats
) -> float:
    """Return int dA/dist [m] of a triangle (3, 3) [m] of known area [m^2], in the plate's frame; inf if saturated."""
    if area <= 0.0:
        return 0.0
    z0, z1, z2 = triangle[0, 2], triangle[1, 2], triangle[2, 2]
    above = z0 > 0.0 or z1 > 0.0 or z2 > 0.0
    below = z0 < 0.0 or z1 < 0.0 or z2 < 0.0
    if not above and not both:
        return 0.0
    # on one side of z = 0: within one region, or cut by borders alone
    if not (above and below) and min(abs(z0), abs(z1), abs(z2)) > 0.0:
        east, north = _slab(triangle, 0, half_x), _slab(triangle, 1, half_y)
        if _SEVERAL not in (east, north):
            return area * _uncut(triangle, east, north, half_x, half_y)
        return area * _half(triangle, 1.0 if above else -1.0, half_x, half_y, scratch)
    # across z = 0 or with a part in it: infinite, or each side by itself
    if contact(triangle, half_x, half_y, both) == SATURATED:
        return math.inf
    mean = 0.0
    if above or not below:
        mean = _half(triangle, 1.0, half_x, half_y, scratch)
    if both and below:
        mean += _half(triangle, -1.0, half_x, half_y, scratch)
    return area * mean


@kernel
def _slab(triangle: Floats, axis: int, half: float) -> int:
    """Return 0 when the triangle lies between the borders, 1 or -1 beyond the one at half or -half, else _SEVERAL."""
    a, b, c = triangle[0, axis], triangle[1, axis], triangle[2, axis]
    low, high = min(a, b, c), max(a, b, c)
    if -half <= low and high <= half:
        return 0
    if low >= half:
        return 1
    return -1 if high <= -half else _SEVERAL


@kernel
def _uncut(triangle: Floats, east: int, north: int, half_x: float, half_y: float) -> float:
    """Return the mean of 1/dist over a triangle on one side of z = 0 and within one region."""
    # region I
    if east == 0 and north == 0:
        return mean_inverse_linear(abs(triangle[0, 2]), abs(triangle[1, 2]), abs(triangle[2, 2]))
    # regions II (one of east and north is 0) and III
    return mean_over_triangle(
        (abs(east) * (abs(triangle[0, 0]) - half_x), abs(north) * (abs(triangle[0, 1]) - half_y), abs(triangle[0, 2])),
        (abs(east) * (abs(triangle[1, 0]) - half_x), abs(north) * (abs(triangle[1, 1]) - half_y), abs(triangle[1, 2])),
        (abs(east) * (abs(triangle[2, 0]) - half_x), abs(north) * (abs(triangle[2, 1]) - half_y), abs(triangle[2, 2])),
    )


@kernel
def _half(triangle: Floats, sign: float, half_x: float, half_y: float, scratch: Floats) -> float:
    """Return the sum of share x mean of 1/dist over the triangle's part with sign z >= 0."""
    polygon, slab, piece, spare = scratch[0], scratch[1], scratch[2], scratch[3]
    count = _cut_by_plate_plane(triangle, sign, half_x, half_y, polygon)
    total = 0.0
    for column in range(3):
        u = (EAST, WEST, NONE)[column]
        in_slab = _region(polygon, count, u, EAST, 2.0 * half_x, slab, spare)
        if in_slab < 3:
            continue
        for row in range(3):
            v = (NORTH, SOUTH, NONE)[row]
            total += _fan(piece, _region(slab, in_slab, v, NORTH, 2.0 * half_y, piece, spare), u, v, triangle)
    return total


@kernel
def _region(polygon: Floats, count: int, outside: int, border: int, width: float, result: Floats, spare: Floats) -> int:
    """Write a polygon's part beyond border `outside`, or between `border` and the opposite one if that is NONE.

    A polygon in the border's plane is not beyond it. `width` is the distance of the two borders.
    """
    if outside != NONE:
        farthest = polygon[0, outside]
        for k in range(1, count):
            farthest = max(farthest, polygon[k, outside])
        if farthest <= 0.0:
            return 0
    first = border if outside == NONE else outside
    sign = -1.0 if outside == NONE else 1.0
    kept = 0
    for step in range(2 if outside == NONE else 1):
        # first into `spare` when a second cut follows
        source = polygon if step == 0 else spare
        target = spare if outside == NONE and step == 0 else result
        kept = _clip(source, count if step == 0 else kept, first + step, sign, width, target)
    return kept


@kernel
def _fan(piece: Floats, count: int, u: int, v: int, triangle: Floats) -> float:
    """Return the sum of share x mean of 1/|(u, v, z)| over the triangles that fan out from a piece's first corner."""
    total = 0.0
    for k in range(1, count - 1):
        part = share(piece, 0, k, k + 1, triangle)
        if part <= 0.0:
            continue
        # region I
        if u == NONE and v == NONE:
            mean = mean_inverse_linear(piece[0, HEIGHT], piece[k, HEIGHT], piece[k + 1, HEIGHT])
        else:
            mean = mean_over_triangle(
                _distance(piece, 0, u, v), _distance(piece, k, u, v), _distance(piece, k + 1, u, v)
            )
        # the triangle as a whole is finite: an infinite mean belongs to a piece which only rounding made
        if mean < math.inf or part > _ROUNDING_SHARE:
            total += part * mean
    return total


@kernel
def _distance(piece: Floats, corner: int, u: int, v: int) -> tuple[float, float, float]:
    return (piece[corner, u] if u != NONE else 0.0, piece[corner, v] if v != NONE else 0.0, piece[corner, HEIGHT])


@kernel
def _clip(polygon: Floats, count: int, column: int, sign: float, width: float, result: Floats) -> int:
    """Write the part of a convex polygon where sign x column >= 0 to `result`; return its number of corners."""
    opposite = column + 1 if column in (EAST, NORTH) else column - 1
    kept = 0
    for k in range(count):
        following = k + 1 if k + 1 < count else 0
        here, there = sign * polygon[k, column], sign * polygon[following, column]
        if here >= 0.0:
            for c in range(COLUMNS):
                result[kept, c] = polygon[k, c]
            kept += 1
        if (here > 0.0 > there) or (here < 0.0 < there):
            # weights by sign, not by direction: both sides of the cut compute the same point
            p, n = (k, following) if polygon[k, column] > 0.0 else (following, k)
            span = polygon[p, column] - polygon[n, column]
            w_p, w_n = -polygon[n, column] / span, polygon[p, column] / span
            for c in range(LOW + EAST):
                result[kept, c] = w_p * polygon[p, c] + w_n * polygon[n, c]
                if column <= WEST and c >= NORTH:
                    cross = difference_of_products(
                        (polygon[p, column], polygon[p, column + LOW]),
                        (polygon[n, c], polygon[n, c + LOW]),
                        (polygon[n, column], polygon[n, column + LOW]),
                        (polygon[p, c], polygon[p, c + LOW]),
                    )
                    result[kept, c] = cross[0] / span
            for c in range(LOW + EAST, COLUMNS):
                result[kept, c] = 0.0
            result[kept, column] = 0.0
            result[kept, opposite] = -width
            kept += 1
    return kept


@kernel
def _crossing(z_p: float, p: Borders, z_n: float, n: Borders) -> Borders:
    """Return the distances, times zP - zN, of the point where the edge from P (zP > 0) to N (zN < 0) crosses z = 0."""
    zp, zn = (z_p, 0.0), (z_n, 0.0)
    return (
        difference_of_products(zp, n[0], zn, p[0]),
        difference_of_products(zp, n[1], zn, p[1]),
        difference_of_products(zp, n[2], zn, p[2]),
        difference_of_products(zp, n[3], zn, p[3]),
    )


@kernel
def _cut_by_plate_plane(triangle: Floats, sign: float, half_x: float, half_y: float, polygon: Floats) -> int:
    """Write the part of a triangle where sign z >= 0 as a polygon with all its columns; return its corner count."""
    kept = 0
    for k in range(3):
        following = k + 1 if k < 2 else 0
        p, q = triangle[k], triangle[following]
        here, there = sign * p[2], sign * q[2]
        if here >= 0.0:
            corner = polygon[kept]
            corner[SHARE_A] = 1.0 if k == 0 else 0.0
            corner[SHARE_B] = 1.0 if k == 1 else 0.0
            corner[SHARE_C] = 1.0 if k == 2 else 0.0
            corner[HEIGHT] = here
            east, west, north, south = borders(p[0], p[1], half_x, half_y)
            corner[EAST], corner[WEST], corner[NORTH], corner[SOUTH] = east[0], west[0], north[0], south[0]
            corner[EAST + LOW], corner[WEST + LOW] = east[1], west[1]
            corner[NORTH + LOW], corner[SOUTH + LOW] = north[1], south[1]
            kept += 1
        if (here > 0.0 > there) or (here < 0.0 < there):
            corner = polygon[kept]
            high, low = (k, following) if p[2] > 0.0 else (following, k)
            above, below = triangle[high], triangle[low]
            span = above[2] - below[2]
            w_high, w_low = -below[2] / span, above[2] / span
            corner[SHARE_A] = w_high if high == 0 else (w_low if low == 0 else 0.0)
            corner[SHARE_B] = w_high if high == 1 else (w_low if low == 1 else 0.0)
            corner[SHARE_C] = w_high if high == 2 else (w_low if low == 2 else 0.0)
            corner[HEIGHT] = 0.0
            east, west, north, south = _crossing(
                above[2],
                borders(above[0], above[1], half_x, half_y),
                below[2],
                borders(below[0], below[1], half_x, half_y),
            )
            corner[EAST], corner[WEST] = east[0] / span, west[0] / span
            corner[NORTH], corner[SOUTH] = north[0] / span, south[0] / span
            for c in range(EAST + LOW, COLUMNS):
                corner[c] = 0.0
            kept += 1
    return kept
