"""Which nodes of bodies and unit carry charges of their own in one pose: N of them, where they matter.

All trees share one heap. The node of the largest score is replaced by its two children until there are N nodes,

    score = w A phi^2 (2 r)^2 / max(d, 0.3 r, 3 mm)^3,    phi^2 = max over electrodes k of <phi_k^2> / E_k,

d the least distance to the other side over all that is below the node, phi the unit's potential there, E as in
`keyframes`, so that every electrode has its share, and w = 1, of the unit's own nodes, which are images, 0.3.
"""

from __future__ import annotations

import math

import numpy as np
from numba import float64, int64

from replay.geometry.closest import distance_to_surface
from replay.geometry.tree import TREE_TYPE, Tree
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel, leaf_kernel
from replay.sensing.electrostatics.nodes import NODES_TYPE, Nodes, children
from replay.sensing.electrostatics.placement import RESOLVED

_IMAGE = 0.3
"""Weight w of the unit's own nodes."""


@leaf_kernel
def _score(nodes: Nodes, node: int, square: float, distance: float, weight: float) -> float:
    r = 0.5 * nodes.panels.diameter[node]
    d = max(distance, 0.3 * r, RESOLVED)
    return float(weight * nodes.panels.area[node] * square * 4.0 * r * r / (d * d * d))


@leaf_kernel
def _push(scores: Floats, entries: Integers, size: int, score: float, which: int) -> int:
    k = size
    while k > 0 and scores[(k - 1) // 2] < score:
        scores[k], entries[k] = scores[(k - 1) // 2], entries[(k - 1) // 2]
        k = (k - 1) // 2
    scores[k], entries[k] = score, which
    return size + 1


@leaf_kernel
def _pop(scores: Floats, entries: Integers, size: int) -> int:
    size -= 1
    score, which = scores[size], entries[size]
    k = 0
    while 2 * k + 1 < size:
        c = 2 * k + 1
        if c + 1 < size and scores[c + 1] > scores[c]:
            c += 1
        if scores[c] <= score:
            break
        scores[k], entries[k] = scores[c], entries[c]
        k = c
    scores[k], entries[k] = score, which
    return size


@entry(NODES_TYPE, int64, float64[::1], float64[::1])
@kernel
def gathered(nodes: Nodes, known: int, squares: Floats, distances: Floats) -> None:
    """Write phi^2 and d of all nodes 0 .. known - 1 that have children there: means by area, and minima."""
    for k in range(known - 1, -1, -1):
        c = nodes.child[k]
        if c < 0 or c + 1 >= known:
            continue
        a, b = nodes.panels.area[c], nodes.panels.area[c + 1]
        squares[k] = (a * squares[c] + b * squares[c + 1]) / (a + b)
        distances[k] = min(distances[c], distances[c + 1])


@entry(
    NODES_TYPE,
    int64,
    int64,
    float64[::1],
    float64[::1],
    NODES_TYPE,
    int64,
    float64[:, ::1],
    float64[::1],
    float64[:, :, ::1],
    float64[:, :, ::1],
    TREE_TYPE,
    int64,
    int64,
)
@kernel
def cut(
    body: Nodes,
    roots: int,
    known: int,
    squares: Floats,
    distances: Floats,
    image: Nodes,
    image_roots: int,
    survey: Floats,
    survey_squares: Floats,
    T_unit_shape: Floats,
    surface: Floats,
    tree: Tree,
    few: int,
    many: int,
) -> Integers:
    """Return the cut with `many` nodes and, before it, the one with `few`.

    Args:
        body: all bodies' nodes of one frame; the first `roots` are roots, `squares` and `distances` are of the first
            `known`.
        image: the unit's nodes; the first `image_roots` are roots.
        survey: (m, 3) [m] points of the body, in the unit's frame, with `survey_squares` (m,).
        T_unit_shape: (shapes, 4, 4).
        surface, tree: the unit's triangles.
        few, many: numbers of nodes.

    Returns:
        (2, many + 2): a row for each cut, nodes of the body as they are and those of the unit as -1 - node, in order;
        the last entries are how many of these there are.
    """
    room = many + 8 + roots + image_roots
    scores, entries = np.zeros(room), np.zeros(room, np.int64)
    square_of, distance_of = np.zeros(2 * room), np.zeros(2 * room)
    side, node_of = np.zeros(2 * room, np.int64), np.zeros(2 * room, np.int64)
    result = np.zeros((2, room), np.int64)
    made, size, point = 0, 0, np.empty(3)
    final = np.zeros(2 * room, np.int64)
    finals = 0
    for which in range(roots + image_roots):
        if which < roots:
            node_of[made], side[made] = which, 0
            square_of[made], distance_of[made] = squares[which], distances[which]
        else:
            node_of[made], side[made] = which - roots, 1
            square_of[made], distance_of[made] = _nearest(image, which - roots, survey, survey_squares)
        nodes = body if which < roots else image
        weight = 1.0 if which < roots else _IMAGE
        size = _push(
            scores, entries, size, _score(nodes, node_of[made], square_of[made], distance_of[made], weight), made
        )
        made += 1
    written = 0
    while size > 0 and written < 2:
        wanted = few if written == 0 else many
        if size + finals >= wanted:
            at = 0
            for k in range(size):
                e = entries[k]
                result[written, at] = node_of[e] if side[e] == 0 else -1 - node_of[e]
                at += 1
            for k in range(finals):
                e = final[k]
                result[written, at] = node_of[e] if side[e] == 0 else -1 - node_of[e]
                at += 1
            result[written, room - 1] = at
            written += 1
            continue
        e = entries[0]
        size = _pop(scores, entries, size)
        nodes = body if side[e] == 0 else image
        first = children(nodes, node_of[e]) if made + 2 < 2 * room else -1
        if first < 0:
            final[finals] = e
            finals += 1
            if size == 0:
                wanted = 0
            continue
        for c in (first, first + 1):
            node_of[made], side[made] = c, side[e]
            if side[e] == 1:
                square_of[made], distance_of[made] = _nearest(image, c, survey, survey_squares)
            elif c < known:
                square_of[made], distance_of[made] = squares[c], distances[c]
            else:
                T = T_unit_shape[body.shape[c]]
                for axis in range(3):
                    point[axis] = T[axis, 3]
                    for other in range(3):
                        point[axis] += T[axis, other] * body.panels.centroid[c, other]
                square_of[made] = square_of[e]
                distance_of[made] = distance_to_surface(point, surface, tree)
            weight = 1.0 if side[e] == 0 else _IMAGE
            size = _push(scores, entries, size, _score(nodes, c, square_of[made], distance_of[made], weight), made)
            made += 1
    return result


@kernel
def _nearest(image: Nodes, node: int, survey: Floats, squares: Floats) -> tuple[float, float]:
    """Return phi^2 at the point of the bodies that is nearest to a node of the unit, and how far that is."""
    best, which = math.inf, 0
    x, y, z = image.panels.centroid[node, 0], image.panels.centroid[node, 1], image.panels.centroid[node, 2]
    for k in range(len(survey)):
        square = (survey[k, 0] - x) ** 2 + (survey[k, 1] - y) ** 2 + (survey[k, 2] - z) ** 2
        if square < best:
            best, which = square, k
    return squares[which], math.sqrt(best)
