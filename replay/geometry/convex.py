"""A body as a union of convex sets: what GJK and the collision pipeline read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.geometry.tree import Tree


class ConvexSets(NamedTuple):
    """A body as the union of m convex sets (convex pieces, or the triangles of its surface), in its link's frame.

    Set k is the convex hull of `vertices[first[k]:first[k + 1]]`. The vertices adjacent to vertex v on its set's hull
    are `neighbors[neighbors_first[v]:neighbors_first[v + 1]]`, as indices within the set; a set whose ranges are empty
    is searched by brute force. `surface` says that the sets are the surface triangles of a watertight body, so that a
    body wholly inside another needs a point-in-solid test beside them.
    """

    vertices: NDArray[np.float64]  # (v, 3) [m]
    first: NDArray[np.int64]  # (m + 1,)
    neighbors_first: NDArray[np.int64]  # (v + 1,)
    neighbors: NDArray[np.int64]  # (e,)
    tree: Tree  # over the sets' boxes
    surface: bool
