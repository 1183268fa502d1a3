"""The box tree over the parts of a body (triangles or convex pieces), as flat arrays that kernels read.

Built from the top by the surface area heuristic (Goldsmith and Salmon 1987): the cost of testing a node's children is
proportional to the chance that a random query which meets the node meets them, which is the ratio of surface areas.
Centres are sorted into `_BINS` bins on each axis and the cheapest of the planes between the bins is taken (Wald 2007).
Such a tree can be as deep as it has parts, so below `_FREE_LEVELS` levels, and where all centres are one, parts are
halved by count. That bounds the depth and lets traversals keep their stack in a fixed array.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float64, int64

from replay.errors import InvalidValue
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel, record
from replay.numerics.kept import kept

_BINS = 16
_FREE_LEVELS = 32

MAX_DEPTH = 64
"""Most nodes on a way from the root to a leaf: 32 chosen freely, then halves of at most 2^31 parts.

A traversal that replaces a node on its stack by its two children never holds more than MAX_DEPTH entries.
"""


class Tree(NamedTuple):
    """A binary tree of axis-aligned boxes over n parts, in the body's own frame.

    Nodes are stored depth first, the root at 0: the first child of node k is k + 1, the second is `second[k]`, and a
    leaf has `second[k] == -1`. Node k covers the parts `order[begin[k]:end[k]]`, leaves and inner nodes alike. Boxes
    are the exact minima and maxima of what they cover.
    """

    lower: Floats  # (m, 3) [m]
    upper: Floats  # (m, 3) [m]
    second: Integers  # (m,)
    begin: Integers  # (m,)
    end: Integers  # (m,)
    order: Integers  # (n,)


TREE_TYPE = record(Tree, float64[:, ::1], float64[:, ::1], int64[::1], int64[::1], int64[::1], int64[::1])


def build_tree(lower: Floats, upper: Floats, *, leaf_size: int = 4) -> Tree:
    """Return the tree over n >= 1 boxes; equal input gives the equal tree.

    Args:
        lower, upper: (n, 3) corners of the parts' boxes [m], finite, lower <= upper.
        leaf_size: most parts in a leaf.

    Raises:
        InvalidValue: wrong shape, no parts, not finite, lower above upper, or a leaf size below 1.
    """
    lower = np.ascontiguousarray(lower, dtype=np.float64)
    upper = np.ascontiguousarray(upper, dtype=np.float64)
    if lower.ndim != 2 or lower.shape[1] != 3 or lower.shape != upper.shape or not 0 < len(lower) < 2**31:
        raise InvalidValue("lower, upper", f"{lower.shape}, {upper.shape}", "both must have one shape (n, 3), n >= 1")
    if not (np.isfinite(lower).all() and np.isfinite(upper).all() and (lower <= upper).all()):
        raise InvalidValue("lower, upper", "boxes", "must be finite with lower <= upper")
    if leaf_size < 1:
        raise InvalidValue("leaf_size", leaf_size, "must be at least 1")
    n = len(lower)
    order = np.arange(n, dtype=np.int64)
    boxes, nodes = np.empty((2 * n - 1, 6)), np.empty((2 * n - 1, 3), dtype=np.int64)
    count = _build(lower, upper, 0.5 * lower + 0.5 * upper, int(leaf_size), order, np.empty_like(order), boxes, nodes)
    boxes, nodes = boxes[:count], nodes[:count]
    return Tree(
        lower=np.ascontiguousarray(boxes[:, :3]),
        upper=np.ascontiguousarray(boxes[:, 3:]),
        second=np.ascontiguousarray(nodes[:, 0]),
        begin=np.ascontiguousarray(nodes[:, 1]),
        end=np.ascontiguousarray(nodes[:, 2]),
        order=order,
    )


@kept
def triangle_tree(triangles: Floats, *, leaf_size: int = 4) -> Tree:
    """Return the tree over triangles (n, 3, 3) [m]; see `build_tree`."""
    triangles = np.asarray(triangles, dtype=np.float64)
    if triangles.ndim != 3 or triangles.shape[1:] != (3, 3):
        raise InvalidValue("triangles", triangles.shape, "must have shape (n, 3, 3)")
    return build_tree(*boxes_of(triangles), leaf_size=leaf_size)


def boxes_of(triangles: Floats) -> tuple[Floats, Floats]:
    """Return the least and the largest coordinates (n, 3) of each triangle (n, 3, 3)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


@kernel
def _half_area(box: Floats) -> float:
    x, y, z = box[3] - box[0], box[4] - box[1], box[5] - box[2]
    return x * y + y * z + z * x  # type: ignore[no-any-return]


@kernel
def _grow(box: Floats, low: Floats, high: Floats) -> None:
    for axis in range(3):
        box[axis] = min(box[axis], low[axis])
        box[axis + 3] = max(box[axis + 3], high[axis])


@kernel
def _clear(box: Floats) -> None:
    for axis in range(3):
        box[axis], box[axis + 3] = np.inf, -np.inf


