"""The sum over a body's triangles with a stated tolerance: far clusters by their moments, near triangles exactly.

The tree is walked from the root. A node (or triangle) of area A whose own error bound E fits the budget is
summed at once, else it is opened; a triangle that does not fit is integrated in closed form. The budget is one: every
node that has been summed brought rtol x its own lower bound A/(r + h) and took E, and the rest is left for the nodes to
come. So the sum of all E never exceeds rtol times a lower bound of the sum, and the result meets rtol.

Bounds. Let r be the distance components of the centroid in its region (u, v, z with the region's zeros), r its length,
h the largest distance of a corner from the centroid, d a point's place about it, x = h/r < 1. Inside one region
1/dist = 1/|r + Pd|, P dropping the region's zero components, and by Legendre's expansion

    1/|r + Pd| = sum_k (-1)^k |Pd|^k P_k(cos) / r^(k+1),   |rest after order p| <= |d|^(p+1) / (r^(p+2) (1 - x)).

- A cluster takes orders 0, 2, 3, 4 from its moments (order 1 vanishes at the centroid):
  E = A spread4 h / (r^6 (1 - x)), spread4 the mean of |d|^4.
- Part of it may lie over a border, by at most w: there 1/dist is expanded in the wrong region's form, whose squared
  distance is off by at most w^2: E += A mean(w^2) / (2 (r - h)^3). A point at d across the border, of at most D, lies
  over it by w <= d (W/D), W the largest w: mean(w^2) <= min(W^2, (W/D)^2 mean(d^2)). No cluster is clipped for it.
- A single triangle takes the first that fits of: 1 point, E = A spread2/(r - h)^3, borders or not, as the Hessian of
  1/dist is at most 2/dist^3; 3 points of degree 2, E = c A h spread2/(r^4 (1 - x)); 7 points of degree 5, E = c A h^4
  spread2/(r^7 (1 - x)); 16 points of degree 8, E = c A h^7 spread2/(r^10 (1 - x)); all but the first plus the border's
  term; c as measured, see `triangle_rules`. Where the border's term is in the way, the triangle is cut.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import MAX_DEPTH, Tree
from replay.numerics.double_double import two_sum
from replay.numerics.jit import kernel
from replay.sensing.capacitive.clusters import (
    AREA,
    CENTROID,
    LOWER,
    NORMAL,
    OPENING,
    RADIUS,
    SECOND,
    SPREAD4,
    UPPER,
    Clusters,
)
from replay.sensing.capacitive.exact import SCRATCH
from replay.sensing.capacitive.expansion import mean_by_moments
from replay.sensing.capacitive.triangle_rules import PIECES, RULE_POINTS, allowance, triangle_within
from replay.sensing.capacitive.triangle_sum import into_plate

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Ints = NDArray[np.int64]

COUNTS = 4
NODES, CLUSTERS, IN_CLUSTERS, ALONE = range(COUNTS)
"""Rows of the counters: tree nodes looked at, those summed by their moments, triangles in these, and triangles summed
one by one; triangles behind the plate or facing away, left out node by node, are the rest."""


@kernel
def sum_tree(
    clusters: Clusters,
    tree: Tree,
    T_plate_body: Floats,
    half_sizes: Floats,
    both: bool,
    facing: bool,
    rtol: float,
    counts: Ints,
) -> tuple[Floats, Flags, Floats]:
    """Return what `sum_triangles` returns, to a relative tolerance, and the rigorous bound of the error.

    Args:
        clusters, tree: of the body, in its frame.
        T_plate_body: (n, p, 4, 4); half_sizes: (p, 2) [m]; both, facing: see `CapacitiveSensor`.
        rtol: largest relative error of each of the n x p integrals.
        counts: (COUNTS,) added to.

    Returns:
        (n, p) [m], inf when saturated; (n, p) flags: touching; (n, p) [m], bound of the error (0 when saturated).
    """
    n, plates = len(T_plate_body), len(half_sizes)
    integral, touching = np.zeros((n, plates)), np.zeros((n, plates), np.bool_)
    bound = np.zeros((n, plates))
    scratch, pieces, corners = np.empty(SCRATCH), np.empty((PIECES, 4, 3)), np.empty((3, 3))
    terms, stack = np.empty(RULE_POINTS), np.empty(MAX_DEPTH + 1, np.int64)
    for frame in range(n):
        for plate in range(plates):
            integral[frame, plate], touching[frame, plate], bound[frame, plate] = _walk(
                clusters,
                tree,
                T_plate_body[frame, plate],
                half_sizes[plate, 0],
                half_sizes[plate, 1],
                both,
                facing,
                rtol,
                scratch,
                pieces,
                terms,
                corners,
                stack,
                counts,
            )
    return integral, touching, bound


@kernel
def _walk(
    clusters: Clusters,
    tree: Tree,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    rtol: float,
    scratch: Floats,
    pieces: Floats,
    terms: Floats,
    corners: Floats,
    stack: Ints,
    counts: Ints,
) -> tuple[float, bool, float]:
    total, lost, saved, spent = 0.0, 0.0, 0.0, 0.0
    touching = False
    centre = (
        -(T[0, 0] * T[0, 3] + T[1, 0] * T[1, 3] + T[2, 0] * T[2, 3]),
        -(T[0, 1] * T[0, 3] + T[1, 1] * T[1, 3] + T[2, 1] * T[2, 3]),
        -(T[0, 2] * T[0, 3] + T[1, 2] * T[1, 3] + T[2, 2] * T[2, 3]),
    )
    stack[0] = 0
    size = 1
    nodes, moments, triangles, areas = clusters.nodes, clusters.moments, clusters.triangles, clusters.areas
    while size > 0:
        size -= 1
        index = stack[size]
        counts[NODES] += 1
        x, y, z = _place(T, nodes[index, CENTROID], nodes[index, CENTROID + 1], nodes[index, CENTROID + 2])
        h, area = nodes[index, RADIUS], nodes[index, AREA]
        if not both and z + h < 0.0:
            continue
        u = x - math.copysign(half_x, x) if abs(x) > half_x else 0.0
        v = y - math.copysign(half_y, y) if abs(y) > half_y else 0.0
        r = math.sqrt(u * u + v * v + z * z)
        if r > 2.0 * h:
            share = rtol * area / (r + h)
            allowed = allowance(share, saved)
            error = area * nodes[index, SPREAD4] * h / (r * r * r * r * r * (r - h))
            if error <= allowed:
                verdict = 1
                if not both and z - h <= 0.0:
                    verdict = _side(nodes, index, T, z)
                if facing and verdict == 1:
                    verdict = _faces(nodes, index, centre)
                if verdict == -1:
                    continue
                if verdict == 1:
                    over_x = _border(nodes, moments, index, T, 0, x, half_x, h)
                    over_y = _border(nodes, moments, index, T, 1, y, half_y, h)
                    error += area * (over_x + over_y) / (2.0 * (r - h) ** 3)
                    if error <= allowed:
                        total, e = two_sum(total, area * mean_by_moments(moments, index, T, u, v, z, r))
                        lost += e
                        saved += share - error
                        spent += error
                        counts[CLUSTERS] += 1
                        counts[IN_CLUSTERS] += tree.end[index] - tree.begin[index]
                        continue
        if tree.second[index] >= 0:
            stack[size] = tree.second[index]
            stack[size + 1] = index + 1
            size += 2
            continue
        counts[ALONE] += tree.end[index] - tree.begin[index]
        for k in range(tree.begin[index], tree.end[index]):
            into_plate(T, triangles, k, corners)
            value, share, error, touches = triangle_within(
                corners, areas[k], half_x, half_y, both, facing, rtol, saved, scratch, pieces, terms
            )
            touching = touching or touches
            if value == math.inf:
                return math.inf, True, 0.0
            total, e = two_sum(total, value)
            lost += e
            saved += share - error
            spent += error
    return total + lost, touching, spent


@kernel
def _place(T: Floats, x: float, y: float, z: float) -> tuple[float, float, float]:
    return (
        T[0, 0] * x + T[0, 1] * y + T[0, 2] * z + T[0, 3],
        T[1, 0] * x + T[1, 1] * y + T[1, 2] * z + T[1, 3],
        T[2, 0] * x + T[2, 1] * y + T[2, 2] * z + T[2, 3],
    )


@kernel
def _reach(nodes: Floats, index: int, T: Floats, axis: int, sign: float) -> float:
    """Return how far the node's box reaches from its centroid along a plate axis, sign +1 or -1."""
    reach = 0.0
    for k in range(3):
        e = sign * T[axis, k]
        reach += e * (nodes[index, UPPER + k] if e > 0.0 else nodes[index, LOWER + k])
    return min(reach, nodes[index, RADIUS])  # type: ignore[no-any-return]


