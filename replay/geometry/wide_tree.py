"""A tree over triangles with eight children a node, for queries that test the eight together.

One box test after the other leaves a processor's vector unit idle, and waits for memory at every level of a binary
tree. Here the numbers of eight boxes, and the corners of eight triangles, lie side by side (structure of arrays): a
loop over them compiles to vector instructions, and a node is one stretch of memory. The levels are those of the binary
`Tree`, three or more taken at a time, always splitting the child with the largest box.

Boxes are oriented along the principal axes of the surface they hold. A patch of a smooth surface is flat to the second
order of its size, an upright box only to the first: with a patch d away and s across, about d / s upright boxes are
nearer than the closest point, and a few oriented ones.

They are kept in single precision, seen from the middle of the mesh. Half widths are measured against the axes as they
are after rounding. The axes are orthonormal to 2e-7 then, so a projection onto them may be short or long by that part
of its length; the half widths are padded by `_PAD` of their sum to cover it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.geometry.principal_axes import eigen
from replay.geometry.tree import MAX_DEPTH, Tree
from replay.numerics.jit import kernel

Floats = NDArray[np.float64]
Singles = NDArray[np.float32]
Ints = NDArray[np.int64]
ShortInts = NDArray[np.int32]

LANES = 8
"""Children of a node, and most triangles of a leaf."""

CENTRE, AXES, HALVES, BOX = 0, 3, 12, 15
"""Where the numbers of a box begin, and how many they are: centre, three axes, three half widths."""

MAX_WAITING = (LANES - 1) * MAX_DEPTH + 1
"""Most entries on the stack of a traversal that replaces a node by its children."""

SHORT = 1e-6
"""Part by which the length of a vector and of its three projections on a box's axes may differ, at most."""

_PAD = 1e-6
_TINY = float(np.finfo(np.float32).tiny)  # below it, single precision rounds by more than `_PAD`


class WideTree(NamedTuple):
    """A tree of oriented boxes over n triangles, in the body's own frame; r nodes, l leaves.

    Number i of the boxes of a node's children is `boxes[node, LANES * i : LANES * (i + 1)]`, see `BOX`; coordinate i of
    the triangles of a leaf likewise, corner after corner. Child c >= 0 is a node and c < 0 the leaf -1 - c. A place
    without a child has infinitely negative half widths; one without a triangle repeats the leaf's first and has
    index -1.
    """

    boxes: Singles  # (r, BOX * LANES) [m], centres seen from `middle`
    children: ShortInts  # (r, LANES), node 0 is the root
    corners: Floats  # (l, 9 * LANES) [m]
    index: ShortInts  # (l, LANES) which triangle
    middle: Floats  # (3,) of the body's box [m]
    farthest: Floats  # (3,) largest absolute coordinates of the body [m]


def widen(tree: Tree, triangles: Floats) -> WideTree:
    """Return the wide tree over triangles (n, 3, 3) [m], given their binary tree; equal input gives the equal tree."""
    members, children, leaves = _collapse(tree)
    middle = 0.5 * tree.lower[0] + 0.5 * tree.upper[0]
    sorted_triangles = triangles[tree.order]
    corners, index = _pack(tree, sorted_triangles, leaves)
    return WideTree(
        boxes=_fit(tree, sorted_triangles, members, middle),
        children=children,
        corners=corners,
        index=index,
        middle=middle,
        farthest=np.maximum(np.abs(tree.lower[0]), np.abs(tree.upper[0])),
    )


@kernel
def _half_area(x: float, y: float, z: float) -> float:
    return x * y + y * z + z * x


@kernel
def _collapse(tree: Tree) -> tuple[Ints, ShortInts, Ints]:
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
                area = _half_area(size[0], size[1], size[2])
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


@kernel
def _pack(tree: Tree, triangles: Floats, leaves: Ints) -> tuple[Floats, ShortInts]:
    """Return the corners and indices of the leaves; triangles in the order of the tree."""
    corners, index = np.empty((len(leaves), 9 * LANES)), np.full((len(leaves), LANES), -1, np.int32)
    for leaf in range(len(leaves)):
        begin, end = tree.begin[leaves[leaf]], tree.end[leaves[leaf]]
        for lane in range(LANES):
            place = begin
            if begin + lane < end:
                place = begin + lane
                index[leaf, lane] = tree.order[place]
            for corner in range(3):
                for axis in range(3):
                    corners[leaf, (3 * corner + axis) * LANES + lane] = triangles[place, corner, axis]
    return corners, index


@kernel
def _add_moments(to: Floats, more: Floats) -> None:
    """Add a piece of surface to another; (10,) area, mean and central second moments xx xy xz yy yz zz."""
    total = to[0] + more[0]
    if not total > 0.0:
        return
    part = more[0] / total
    x, y, z = more[1] - to[1], more[2] - to[2], more[3] - to[3]
    weight = to[0] * part
    to[0] = total
    to[1] += part * x
    to[2] += part * y
    to[3] += part * z
    to[4] += more[4] + weight * x * x
    to[5] += more[5] + weight * x * y
    to[6] += more[6] + weight * x * z
    to[7] += more[7] + weight * y * y
    to[8] += more[8] + weight * y * z
    to[9] += more[9] + weight * z * z


