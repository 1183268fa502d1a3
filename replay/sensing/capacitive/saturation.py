"""Whether a body saturates a sensor: asked first, as all that is near the plate then need not be summed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel, kernel, leaf_kernel
from replay.sensing.capacitive.cluster_bounds import place
from replay.sensing.capacitive.clusters import BEGIN, CENTROID, END, RADIUS, SECOND_CHILD, SIZE, Clusters
from replay.sensing.capacitive.contact import SATURATED, contact
from replay.sensing.capacitive.triangle_sum import faces_centre, part_into_plate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@leaf_kernel
def suspects(
    clusters: Clusters, T: Floats, half_x: float, half_y: float, facing: bool, stack: Ints, found: Ints, corners: Floats
) -> int:
    """Write the triangles that may saturate to `found`; return how many. Only nodes that reach the plate are opened."""
    nodes, links = clusters.nodes, clusters.links
    stack[0] = 0
    size, count = 1, 0
    while size > 0:
        size -= 1
        index = stack[size]
        x, y, z = place(T, nodes[index, CENTROID], nodes[index, CENTROID + 1], nodes[index, CENTROID + 2])
        u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
        if math.sqrt(u * u + v * v + z * z) > 1.000001 * nodes[index, RADIUS]:
            continue
        if links[index, SECOND_CHILD] >= 0:
            stack[size], stack[size + 1] = links[index, SECOND_CHILD], index + 1
            size += 2
            continue
        for k in range(links[index, BEGIN], links[index, END]):
            part_into_plate(T, clusters.parts, k, corners)
            counts = clusters.parts[k, SIZE] > 0.0 and (not facing or faces_centre(corners))
            if counts and may_touch(corners, half_x, half_y):
                found[count] = k
                count += 1
    return count


@inlined_kernel
def may_touch(corners: Floats, half_x: float, half_y: float) -> bool:
    """Return False only if `contact` finds a triangle corners[0] CLEAR, by the first of its tests."""
    z0, z1, z2 = corners[0, 0, 2], corners[0, 1, 2], corners[0, 2, 2]
    x0, x1, x2 = corners[0, 0, 0], corners[0, 1, 0], corners[0, 2, 0]
    y0, y1, y2 = corners[0, 0, 1], corners[0, 1, 1], corners[0, 2, 1]
    return (  # type: ignore[no-any-return]
        min(z0, z1, z2) <= 0.0 <= max(z0, z1, z2)
        and min(x0, x1, x2) <= half_x
        and max(x0, x1, x2) >= -half_x
        and min(y0, y1, y2) <= half_y
        and max(y0, y1, y2) >= -half_y
    )


@kernel
def any_saturates(
    parts: Floats, which: Ints, count: int, T: Floats, half_x: float, half_y: float, both: bool, corners: Floats
) -> bool:
    """Return whether one of the triangles which[:count] makes the integral infinite."""
    for i in range(count):
        part_into_plate(T, parts, which[i], corners)
        if contact(corners[0], half_x, half_y, both) == SATURATED:
            return True
    return False
