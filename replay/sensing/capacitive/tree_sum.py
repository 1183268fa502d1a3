"""The sum over a body's triangles with a stated tolerance: far clusters by their moments, near triangles exactly.

The tree is opened from the root until every part, a node or a triangle, has an error bound below what is allowed. From
then on, as long as the bounds E add up to more than rtol times a lower bound of the sum, the parts with the most error
per effort are opened, at least as much error as there is too much: a node into its children, a triangle into a rule of
more points, and at last into pieces or the closed form. So the result meets rtol, and the work goes where it pays; what
is small or far away may be relatively worse. The parts are summed at the end; nothing depends on other poses.
Nodes, triangles and pieces are judged and summed many side by side, see `lanes`.

Bounds. Let r be the distance components of the centroid in its region (u, v, z with the region's zeros), r its length,
h the largest distance of a corner from the centroid, d a point's place about it, x = h/r < 2/3. Inside one region
1/dist = 1/|r + Pd|, P dropping the region's zero components, and by Legendre's expansion

    1/|r + Pd| = sum_k (-1)^k |Pd|^k P_k(cos) / r^(k+1),   |rest after order p| <= |d|^(p+1) / (r^(p+2) (1 - x)).

- A cluster of area A takes orders 0, 2, 3, 4 from its moments (order 1 vanishes at the centroid). Order 5 is a form in
  the mean of d d d d d, so it is at most the product of both Frobenius norms, and at most mean |d|^5:
  E = A min(c |M5|, mean |d|^5)/r^6 + A mean |d|^6/(r^6 (r - h)); c^2 = 7.875, 4.203125 or 1 as P drops 0, 1 or 2.
- Part of it may lie over a border, by w: there 1/dist is expanded in the wrong region's form, whose squared distance is
  off by 0 to w^2, so the integral by 0 to B = A mean(w^2) / (2 (r - h)^3), of known sign: the sum is corrected by B/2,
  and E += B/2. A point at d across the border, of at most D, lies over it by w <= d (W/D), W the largest w: the root of
  mean(w^2) is at most W and (W/D) sigma. sigma, the standard deviation across the border, is at most the largest one in
  any direction, and at most the root of D times the reach to the other side (Bhatia and Davis 2000). No cluster is
  clipped for it. For a triangle mean(w^2) is known; it is off by A mean(w^2)/2 times something between 1/(r + h)^3 and
  1/(r - h)^3.
- Clusters are judged by outlines of half the digits: a place may be off by `blur`. So r is computed at the place found
  and made smaller by blur, w and the root of its mean square are made larger by blur, and what lies within blur of
  z = 0 is opened. The expansion itself has all digits; it is taken in the region in which the outline was judged.
- A triangle: 1 point, E = A spread/(r - h)^3, borders or not, as the Hessian of 1/dist is at most 2/dist^3, spread =
  mean |d|^2; 3 points of degree 2, E = c A h spread/(r^4 (1 - x)); 7 points of degree 5, E = c A h^4 spread/(r^7 (1 -
  x)); 16 points of degree 8, E = c A h^7 spread/(r^10 (1 - x)); c see `triangle_rules`. A part above z = 0 has 1 point
  and a bound of its own (`part_above`). What no rule fits is cut, see `hard_triangles`.
- The mean of 1/dist is at least 1/sqrt(mean dist^2) (Jensen), and mean dist^2 <= r^2 + mean |d|^2 (what is linear in
  d vanishes): a part brings at least A/sqrt(r^2 + mean |d|^2) >= A/r (1 - mean |d|^2/(2 r^2)).
"""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64
from numpy.typing import NDArray

from replay.numerics.double_double import two_sum
from replay.numerics.jit import entry, kernel, leaf_kernel
from replay.sensing.capacitive.budget import SumTally, budget_of
from replay.sensing.capacitive.clusters import CLUSTERS_TYPE, Clusters
from replay.sensing.capacitive.hard_triangles import sum_exactly, sum_hard
from replay.sensing.capacitive.lanes import LANES
from replay.sensing.capacitive.opening import refine
from replay.sensing.capacitive.part_queue import empty
from replay.sensing.capacitive.part_sum import sum_of_parts
from replay.sensing.capacitive.placed_plate import PlacedPlate, placed_plate
from replay.sensing.capacitive.room import Room, new_room
from replay.sensing.capacitive.saturation import any_saturates, suspects
from replay.sensing.capacitive.triangle_pieces import Pieces, new_pieces

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

