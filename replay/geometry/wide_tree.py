"""A tree over triangles with eight children a node, for queries that test the eight together.

One box test after the other leaves a processor's vector unit idle, and waits for memory at every level of a binary
tree. Here the numbers of eight boxes, and the corners of eight triangles, lie side by side: a loop over them compiles
to vector instructions, and a node is one stretch of memory. The levels are those of the binary `Tree`, three or more
taken at a time, always splitting the child with the largest box; the boxes are oriented (`surface_boxes`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float32, float64, int32, int64

from replay.geometry.surface_boxes import BOX, HALVES, fit_boxes
from replay.geometry.tree import MAX_DEPTH, TREE_TYPE, Tree
from replay.numerics.arrays import Floats, Integers, ShortIntegers, Singles
from replay.numerics.jit import entry, kernel, record
from replay.numerics.kept import kept

LANES = 8
"""Children of a node, and most triangles of a leaf."""

MAX_WAITING = (LANES - 1) * MAX_DEPTH + 1
"""Most entries on the stack of a traversal that replaces a node by its children."""


class WideTree(NamedTuple):
    """A tree of oriented boxes over n triangles, in the body's own frame; r nodes, l leaves.

    Number i of the boxes of a node's children is `boxes[node, LANES * i : LANES * (i + 1)]`; coordinate i of the
    triangles of a leaf likewise, corner after corner. Child c >= 0 is a node and c < 0 the leaf -1 - c. A place without
    a child has infinitely negative half widths; one without a triangle repeats the leaf's first and has index -1.
    """

    boxes: Singles  # (r, BOX * LANES) [m], centres seen from `middle`, see `surface_boxes`
    children: ShortIntegers  # (r, LANES), node 0 is the root
    corners: Floats  # (l, 9 * LANES) [m]
    indices: ShortIntegers  # (l, LANES) of the triangles
    middle: Floats  # (3,) of the body's box [m]
    farthest: Floats  # (3,) largest absolute coordinates of the body [m]


WIDE_TREE_TYPE = record(
    WideTree, float32[:, ::1], int32[:, ::1], float64[:, ::1], int32[:, ::1], float64[::1], float64[::1]
)


@kept
def widen(tree: Tree, triangles: Floats) -> WideTree:
    """Return the wide tree over triangles; equal input gives the equal tree.

    Args:
        tree: over the triangles, with at most `LANES` in a leaf.
        triangles: (n, 3, 3) [m].

    About half the time of `triangle_tree`: 0.04 s for 100 000 triangles.
    """
    members, children, leaves = _collapse(tree)
    middle = 0.5 * tree.lower[0] + 0.5 * tree.upper[0]
    in_order = triangles[tree.order]
    boxes = np.zeros((len(members), LANES, BOX), dtype=np.float32)
    boxes[:, :, HALVES:] = -np.inf
    boxes[members >= 0] = fit_boxes(tree, in_order, members[members >= 0], middle)
    corners, indices = _pack(tree, in_order, leaves)
    return WideTree(
        boxes=np.ascontiguousarray(boxes.transpose(0, 2, 1)).reshape(len(members), BOX * LANES),
        children=children,
        corners=corners,
        indices=indices,
        middle=middle,
        farthest=np.maximum(np.abs(tree.lower[0]), np.abs(tree.upper[0])),
    )


@entry(TREE_TYPE)
@kernel
def _collapse(tree: Tree) -> tuple[Integers, ShortIntegers, Integers]:
    """Return members (r, LANES) of the nodes as nodes of the binary tree or -1, children, and leaves (l,) likewise."""
    most = len(tree.second)
    members, children = np.full((most, LANES), -1, np.int64), np.zeros((most, LANES), np.int32)
    leaves, owner = np.empty(most, np.int64), np.zeros(most, np.int64)
    node, nodes, leaf_count = 0, 1, 0
    while node < nodes:
        member = members[node]
        member[0], count = owner[node], 1
        while count < LANES:
            chosen, largest = -1, 0.0
            for lane in range(count):
                k = member[lane]
                if tree.end[k] - tree.begin[k] <= LANES:
                    continue
                size = tree.upper[k] - tree.lower[k]
                area = size[0] * size[1] + size[1] * size[2] + size[2] * size[0]
                if chosen < 0 or area > largest:
                    chosen, largest = lane, area
            if chosen < 0:
                break
            k = member[chosen]
            member[chosen], member[count] = k + 1, tree.second[k]
            count += 1
        for lane in range(count):
            k = member[lane]
            if tree.end[k] - tree.begin[k] > LANES:
                children[node, lane] = nodes
                owner[nodes] = k
                nodes += 1
            else:
                leaves[leaf_count] = k
                leaf_count += 1
                children[node, lane] = -leaf_count
        node += 1
    return members[:nodes].copy(), children[:nodes].copy(), leaves[:leaf_count].copy()


@entry(TREE_TYPE, float64[:, :, ::1], int64[::1])
@kernel
def _pack(tree: Tree, triangles: Floats, leaves: Integers) -> tuple[Floats, ShortIntegers]:
    """Return the corners and indices of the leaves; triangles in the order of the tree."""
    corners, indices = np.empty((len(leaves), 9 * LANES)), np.full((len(leaves), LANES), -1, np.int32)
    for leaf in range(len(leaves)):
        begin, end = tree.begin[leaves[leaf]], tree.end[leaves[leaf]]
        for lane in range(LANES):
            place = begin
            if begin + lane < end:
                place = begin + lane
                indices[leaf, lane] = tree.order[place]
            for corner in range(3):
                for axis in range(3):
                    corners[leaf, (3 * corner + axis) * LANES + lane] = triangles[place, corner, axis]
    return corners, indices
