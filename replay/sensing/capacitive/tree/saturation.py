"""Whether a body saturates a sensor: asked first, as all that is near the plate then need not be summed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, kernel, leaf_kernel
from replay.sensing.capacitive.tree.clusters import BEGIN, CENTROID, END, RADIUS, SECOND_CHILD, SIZE, Clusters
from replay.sensing.capacitive.contact import SATURATED, contact
from replay.sensing.capacitive.placed_plate import (
    PlacedPlate,
    Triple,
    beyond_borders,
    faces_centre,
    place,
    place_triangle,
    write_triangle,
)

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@leaf_kernel
def suspects(clusters: Clusters, plate: PlacedPlate, stack: Ints, found: Ints) -> int:
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
            a, b, c = place_triangle(T, plate.rounding, (half_x, half_y), triangles, k)
            counts = triangles[k, SIZE] > 0.0 and (not plate.facing or faces_centre(a, b, c, plate.rounding))
            if counts and may_touch(a, b, c, half_x, half_y):
                found[count] = k
                count += 1
    return count


@inlined_kernel
def may_touch(a: Triple, b: Triple, c: Triple, half_x: float, half_y: float) -> bool:
    """Return False only if `contact` finds a triangle in the plate's frame CLEAR, by the first of its tests."""
    return (
        min(a[2], b[2], c[2]) <= 0.0 <= max(a[2], b[2], c[2])
        and min(a[0], b[0], c[0]) <= half_x
        and max(a[0], b[0], c[0]) >= -half_x
        and min(a[1], b[1], c[1]) <= half_y
        and max(a[1], b[1], c[1]) >= -half_y
    )


@kernel
def any_saturates(triangles: Floats, which: Ints, count: int, plate: PlacedPlate, triangle: Floats) -> bool:
    """Return whether one of the rows which[:count] of `triangles` makes the integral infinite.

    `triangle` (3, 3) is scratch memory.
    """
    for i in range(count):
        a, b, c = place_triangle(plate.T_plate_body, plate.rounding, (plate.half_x, plate.half_y), triangles, which[i])
        write_triangle(a, b, c, triangle)
        if contact(triangle, plate.half_x, plate.half_y, plate.both) == SATURATED:
            return True
    return False
