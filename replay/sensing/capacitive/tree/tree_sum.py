"""The sum over a body's triangles with a stated tolerance, for every pose and plate; the folder's page says how.

Infinity is asked for first, as all that is near a plate that a body saturates need not be summed.
"""

from __future__ import annotations

import math

import numpy as np
from numba import boolean, float64, int64

from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.double_double import two_sum
from replay.numerics.jit import entry, kernel, leaf_kernel
from replay.sensing.capacitive.contact import SATURATED, contact, may_touch
from replay.sensing.capacitive.placed_plate import (
    PlacedPlate,
    beyond_borders,
    faces_centre,
    place,
    place_triangle,
    placed_plate,
    write_triangle,
)
from replay.sensing.capacitive.tree.budget import SumTally, budget_of
from replay.sensing.capacitive.tree.clusters import CLUSTERS_TYPE, Clusters
from replay.sensing.capacitive.tree.hard_triangles import sum_exactly, sum_hard
from replay.sensing.capacitive.tree.opening import refine, split_at_plane
from replay.sensing.capacitive.tree.part_sum import sum_of_parts
from replay.sensing.capacitive.tree.parts import ROOM_TYPE, Room, empty, new_room
from replay.sensing.capacitive.tree.registers import BEGIN, CENTROID, END, LANES, RADIUS, SECOND_CHILD, SIZE
from replay.sensing.capacitive.tree.triangle_pieces import PIECES_TYPE, Pieces, new_pieces

COUNTS = 4
NODES, CLUSTERS, IN_CLUSTERS, ALONE = range(COUNTS)
"""Rows of the counters: tree nodes judged, those summed by their moments, triangles in these, and triangles summed one
by one; triangles behind the plate or facing away, left out node by node, are the rest."""


def sum_tree(
    clusters: Clusters,
    T_plate_body: Floats,
    rounding: Floats,
    half_sizes: Floats,
    both: bool,
    facing: bool,
    rtol: float,
    counts: Integers,
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
    shape = (len(T_plate_body), len(half_sizes))
    integral, touching, bound = np.zeros(shape), np.zeros(shape, np.bool_), np.zeros(shape)
    room, pieces = new_room(len(clusters.triangles)), new_pieces()
    out = integral, touching, bound
    sum_each(clusters, T_plate_body, rounding, half_sizes, both, facing, rtol, room, pieces, *out, counts)
    return out


@entry(
    CLUSTERS_TYPE,
    float64[:, :, :, ::1],
    float64[::1],
    float64[:, ::1],
    boolean,
    boolean,
    float64,
    ROOM_TYPE,
    PIECES_TYPE,
    float64[:, ::1],
    boolean[:, ::1],
    float64[:, ::1],
    int64[::1],
)
@kernel
def sum_each(
    clusters: Clusters,
    T_plate_body: Floats,
    rounding: Floats,
    half_sizes: Floats,
    both: bool,
    facing: bool,
    rtol: float,
    room: Room,
    pieces: Pieces,
    integral: Floats,
    touching: Flags,
    bound: Floats,
    counts: Integers,
) -> None:
    """Do what `sum_tree` does, in arrays that it has made."""
    for frame in range(len(T_plate_body)):
        for plate in range(len(half_sizes)):
            half_x, half_y = half_sizes[plate, 0], half_sizes[plate, 1]
            here = placed_plate(
                T_plate_body[frame, plate], half_x, half_y, both, facing, rounding[frame], clusters.blur
            )
            integral[frame, plate], touching[frame, plate], bound[frame, plate] = _sum_one(
                clusters, here, rtol, room, pieces, counts
            )


@kernel
def _sum_one(
    clusters: Clusters, plate: PlacedPlate, rtol: float, room: Room, pieces: Pieces, counts: Integers
) -> tuple[float, bool, float]:
    """Return the integral over a body [m], whether it touches the plate, and the bound of the error [m]."""
    triangles = clusters.triangles
    count = _suspects(clusters, plate, room.stack, room.hard)
    if count > 0 and _any_saturates(triangles, room.hard, count, plate, pieces.triangle):
        return math.inf, True, 0.0
    empty(room.queue)
    budget, tally, lost = budget_of(clusters.nodes, plate, rtol), SumTally(0.0, 0.0, 0.0, 0.0), 0.0
    size, waiting, judged = split_at_plane(clusters, plate, room)
    alone, touching = 0, False
    while True:
        count, in_hard, opened, tally = refine(clusters, plate, budget, room, size, waiting, tally)
        judged += opened
        size = waiting = 0
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
def _add_counts(counts: Integers, nodes: int, clusters: int, in_clusters: int, alone: int) -> None:
    counts[NODES] += nodes
    counts[CLUSTERS] += clusters
    counts[IN_CLUSTERS] += in_clusters
    counts[ALONE] += alone


@leaf_kernel
def _suspects(clusters: Clusters, plate: PlacedPlate, stack: Integers, found: Integers) -> int:
    """Write the triangles that may saturate to `found`; return how many. Only nodes that reach the plate are opened."""
    T, half_x, half_y = plate.T_plate_body, plate.half_x, plate.half_y
    nodes, links, triangles = clusters.nodes, clusters.links, clusters.triangles
    stack[0] = 0
    size, count = 1, 0
    while size > 0:
        size -= 1
        index = stack[size]
        x, y, z = place(T, nodes[index, CENTROID], nodes[index, CENTROID + 1], nodes[index, CENTROID + 2])
        u, v = beyond_borders(x, y, half_x, half_y)
        if math.sqrt(u * u + v * v + z * z) > 1.000001 * nodes[index, RADIUS] + 2.0 * plate.rounding:
            continue
        if links[index, SECOND_CHILD] >= 0:
            stack[size], stack[size + 1] = links[index, SECOND_CHILD], index + 1
            size += 2
            continue
        for k in range(links[index, BEGIN], links[index, END]):
            a, b, c = place_triangle(plate, triangles, k)
            counts = triangles[k, SIZE] > 0.0 and (not plate.facing or faces_centre(a, b, c, plate.rounding))
            if counts and may_touch(a, b, c, half_x, half_y):
                found[count] = k
                count += 1
    return count


@kernel
def _any_saturates(triangles: Floats, which: Integers, count: int, plate: PlacedPlate, triangle: Floats) -> bool:
    """Return whether one of the rows which[:count] of `triangles` makes the integral infinite.

    `triangle` (3, 3) is scratch memory.
    """
    for i in range(count):
        a, b, c = place_triangle(plate, triangles, which[i])
        write_triangle(a, b, c, triangle)
        if contact(triangle, plate.half_x, plate.half_y, plate.both) == SATURATED:
            return True
    return False
