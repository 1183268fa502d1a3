"""The parts of a sum, once it is known how each is summed."""

from __future__ import annotations

import math

import numpy as np

from replay.numerics.arrays import Floats
from replay.numerics.double_double import two_sum
from replay.numerics.gauss import TRIANGLE_7, TRIANGLE_16
from replay.numerics.jit import inlined_kernel, leaf_kernel
from replay.numerics.triples import Triple
from replay.sensing.capacitive.placed_plate import PlacedPlate, Pose, place, sides_of
from replay.sensing.capacitive.tree.clusters import Clusters
from replay.sensing.capacitive.tree.lanes import corner_in_lanes, load, padded
from replay.sensing.capacitive.tree.parts import Room, slots_used
from replay.sensing.capacitive.tree.registers import (
    ABOVE,
    CLUSTER,
    FOUND,
    FOURTH,
    LANES,
    MOMENT_COLUMNS,
    NUMBER,
    PART,
    PLACE,
    POINTS_1,
    POINTS_3,
    POINTS_7,
    POINTS_16,
    REGION,
    RULE,
    RULES,
    SECOND,
    SHIFT,
    SIZE,
    SUM,
    THIRD,
    TRIANGLE_COLUMNS,
    VALUES,
    WHOLE,
)
from replay.sensing.capacitive.tree.triangle_bounds import tip_of

Form = tuple[float, float, float, float, float, float]

# Legendre's fourth polynomial, 35 t^2 - 30 t + 3 = 35 (t - _T1)(t - _T2) in t = cos^2, lets one product of forms do.
_T1 = (30.0 + math.sqrt(480.0)) / 70.0
_T2 = (30.0 - math.sqrt(480.0)) / 70.0

TRIANGLE_3 = np.array([[4.0, 1.0, 1.0], [1.0, 4.0, 1.0], [1.0, 1.0, 4.0], [2.0, 2.0, 2.0]]) / 6.0
"""Barycentric coordinates and weights of three points, polynomials of degree 2 exactly."""


@leaf_kernel
def sum_of_parts(clusters: Clusters, plate: PlacedPlate, room: Room) -> tuple[float, float, int, int, int]:
    """Return the sum of all parts in the queue [m], what was lost in rounding it, and how many clusters, triangles in
    them and other triangles it has.
    """
    queue, lists = room.queue, room.lists
    filled = lists[RULES]
    for rule in range(RULES):
        filled[rule] = 0
    for slot in range(slots_used(queue)):
        # no branches, which no processor could foresee
        kind = np.uint64(queue.labels[slot, RULE])
        lists[kind, np.uint64(filled[kind])] = slot
        filled[kind] += 1
    total, lost, in_clusters = 0.0, 0.0, 0
    for rule in (POINTS_1, ABOVE + POINTS_1):
        for at in range(filled[rule]):
            total += queue.values[lists[rule, at], SHIFT]
    for begin in range(0, filled[CLUSTER], LANES):
        count = min(filled[CLUSTER] - begin, LANES)
        value, triangles = _clusters(clusters.moments, plate, room, begin, count)
        total, e = two_sum(total, value)
        lost += e
        in_clusters += triangles
    alone = filled[POINTS_1] + filled[ABOVE + POINTS_1]
    for rule in (POINTS_3, POINTS_7, POINTS_16, ABOVE + POINTS_3, ABOVE + POINTS_7, ABOVE + POINTS_16):
        for begin in range(0, filled[rule], LANES):
            count = min(filled[rule] - begin, LANES)
            total, e = two_sum(total, _triangles(clusters.triangles, plate, room, rule, begin, count))
            lost += e
        alone += filled[rule]
    return total, lost, filled[CLUSTER], in_clusters, alone


@inlined_kernel
def _load_parts(rows: Floats, columns: int, room: Room, rule: int, begin: int, count: int) -> None:
    """Write what was found of some parts in the list of a rule, and their rows, to the lanes."""
    queue, batch, lanes = room.queue, room.batch, room.lanes
    for i in range(count):
        batch[i] = room.lists[rule, begin + i]
    load(queue.values, VALUES, batch, count, lanes, FOUND)
    for i in range(count):
        batch[i] = queue.labels[batch[i], PART]
    load(rows, columns, batch, count, lanes, 0)