@kernel
def _moments(tree: Tree, triangles: Floats) -> Floats:
    """Return the moments (m, 10) of the surface under each node of the binary tree, see `_add_moments`.

    A triangle with centroid m has the second moments area / 12 * sum of (p - m)(p - m)^T over its corners p.
    """
    moments, one = np.zeros((len(tree.second), 10)), np.empty(10)
    for node in range(len(tree.second) - 1, -1, -1):
        second = tree.second[node]
        if second >= 0:
            moments[node] = moments[node + 1]
            _add_moments(moments[node], moments[second])
            continue
        for k in range(tree.begin[node], tree.end[node]):
            t = triangles[k]
            ux, uy, uz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
            wx, wy, wz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
            nx, ny, nz = uy * wz - uz * wy, uz * wx - ux * wz, ux * wy - uy * wx
            one[0] = 0.5 * math.sqrt(nx * nx + ny * ny + nz * nz)
            for i in range(3):
                one[1 + i] = (t[0, i] + t[1, i] + t[2, i]) / 3.0
            for i in range(4, 10):
                one[i] = 0.0
            for corner in range(3):
                x, y, z = t[corner, 0] - one[1], t[corner, 1] - one[2], t[corner, 2] - one[3]
                weight = one[0] / 12.0
                one[4] += weight * x * x
                one[5] += weight * x * y
                one[6] += weight * x * z
                one[7] += weight * y * y
                one[8] += weight * y * z
                one[9] += weight * z * z
            _add_moments(moments[node], one)
    return moments


@kernel
def _axes(moments: Floats, matrix: Floats, axes: Floats) -> None:
    """Write the principal axes, rounded to single precision."""
    matrix[0, 0], matrix[0, 1], matrix[0, 2] = moments[4], moments[5], moments[6]
    matrix[1, 0], matrix[1, 1], matrix[1, 2] = moments[5], moments[7], moments[8]
    matrix[2, 0], matrix[2, 1], matrix[2, 2] = moments[6], moments[8], moments[9]
    vectors = eigen(matrix)[1]
    for i in range(3):
        for j in range(3):
            axes[i, j] = np.float32(vectors[i, j])


@kernel
def _measure(triangles: Floats, origin: Floats, axes: Floats, low: Floats, high: Floats) -> None:
    """Write the least and largest projections of the corners, seen from the origin, on each axis."""
    for i in range(3):
        ax, ay, az = axes[i, 0], axes[i, 1], axes[i, 2]
        least, most = np.inf, -np.inf
        for k in range(len(triangles)):
            t = triangles[k]
            for corner in range(3):
                along = (
                    ax * (t[corner, 0] - origin[0]) + ay * (t[corner, 1] - origin[1]) + az * (t[corner, 2] - origin[2])
                )
                least, most = min(least, along), max(most, along)
        low[i], high[i] = least, most


@kernel
def _fit(tree: Tree, triangles: Floats, members: Ints, middle: Floats) -> Singles:
    """Return the boxes of the children; triangles in the order of the tree."""
    boxes = np.zeros((len(members), BOX * LANES), np.float32)
    moments = _moments(tree, triangles)
    centre, matrix, axes = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    low, high, half = np.empty(3), np.empty(3), np.empty(3)
    for node in range(len(members)):
        for lane in range(LANES):
            box = boxes[node, lane:]
            k = members[node, lane]
            if k < 0:
                for i in range(3):
                    box[(HALVES + i) * LANES] = -np.inf
                continue
            for i in range(3):
                centre[i] = 0.5 * tree.lower[k, i] + 0.5 * tree.upper[k, i]
                half[i] = 0.5 * tree.upper[k, i] - 0.5 * tree.lower[k, i]
            _axes(moments[k], matrix, axes)
            _measure(triangles[tree.begin[k] : tree.end[k]], centre, axes, low, high)
            if not 0.25 * _half_area(high[0] - low[0], high[1] - low[1], high[2] - low[2]) < _half_area(
                half[0], half[1], half[2]
            ):
                for i in range(3):
                    low[i], high[i] = -half[i], half[i]
                    for j in range(3):
                        axes[i, j] = 1.0 if i == j else 0.0
            for i in range(3):
                inward = centre[i] - middle[i]
                for j in range(3):
                    inward += 0.5 * (low[j] + high[j]) * axes[j, i]
                box[(CENTRE + i) * LANES] = inward
                half[i] = np.float64(box[(CENTRE + i) * LANES]) - (centre[i] - middle[i])
            # `half` is the way to the centre as it is after rounding, seen from which both sides are measured
            padding = _TINY
            for i in range(3):
                along = axes[i, 0] * half[0] + axes[i, 1] * half[1] + axes[i, 2] * half[2]
                high[i] = max(high[i] - along, along - low[i])
                padding += _PAD * high[i]
                for j in range(3):
                    box[(AXES + 3 * i + j) * LANES] = axes[i, j]
            for i in range(3):
                box[(HALVES + i) * LANES] = high[i] + padding
    return boxes
