"""Whether a body saturates a sensor: asked first, as all that is near the plate then need not be summed."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import Tree
from replay.numerics.jit import kernel
from replay.sensing.capacitive.cluster_bounds import place
from replay.sensing.capacitive.clusters import CENTROID, RADIUS, Clusters
from replay.sensing.capacitive.contact import SATURATED, contact
from replay.sensing.capacitive.triangle_sum import faces_centre, into_plate

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


@kernel
def saturates(
    clusters: Clusters,
    tree: Tree,
    T: Floats,
    half_x: float,
    half_y: float,
    both: bool,
    facing: bool,
    stack: Ints,
    corners: Floats,
) -> bool:
    """Return whether a triangle that counts makes the integral infinite; only nodes that reach the plate are opened."""
    nodes = clusters.nodes
    stack[0] = 0
    size = 1
    while size > 0:
        size -= 1
        index = stack[size]
        x, y, z = place(T, nodes[index, CENTROID], nodes[index, CENTROID + 1], nodes[index, CENTROID + 2])
        u, v = max(abs(x) - half_x, 0.0), max(abs(y) - half_y, 0.0)
        if math.sqrt(u * u + v * v + z * z) > 1.000001 * nodes[index, RADIUS]:
            continue
        if tree.second[index] >= 0:
            stack[size], stack[size + 1] = tree.second[index], index + 1
            size += 2
            continue
        for k in range(tree.begin[index], tree.end[index]):
            into_plate(T, clusters.triangles, k, corners)
            heights = (corners[0, 0, 2], corners[0, 1, 2], corners[0, 2, 2])
            if min(heights) <= 0.0 <= max(heights) and clusters.areas[k] > 0.0:
                counts = not facing or faces_centre(corners)
                if counts and contact(corners[0], half_x, half_y, both) == SATURATED:
                    return True
    return False