@leaf_kernel
def _clusters(moments: Floats, plate: PlacedPlate, room: Room, begin: int, count: int) -> tuple[float, int]:
    """Return the sum over some clusters in their list [m], and the number of their triangles."""
    _load_parts(moments, MOMENT_COLUMNS, room, CLUSTER, begin, count)
    T, half_x, half_y, lanes = plate.T_plate_body, plate.half_x, plate.half_y, room.lanes
    for i in range(padded(count)):
        x, y, z = place(T, lanes[PLACE * LANES + i], lanes[(PLACE + 1) * LANES + i], lanes[(PLACE + 2) * LANES + i])
        sx, sy = sides_of(lanes[(FOUND + REGION) * LANES + i])
        components = (abs(sx) * x - sx * half_x, abs(sy) * y - sy * half_y, z)
        mean = mean_by_moments(lanes, i, T, (sx, sy), components)
        lanes[SUM * LANES + i] = lanes[WHOLE * LANES + i] * mean + lanes[(FOUND + SHIFT) * LANES + i]
    total, triangles = 0.0, 0
    for i in range(count):
        total += lanes[SUM * LANES + i]
        triangles += int(lanes[NUMBER * LANES + i])
    return total, triangles


@leaf_kernel
def _triangles(triangles: Floats, plate: PlacedPlate, room: Room, rule: int, begin: int, count: int) -> float:
    """Return the sum over some triangles in the list of a rule [m], each in the region of its centroid."""
    _load_parts(triangles, TRIANGLE_COLUMNS, room, rule, begin, count)
    lanes = room.lanes
    if rule < ABOVE:
        sum_by_points(rule, count, plate, lanes)
    else:
        _sum_above(rule - ABOVE, count, plate, lanes)
    total = 0.0
    for i in range(count):
        total += lanes[SUM * LANES + i]
    return total


@inlined_kernel
def _combine(a: float, t: Form, b: float, q: Form) -> Form:
    return (
        a * t[0] + b * q[0],
        a * t[1] + b * q[1],
        a * t[2] + b * q[2],
        a * t[3] + b * q[3],
        a * t[4] + b * q[4],
        a * t[5] + b * q[5],
    )


