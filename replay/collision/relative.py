"""Relative poses of link pairs for a whole block, in compiled code: the numbers of `LinkPoses.relative`.

The way from a link up to a common ancestor is shared by many pairs, so each distinct way is multiplied once a block:
way k is its parent's way times the link's own pose. A pair then costs one inverse and one product a frame.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from replay.collision.leaf import leaf
from replay.kinematics.linkage import Linkage

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class RelativePoses:
    """Link pairs (a, b) of a linkage, and which ways their relative poses are made of."""

    def __init__(self, linkage: Linkage, links: Sequence[tuple[int, int]]) -> None:
        ways: list[tuple[int, int]] = []  # (parent's way or -1, link)
        rows: dict[tuple[int, ...], int] = {}
        pairs = []
        for a, b in links:
            both = linkage.chains_to_common_ancestor(a, b)
            pairs.append([self._row(tuple(reversed(up)), ways, rows) for up in both])
        self._ways = np.array(ways, dtype=np.int64).reshape(-1, 2)
        self._pairs = np.array(pairs, dtype=np.int64).reshape(-1, 2)

    def of(self, local: Floats) -> Floats:
        """Return T_a_b (Q, n, 4, 4) of the Q link pairs, for link poses local (n, L, 4, 4) in their parents."""
        n = len(local)
        table, result = np.empty((len(self._ways), n, 4, 4)), np.empty((len(self._pairs), n, 4, 4))
        _relative(np.ascontiguousarray(local), self._ways, self._pairs, table, np.identity(4), np.identity(4), result)
        return result

    def _row(self, down: tuple[int, ...], ways: list[tuple[int, int]], rows: dict[tuple[int, ...], int]) -> int:
        """Return the row of the way down these links, -1 for none, adding what is missing."""
        if not down:
            return -1
        if down not in rows:
            parent = self._row(down[:-1], ways, rows)
            rows[down] = len(ways)
            ways.append((parent, down[-1]))
        return rows[down]


@leaf
def _relative(
    local: Floats, ways: Integers, pairs: Integers, table: Floats, identity: Floats, inverse: Floats, result: Floats
) -> None:
    """Fill result (Q, n, 4, 4); `table` (ways, n, 4, 4) and `inverse` (4, 4), an identity at first, are scratch."""
    n = local.shape[0]
    for k in range(len(ways)):
        parent, link = ways[k, 0], ways[k, 1]
        for f in range(n):
            _compose(identity if parent < 0 else table[parent, f], local[f, link], table[k, f])
    for q in range(len(pairs)):
        a, b = pairs[q, 0], pairs[q, 1]
        for f in range(n):
            up = identity if a < 0 else table[a, f]
            for i in range(3):
                for j in range(3):
                    inverse[i, j] = up[j, i]
                inverse[i, 3] = -(up[0, i] * up[0, 3] + up[1, i] * up[1, 3] + up[2, i] * up[2, 3])
            _compose(inverse, identity if b < 0 else table[b, f], result[q, f])


@leaf
def _compose(first: Floats, second: Floats, product: Floats) -> None:
    """Write first second, rigid transforms (4, 4), in the order of operations of `transforms.compose`."""
    for i in range(3):
        x, y, z = first[i, 0], first[i, 1], first[i, 2]
        for j in range(3):
            product[i, j] = x * second[0, j] + y * second[1, j] + z * second[2, j]
        product[i, 3] = x * second[0, 3] + y * second[1, 3] + z * second[2, 3] + first[i, 3]
        product[3, i] = 0.0
    product[3, 3] = 1.0
