"""Influences of the nodes of a cut on each other, and what they are for a cut above it."""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel
from replay.numerics.triples import Triple
from replay.sensing.electrostatics.memory import MEMORY_TYPE, KnownInfluences, recalled, remembered
from replay.sensing.electrostatics.nodes import ACROSS, NODES_TYPE, WITHIN, Nodes, node_mean


@leaf_kernel
def _far(row: Floats, x: Floats, y: Floats, z: Floats, D: Floats, i: int, last: int) -> None:
    """Write 1/r of node i and nodes i .. last - 1 of its conductor that are far from it, 0 for those that are not."""
    X, Y, Z, own = x[i], y[i], z[i], D[i]
    beyond = WITHIN[2] * WITHIN[2]
    for j in range(i, last):
        a, b, c = x[j] - X, y[j] - Y, z[j] - Z
        square = a * a + b * b + c * c
        size = max(own, D[j])
        row[j] = 1.0 / math.sqrt(square) if square > beyond * size * size else 0.0


@leaf_kernel
def _add_from(sums: Floats, px: Floats, py: Floats, pz: Floats, point: Triple, weight: float) -> None:
    """Add the weight over the distance of a point to all points (n,)."""
    x, y, z = point
    for q in range(len(sums)):
        a, b, c = px[q] - x, py[q] - y, pz[q] - z
        sums[q] += weight / math.sqrt(a * a + b * b + c * c)


@leaf_kernel
def _means(row: Floats, sums: Floats, weights: Floats, first: int) -> None:
    """Write the means of the sums at the four points of each node from `first` on."""
    for j in range(first, len(row)):
        q = 4 * j
        row[j] = (weights[q] * sums[q] + weights[q + 1] * sums[q + 1]) + (
            weights[q + 2] * sums[q + 2] + weights[q + 3] * sums[q + 3]
        )


@leaf_kernel
def _are_near(x: Floats, y: Floats, z: Floats, D: Floats, i: int, j: int) -> bool:
    a, b, c, size = x[i] - x[j], y[i] - y[j], z[i] - z[j], max(D[i], D[j])
    return bool(a * a + b * b + c * c <= ACROSS[1] * ACROSS[1] * size * size)


@leaf_kernel
def _fill_within(
    row: Floats,
    i: int,
    last: int,
    nodes: Nodes,
    which: Integers,
    begin: int,
    memory: KnownInfluences,
    stack: Integers,
    shares: Floats,
) -> None:
    """Write the influences of node i and nodes i .. last - 1 of its conductor that are not written."""
    for j in range(i, last):
        if row[j] == 0.0:
            value = recalled(memory, which[i - begin], which[j - begin])
            if value == 0.0:
                value = remembered(memory, nodes, which[i - begin], which[j - begin], stack, shares)
            row[j] = value


@entry(
    NODES_TYPE,
    NODES_TYPE,
    int64[::1],
    int64[::1],
    NODES_TYPE,
    int64[::1],
    MEMORY_TYPE,
    MEMORY_TYPE,
    float64[:, ::1],
)
@kernel
def fill_influences(
    rest: Nodes,
    posed: Nodes,
    body: Integers,
    own: Integers,
    images: Nodes,
    image: Integers,
    memory: KnownInfluences,
    image_memory: KnownInfluences,
    into: Floats,
) -> None:
    """Write the upper triangle of the influences [1/m], the unit's nodes first.

    Args:
        rest, posed: the bodies' nodes in their own frames, and in the unit's.
        body: of each node.
        own, image: the nodes of bodies and unit, those of a body side by side.
        images: the unit's nodes.
        memory, image_memory: of influences within a body, which every pose finds the same, and within the unit.
        into: (m + n, m + n).
    """
    stack, shares = np.zeros((400, 2), np.int64), np.zeros(400)
    m, total = len(image), len(image) + len(own)
    x, y, z, D = np.empty(total), np.empty(total), np.empty(total), np.empty(total)
    px, py, pz, weights = np.empty(4 * total), np.empty(4 * total), np.empty(4 * total), np.empty(4 * total)
    last = np.empty(total, np.int64)
    for i in range(total - 1, -1, -1):
        nodes, k = (images, image[i]) if i < m else (posed, own[i - m])
        x[i], y[i], z[i] = nodes.panels.centroid[k, 0], nodes.panels.centroid[k, 1], nodes.panels.centroid[k, 2]
        D[i] = nodes.panels.diameter[k]
        for j in range(4):
            px[4 * i + j], py[4 * i + j], pz[4 * i + j] = (
                nodes.points[k, j, 0],
                nodes.points[k, j, 1],
                nodes.points[k, j, 2],
            )
            weights[4 * i + j] = nodes.weights[k, j]
        last[i] = last[i + 1] if i + 1 < total else total
        if i == m - 1 or (m <= i < total - 1 and body[own[i - m]] != body[own[i + 1 - m]]):
            last[i] = i + 1
    sums = np.empty(4 * total)
    for i in range(total):
        row = into[i]
        _far(row, x, y, z, D, i, last[i])
        if i < m:
            _fill_within(row, i, last[i], images, image, 0, image_memory, stack, shares)
        else:
            _fill_within(row, i, last[i], rest, own, m, memory, stack, shares)
        first = last[i]
        if first == total:
            continue
        sums[4 * first :] = 0.0
        for at in range(4 * i, 4 * i + 4):
            if weights[at] > 0.0:
                point, tail = (px[at], py[at], pz[at]), 4 * first
                _add_from(sums[tail:], px[tail:], py[tail:], pz[tail:], point, weights[at])
        _means(row, sums, weights, first)
        for j in range(first, total):
            if _are_near(x, y, z, D, i, j):
                if i < m:
                    row[j] = node_mean(images, image[i], posed, own[j - m], ACROSS, stack, shares)
                else:
                    row[j] = node_mean(posed, own[i - m], posed, own[j - m], ACROSS, stack, shares)


@entry(NODES_TYPE, int64[::1], int64[::1])
@kernel
def place_below(nodes: Nodes, above: Integers, below: Integers) -> Integers:
    """Return, of each node (n,) of a cut, which node of a cut above it (m,) it is part of, or is."""
    part = np.full(nodes.made[0], -1)
    stack = np.zeros(nodes.made[0] + 1, np.int64)
    for which in range(len(above)):
        stack[0] = above[which]
        size = 1
        while size > 0:
            size -= 1
            node = stack[size]
            part[node] = which
            if nodes.child[node] >= 0:
                stack[size], stack[size + 1] = nodes.child[node], nodes.child[node] + 1
                size += 2
    result = np.empty(len(below), np.int64)
    for k in range(len(below)):
        result[k] = part[below[k]]
    return result


@entry(float64[:, ::1], int64[::1], float64[::1], float64[:, ::1])
@kernel
def means_below(influences: Floats, part: Integers, weights: Floats, into: Floats) -> None:
    """Add the upper triangle of the influences of parts on each other, each the mean of its nodes by weight."""
    for i in range(len(part)):
        for j in range(i, len(part)):
            value = weights[i] * weights[j] * influences[i, j]
            if part[i] == part[j] and i != j:
                value *= 2.0
            into[min(part[i], part[j]), max(part[i], part[j])] += value