@kernel
def _bin_of(centre: float, low: float, scale: float) -> int:
    return min(_BINS - 1, int((centre - low) * scale))


@kernel
def _best_plane(
    lower: Floats,
    upper: Floats,
    centres: Floats,
    order: Integers,
    begin: int,
    end: int,
    box: Floats,
    bins: Floats,
    sweep: Floats,
    counts: Integers,
    behind: Floats,
) -> tuple[int, int]:
    """Return (axis, plane): parts whose centre's bin is at most `plane` go first; axis -1 when no plane divides them.

    `box` (6,) bounds the parts' centres; `bins` (_BINS, 6), `sweep` (6,), `counts` and `behind` (_BINS,) are
    scratch.
    """
    best_axis, best_plane, best_cost, best_tilt = -1, 0, np.inf, end - begin
    for axis in range(3):
        extent = box[axis + 3] - box[axis]
        scale = _BINS / extent if extent > 0.0 else 0.0
        if not (0.0 < scale < np.inf):
            continue
        for b in range(_BINS):
            _clear(bins[b])
            counts[b] = 0
        for k in range(begin, end):
            part = order[k]
            b = _bin_of(centres[part, axis], box[axis], scale)
            counts[b] += 1
            _grow(bins[b], lower[part], upper[part])
        _clear(sweep)
        total = 0
        for b in range(_BINS - 1, 0, -1):
            total += counts[b]
            _grow(sweep, bins[b], bins[b, 3:])
            behind[b] = total * _half_area(sweep) if total > 0 else 0.0
        _clear(sweep)
        total = 0
        for b in range(_BINS - 1):
            total += counts[b]
            _grow(sweep, bins[b], bins[b, 3:])
            if total == 0 or total == end - begin:
                continue
            cost = total * _half_area(sweep) + behind[b + 1]
            tilt = abs(end - begin - 2 * total)
            if cost < best_cost or (cost == best_cost and tilt < best_tilt):
                best_axis, best_plane, best_cost, best_tilt = axis, b, cost, tilt
    return best_axis, best_plane


@kernel
def _partition(
    centres: Floats,
    order: Integers,
    begin: int,
    end: int,
    axis: int,
    plane: int,
    low: float,
    scale: float,
    spare: Integers,
) -> int:
    """Put the parts up to the plane first, keeping their order, and return where the others begin."""
    middle, others = begin, 0
    for k in range(begin, end):
        part = order[k]
        if _bin_of(centres[part, axis], low, scale) <= plane:
            order[middle] = part
            middle += 1
        else:
            spare[others] = part
            others += 1
    for k in range(others):
        order[middle + k] = spare[k]
    return middle


@entry(float64[:, ::1], float64[:, ::1], float64[:, ::1], int64, int64[::1], int64[::1], float64[:, ::1], int64[:, ::1])
@kernel
def _build(
    lower: Floats,
    upper: Floats,
    centres: Floats,
    leaf_size: int,
    order: Integers,
    spare: Integers,
    node_boxes: Floats,
    nodes: Integers,
) -> int:
    """Write the nodes' boxes (lower, upper) and (second, begin, end), sort `order`, and return the number of nodes."""
    bins, sweep, counts, behind = np.empty((_BINS, 6)), np.empty(6), np.empty(_BINS, np.int64), np.empty(_BINS)
    box = np.empty(6)  # of a node's centres
    waiting = np.empty((MAX_DEPTH, 4), np.int64)  # begin, end, depth, the node whose second child it is or -1
    waiting[0, 0], waiting[0, 1], waiting[0, 2], waiting[0, 3] = 0, len(lower), 0, -1
    size, count = 1, 0
    while size > 0:
        size -= 1
        begin, end, depth, parent = waiting[size, 0], waiting[size, 1], waiting[size, 2], waiting[size, 3]
        node = count
        count += 1
        if parent >= 0:
            nodes[parent, 0] = node
        _clear(node_boxes[node])
        _clear(box)
        for k in range(begin, end):
            part = order[k]
            _grow(node_boxes[node], lower[part], upper[part])
            _grow(box, centres[part], centres[part])
        nodes[node, 0], nodes[node, 1], nodes[node, 2] = -1, begin, end
        if end - begin <= leaf_size:
            continue
        axis, plane = -1, 0
        if depth < _FREE_LEVELS:
            axis, plane = _best_plane(lower, upper, centres, order, begin, end, box, bins, sweep, counts, behind)
        if axis >= 0:
            scale = _BINS / (box[axis + 3] - box[axis])
            middle = _partition(centres, order, begin, end, axis, plane, box[axis], scale, spare)
        else:
            middle = begin + (end - begin + 1) // 2
        for first, last, owner in ((middle, end, node), (begin, middle, -1)):
            waiting[size, 0], waiting[size, 1], waiting[size, 2], waiting[size, 3] = first, last, depth + 1, owner
            size += 1
    return count