@kernel
def _side(nodes: Floats, index: int, T: Floats, z: float) -> int:
    """Return 1 when the node is in front of the plate's plane, -1 when it is behind, 0 when it may be both."""
    if z - _reach(nodes, index, T, 2, -1.0) > 0.0:
        return 1
    return -1 if z + _reach(nodes, index, T, 2, 1.0) < 0.0 else 0


@kernel
def _faces(nodes: Floats, index: int, centre: tuple[float, float, float]) -> int:
    """Return 1 when all triangles of the node face the plate's centre, -1 when none does, 0 when it may be either.

    With v from the centroid to the centre, the angle between a normal and the way from a corner to the centre differs
    from that between the cone's axis and v by at most the cone's half angle plus asin(h/|v|), which must stay below 90
    degrees: all face the centre when the cosine of the angle to v exceeds the sine of that sum.
    """
    cx, cy, cz = (
        centre[0] - nodes[index, CENTROID],
        centre[1] - nodes[index, CENTROID + 1],
        centre[2] - nodes[index, CENTROID + 2],
    )
    distance = math.sqrt(cx * cx + cy * cy + cz * cz)
    h, opening = nodes[index, RADIUS], nodes[index, OPENING]
    if opening <= 0.0 or h >= distance:
        return 0
    cosine = (cx * nodes[index, NORMAL] + cy * nodes[index, NORMAL + 1] + cz * nodes[index, NORMAL + 2]) / distance
    sine_cone = math.sqrt(max(0.0, 1.0 - opening * opening))
    sine_ball = h / distance
    cosine_ball = math.sqrt(max(0.0, 1.0 - sine_ball * sine_ball))
    if opening * cosine_ball - sine_cone * sine_ball <= 0.0:
        return 0
    limit = sine_cone * cosine_ball + opening * sine_ball + 1e-9
    if cosine > limit:
        return 1
    return -1 if cosine < -limit else 0


@kernel
def _border(
    nodes: Floats, moments: Floats, index: int, T: Floats, axis: int, position: float, half: float, h: float
) -> float:
    """Return a bound of mean(w^2) [m^2], w the depth by which the node lies over the two borders across one axis."""
    if abs(abs(position) - half) >= h and abs(abs(position) + half) >= h:
        return 0.0
    over = 0.0
    for side in range(2):
        sign = 1.0 - 2.0 * side
        # towards the border at sign x half, from whichever side of it the centroid is on
        gap = half - sign * position
        reach = _reach(nodes, index, T, axis, sign if gap >= 0.0 else -sign)
        beyond = reach - abs(gap)
        if beyond > 0.0:
            a, b, c = T[axis, 0], T[axis, 1], T[axis, 2]
            variance = (
                a * a * moments[index, SECOND] + b * b * moments[index, SECOND + 1] + c * c * moments[index, SECOND + 2]
            )
            variance += 2.0 * (
                a * b * moments[index, SECOND + 3]
                + a * c * moments[index, SECOND + 4]
                + b * c * moments[index, SECOND + 5]
            )
            over += min(beyond * beyond, variance * (beyond / reach) ** 2)
    return over