COUNTS = 4
NODES, CLUSTERS, IN_CLUSTERS, ALONE = range(COUNTS)
"""Rows of the counters: tree nodes judged, those summed by their moments, triangles in these, and triangles summed one
by one; triangles behind the plate or facing away, left out node by node, are the rest."""


@entry(CLUSTERS_TYPE, float64[:, :, :, ::1], float64[::1], float64[:, ::1], boolean, boolean, float64, int64[::1])
@kernel
def sum_tree(
    clusters: Clusters,
    T_plate_body: Floats,
    rounding: Floats,
    half_sizes: Floats,
    both: bool,
    facing: bool,
    rtol: float,
    counts: Ints,
) -> tuple[Floats, Flags, Floats]:
    """Return what `sum_triangles` returns, to a relative tolerance, and the rigorous bound of the error.

    Args:
        clusters: of the body, in its frame.
        T_plate_body: (n, p, 4, 4); half_sizes: (p, 2) [m]; both, facing: see `CapacitiveSensor`.
        rounding: (n,) a corner no farther than this from a plate's plane is on it [m].
        rtol: largest relative error of each of the n x p integrals.
        counts: (COUNTS,) added to.

    Returns:
        (n, p) [m], inf when saturated; (n, p) flags: touching; (n, p) [m], bound of the error (0 when saturated).
    """
    room, pieces = new_room(len(clusters.triangles)), new_pieces()
    n, plates = len(T_plate_body), len(half_sizes)
    integral, touching = np.zeros((n, plates)), np.zeros((n, plates), np.bool_)
    bound = np.zeros((n, plates))
    for frame in range(n):
        for plate in range(plates):
            half_x, half_y = half_sizes[plate, 0], half_sizes[plate, 1]
            here = placed_plate(
                T_plate_body[frame, plate], half_x, half_y, both, facing, rounding[frame], clusters.blur
            )
            integral[frame, plate], touching[frame, plate], bound[frame, plate] = _sum_one(
                clusters, here, rtol, room, pieces, counts
            )
    return integral, touching, bound


@kernel
def _sum_one(
    clusters: Clusters, plate: PlacedPlate, rtol: float, room: Room, pieces: Pieces, counts: Ints
) -> tuple[float, bool, float]:
    """Return the integral over a body [m], whether it touches the plate, and the bound of the error [m]."""
    triangles = clusters.triangles
    count = suspects(clusters, plate, room.stack, room.hard)
    if count > 0 and any_saturates(triangles, room.hard, count, plate, pieces.triangle):
        return math.inf, True, 0.0
    empty(room.queue)
    budget, tally, lost = budget_of(clusters.nodes, plate, rtol), SumTally(0.0, 0.0, 0.0, 0.0), 0.0
    room.stack[0] = 0
    size, judged, alone, touching = 1, 0, 0, False
    while True:
        count, in_hard, opened, tally = refine(clusters, plate, budget, room, size, tally)
        judged += opened
        size = 0
        if count == 0:
            break
        alone += count
        done, spent, least, doubt = tally
        least_then = least + in_hard
        for begin in range(0, count, LANES):
            several = min(count - begin, LANES)
            # half of the error is for triangles that have no rule; these may take half of what is left of it
            share = max(0.0, 0.5 * rtol * max(least, least_then) - spent) / (2.0 * several)
            value, error, slow = sum_hard(triangles, room.hard, begin, several, plate, share, pieces, room.lanes)
            if slow > 0:
                exact, touches = sum_exactly(triangles, plate, pieces, slow)
                touching = touching or touches
                if exact == math.inf:
                    _add_counts(counts, judged, 0, 0, alone)
                    return math.inf, True, 0.0
                value += exact
            done, e = two_sum(done, value)
            lost += e
            least += value - error
            spent += error
        tally = SumTally(done, spent, least, doubt)
    parts, lost_in_parts, whole, in_whole, others = sum_of_parts(clusters, plate, room)
    _add_counts(counts, judged, whole, in_whole, alone + others)
    total, e = two_sum(tally.done, parts)
    lost += lost_in_parts + e
    return total + lost, touching, tally.doubt + tally.spent


@leaf_kernel
def _add_counts(counts: Ints, nodes: int, clusters: int, in_clusters: int, alone: int) -> None:
    counts[NODES] += nodes
    counts[CLUSTERS] += clusters
    counts[IN_CLUSTERS] += in_clusters
    counts[ALONE] += alone