@inlined_kernel
def mean_by_moments(lanes: Floats, i: int, T: Pose, sides: tuple[float, float], components: Triple) -> float:
    """Return the mean of 1/dist [1/m] over a node, from its moments up to the fourth, the first columns of lane i.

    T is T_plate_body, `sides` those of the centroid's region, and `components` u, v and z [m] of its distance.

    With n the unit vector of r in the body's frame, t = (n.d)^2 and q = |Pd|^2 are quadratic forms of d, by their
    coefficients of xx, yy, zz, xy, xz, yz. Orders 2, 3, 4 are the means of (3 t - q)/2, n.d (5 t - 3 q)/2 and
    (35 t^2 - 30 t q + 3 q^2)/8 = 35/8 (t - _T1 q)(t - _T2 q).
    """
    u, v, z = components
    inverse = 1.0 / math.sqrt(u * u + v * v + z * z)
    n0 = (T[0][0] * u + T[1][0] * v + T[2][0] * z) * inverse
    n1 = (T[0][1] * u + T[1][1] * v + T[2][1] * z) * inverse
    n2 = (T[0][2] * u + T[1][2] * v + T[2][2] * z) * inverse
    drop_x, drop_y = 1.0 - abs(sides[0]), 1.0 - abs(sides[1])
    x0, x1, x2, y0, y1, y2 = T[0][0], T[0][1], T[0][2], T[1][0], T[1][1], T[1][2]
    t = (n0 * n0, n1 * n1, n2 * n2, 2.0 * n0 * n1, 2.0 * n0 * n2, 2.0 * n1 * n2)
    q = (
        1.0 - drop_x * x0 * x0 - drop_y * y0 * y0,
        1.0 - drop_x * x1 * x1 - drop_y * y1 * y1,
        1.0 - drop_x * x2 * x2 - drop_y * y2 * y2,
        -2.0 * (drop_x * x0 * x1 + drop_y * y0 * y1),
        -2.0 * (drop_x * x0 * x2 + drop_y * y0 * y2),
        -2.0 * (drop_x * x1 * x2 + drop_y * y1 * y2),
    )
    a = _combine(1.5, t, -0.5, q)
    order2 = a[0] * lanes[SECOND * LANES + i] + a[1] * lanes[(SECOND + 1) * LANES + i]
    order2 += a[2] * lanes[(SECOND + 2) * LANES + i] + a[3] * lanes[(SECOND + 3) * LANES + i]
    order2 += a[4] * lanes[(SECOND + 4) * LANES + i] + a[5] * lanes[(SECOND + 5) * LANES + i]
    a = _combine(2.5, t, -1.5, q)
    order3 = n0 * a[0] * lanes[THIRD * LANES + i] + n1 * a[1] * lanes[(THIRD + 1) * LANES + i]
    order3 += n2 * a[2] * lanes[(THIRD + 2) * LANES + i]
    order3 += (n0 * a[3] + n1 * a[0]) * lanes[(THIRD + 3) * LANES + i]
    order3 += (n0 * a[4] + n2 * a[0]) * lanes[(THIRD + 4) * LANES + i]
    order3 += (n1 * a[3] + n0 * a[1]) * lanes[(THIRD + 5) * LANES + i]
    order3 += (n1 * a[5] + n2 * a[1]) * lanes[(THIRD + 6) * LANES + i]
    order3 += (n2 * a[4] + n0 * a[2]) * lanes[(THIRD + 7) * LANES + i]
    order3 += (n2 * a[5] + n1 * a[2]) * lanes[(THIRD + 8) * LANES + i]
    order3 += (n0 * a[5] + n1 * a[4] + n2 * a[3]) * lanes[(THIRD + 9) * LANES + i]
    a, b = _combine(1.0, t, -_T1, q), _combine(1.0, t, -_T2, q)
    order4 = a[0] * b[0] * lanes[FOURTH * LANES + i] + a[1] * b[1] * lanes[(FOURTH + 1) * LANES + i]
    order4 += a[2] * b[2] * lanes[(FOURTH + 2) * LANES + i]
    order4 += (a[0] * b[1] + a[1] * b[0] + a[3] * b[3]) * lanes[(FOURTH + 3) * LANES + i]
    order4 += (a[0] * b[2] + a[2] * b[0] + a[4] * b[4]) * lanes[(FOURTH + 4) * LANES + i]
    order4 += (a[1] * b[2] + a[2] * b[1] + a[5] * b[5]) * lanes[(FOURTH + 5) * LANES + i]
    more = (a[0] * b[3] + a[3] * b[0]) * lanes[(FOURTH + 6) * LANES + i]
    more += (a[0] * b[4] + a[4] * b[0]) * lanes[(FOURTH + 7) * LANES + i]
    more += (a[1] * b[3] + a[3] * b[1]) * lanes[(FOURTH + 8) * LANES + i]
    more += (a[1] * b[5] + a[5] * b[1]) * lanes[(FOURTH + 9) * LANES + i]
    more += (a[2] * b[4] + a[4] * b[2]) * lanes[(FOURTH + 10) * LANES + i]
    more += (a[2] * b[5] + a[5] * b[2]) * lanes[(FOURTH + 11) * LANES + i]
    more += (a[0] * b[5] + a[5] * b[0] + a[3] * b[4] + a[4] * b[3]) * lanes[(FOURTH + 12) * LANES + i]
    more += (a[1] * b[4] + a[4] * b[1] + a[3] * b[5] + a[5] * b[3]) * lanes[(FOURTH + 13) * LANES + i]
    more += (a[2] * b[3] + a[3] * b[2] + a[4] * b[5] + a[5] * b[4]) * lanes[(FOURTH + 14) * LANES + i]
    order4 = 35.0 / 8.0 * (order4 + more)
    return inverse * (1.0 + inverse * inverse * (order2 - inverse * (order3 - inverse * order4)))  # type: ignore[no-any-return]


