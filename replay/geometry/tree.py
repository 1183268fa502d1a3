"""The box tree over the parts of a body (triangles or convex pieces), as flat arrays that kernels read."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class Tree(NamedTuple):
    """A binary tree of axis-aligned boxes over n parts, in the body's own frame.

    Nodes are stored depth first, the root at 0: the first child of node k is k + 1, the second is `second[k]`, and a
    leaf has `second[k] == -1`. Node k covers the parts `order[begin[k]:end[k]]`, leaves and inner nodes alike.
    """

    lower: NDArray[np.float64]  # (m, 3) [m]
    upper: NDArray[np.float64]  # (m, 3) [m]
    second: NDArray[np.int64]  # (m,)
    begin: NDArray[np.int64]  # (m,)
    end: NDArray[np.int64]  # (m,)
    order: NDArray[np.int64]  # (n,)
