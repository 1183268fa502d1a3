"""Which pairs of many bodies can come near each other within a block: a tree over all bodies' swept boxes.

The box of a body holds its bounding sphere (see `bodies.Volumes.radius`) in every frame of the block, in world axes,
inflated by half the distance of interest. Bodies whose boxes are apart have spheres farther apart than that, in every
frame, so `broad.sieve` would rule them out frame by frame: leaving them out changes no result. A tree over the n boxes
finds the k pairs that meet in about n log n + k steps.

The sieve measures a distance in the first body's frame, by poses formed through the common ancestor; the boxes stand in
world, by other products of the same poses. With D links on the longest way to a root, M the largest coordinate of a
link and delta the largest |R^T R - I| of its rotation, the two differ by less than (D^2 2^-50 + 4 delta) times M and
the body's own lengths, to which the sieve's own slack of 2^-44 comes; `_inflation` is far above the sum.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.collision.bodies import Volumes
from replay.geometry.tree import MAX_DEPTH, TREE_TYPE, Tree, build_tree
from replay.kinematics.linkage import LinkPoses
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel


def near_pairs(volumes: Volumes, links: Integers, poses: LinkPoses, limit: float, steps: Floats) -> Integers:
    """Return (k, 2) bodies, first < second, that may be within `limit` [m] of each other in a block; others are not.

    Args:
        volumes: of B bodies.
        links: (B,) the bodies' links.
        poses: of n >= 1 frames.
        limit: distance of interest [m], finite.
        steps: (B,) added to each body's own distance of interest, half the limit [m].
    """
    lower, upper = np.empty((len(links), 3)), np.empty((len(links), 3))
    depth = max(len(poses.linkage.ancestors(link)) for link in sorted(set(links.tolist())))
    world = np.ascontiguousarray(poses.world)
    largest, defect = _extremes(world)
    inflation = (32.0 + depth * depth) * 2.0**-44 + 4.0 * defect
    _sweep(world, links, volumes.center, volumes.radius, 0.5 * limit + steps, largest, inflation, lower, upper)
    tree = build_tree(lower, upper, leaf_size=4)
    stack, none = np.empty(2 * MAX_DEPTH, dtype=np.int64), np.empty((0, 2), dtype=np.int64)
    found = np.empty((_meeting(tree, lower, upper, stack, none), 2), dtype=np.int64)
    _meeting(tree, lower, upper, stack, found)
    return found


@entry(float64[:, :, :, ::1])
@leaf_kernel
def _extremes(world: Floats) -> tuple[float, float]:
    """Return the largest |coordinate| of any link [m], and the largest |R^T R - I| of any rotation."""
    largest, defect = 0.0, 0.0
    for f in range(world.shape[0]):
        for link in range(world.shape[1]):
            square = 0.0
            for i in range(3):
                largest = max(largest, abs(world[f, link, i, 3]))
                for j in range(3):
                    x = -1.0 if i == j else 0.0
                    for k in range(3):
                        x += world[f, link, k, i] * world[f, link, k, j]
                    square += x * x
            defect = max(defect, square)
    return largest, math.sqrt(defect)


@entry(
    float64[:, :, :, ::1],
    int64[::1],
    float64[:, ::1],
    float64[::1],
    float64[::1],
    float64,
    float64,
    float64[:, ::1],
    float64[:, ::1],
)
@leaf_kernel
def _sweep(
    world: Floats,
    links: Integers,
    center: Floats,
    radius: Floats,
    margin: Floats,
    largest: float,
    inflation: float,
    lower: Floats,
    upper: Floats,
) -> None:
    """Write the swept boxes lower, upper (B, 3) [m]."""
    for body in range(len(links)):
        link = links[body]
        c = center[body]
        own = abs(c[0]) + abs(c[1]) + abs(c[2]) + radius[body]
        reach = radius[body] + margin[body] + inflation * (2.0 * largest + 2.0 * own + margin[body])
        for i in range(3):
            low, high = np.inf, -np.inf
            for f in range(world.shape[0]):
                row = world[f, link, i]
                x = row[0] * c[0] + row[1] * c[1] + row[2] * c[2] + row[3]
                low, high = min(low, x), max(high, x)
            lower[body, i], upper[body, i] = low - reach, high + reach


@entry(TREE_TYPE, float64[:, ::1], float64[:, ::1], int64[::1], int64[:, ::1])
@kernel
def _meeting(tree: Tree, lower: Floats, upper: Floats, stack: Integers, found: Integers) -> int:
    """Return how many pairs of boxes meet, and write them to `found` if it has room; `stack` is scratch."""
    count = 0
    for place in range(len(tree.order)):
        body = tree.order[place]
        waiting = 1
        stack[0] = 0
        while waiting > 0:
            waiting -= 1
            node = stack[waiting]
            # every pair is found once: from the part that stands first in the tree's order
            if tree.end[node] <= place + 1 or _apart(tree.lower, tree.upper, node, lower, upper, body):
                continue
            if tree.second[node] >= 0:
                stack[waiting], stack[waiting + 1] = tree.second[node], node + 1
                waiting += 2
                continue
            for k in range(max(tree.begin[node], place + 1), tree.end[node]):
                other = tree.order[k]
                if not _apart(lower, upper, other, lower, upper, body):
                    if count < len(found):
                        found[count, 0], found[count, 1] = min(body, other), max(body, other)
                    count += 1
    return count


@leaf_kernel
def _apart(lower_a: Floats, upper_a: Floats, a: int, lower_b: Floats, upper_b: Floats, b: int) -> bool:
    if lower_a[a, 0] > upper_b[b, 0] or lower_b[b, 0] > upper_a[a, 0]:
        return True
    if lower_a[a, 1] > upper_b[b, 1] or lower_b[b, 1] > upper_a[a, 1]:
        return True
    return bool(lower_a[a, 2] > upper_b[b, 2] or lower_b[b, 2] > upper_a[a, 2])