@leaf_kernel
def sum_by_points(rule: int, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    """Write the sums over triangles [m] to the column SUM; their rows and what was found of them are in the lanes."""
    # a loop for each rule, so that its points are known when it is compiled
    if rule == POINTS_3:
        _sum_by(TRIANGLE_3, count, plate, lanes)
    elif rule == POINTS_7:
        _sum_by(TRIANGLE_7, count, plate, lanes)
    else:
        _sum_by(TRIANGLE_16, count, plate, lanes)


@inlined_kernel
def _sum_by(points: Floats, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    for i in range(padded(count)):
        a, b, c = _components(plate, lanes, i)
        mean = _mean_over_points(points, a, b, c)
        lanes[SUM * LANES + i] = lanes[SIZE * LANES + i] * mean + lanes[(FOUND + SHIFT) * LANES + i]


@leaf_kernel
def _sum_above(rule: int, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    """Do what `sum_by_points` does for the parts of triangles above z = 0."""
    if rule == POINTS_3:
        _sum_above_by(TRIANGLE_3, count, plate, lanes)
    elif rule == POINTS_7:
        _sum_above_by(TRIANGLE_7, count, plate, lanes)
    else:
        _sum_above_by(TRIANGLE_16, count, plate, lanes)


@inlined_kernel
def _sum_above_by(points: Floats, count: int, plate: PlacedPlate, lanes: Floats) -> None:
    for i in range(padded(count)):
        a, b, c = _components(plate, lanes, i)
        tip, p, q, s, t = tip_of(a, b, c)
        p = (tip[0] + s * p[0], tip[1] + s * p[1], tip[2] + s * p[2])
        q = (tip[0] + t * q[0], tip[1] + t * q[1], tip[2] + t * q[2])
        small = s * t * _mean_over_points(points, tip, p, q)
        # the small triangle, or the large one less that
        rest = _mean_over_points(points, a, b, c) - small
        mean = small if tip[2] > 0.0 else rest
        lanes[SUM * LANES + i] = lanes[SIZE * LANES + i] * mean


@inlined_kernel
def _components(plate: PlacedPlate, lanes: Floats, i: int) -> tuple[Triple, Triple, Triple]:
    """Return u, v and z [m] of the corners of the triangle in lane i, as its region takes the distance."""
    T, rounding = plate.T_plate_body, plate.rounding
    sx, sy = sides_of(lanes[(FOUND + REGION) * LANES + i])
    keep_x, keep_y, shift_x, shift_y = abs(sx), abs(sy), sx * plate.half_x, sy * plate.half_y
    a = corner_in_lanes(T, rounding, lanes, 0, i)
    b = corner_in_lanes(T, rounding, lanes, 1, i)
    c = corner_in_lanes(T, rounding, lanes, 2, i)
    return (
        (keep_x * a[0] - shift_x, keep_y * a[1] - shift_y, a[2]),
        (keep_x * b[0] - shift_x, keep_y * b[1] - shift_y, b[2]),
        (keep_x * c[0] - shift_x, keep_y * c[1] - shift_y, c[2]),
    )


@inlined_kernel
def _mean_over_points(points: Floats, a: Triple, b: Triple, c: Triple) -> float:
    """Return the mean of 1/dist [1/m] over a triangle by points (4, k), barycentric coordinates and weights."""
    mean = 0.0
    # a loop of 16 would be too long to be unrolled, and what holds a loop does not become vectors
    for k in range(min(points.shape[1], 8)):
        mean += _at_point(points, k, a, b, c)
    for k in range(8, points.shape[1]):
        mean += _at_point(points, k, a, b, c)
    return mean


@inlined_kernel
def _at_point(points: Floats, k: int, a: Triple, b: Triple, c: Triple) -> float:
    p, q, s, weight = points[0, k], points[1, k], points[2, k], points[3, k]
    x = p * a[0] + q * b[0] + s * c[0]
    y = p * a[1] + q * b[1] + s * c[1]
    z = p * a[2] + q * b[2] + s * c[2]
    return weight / math.sqrt(x * x + y * y + z * z)  # type: ignore[no-any-return]
