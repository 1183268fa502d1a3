"""Relative poses of link pairs for a whole block, in compiled code: the numbers of `LinkPoses.relative`.

The way from a link up to a common ancestor is shared by many pairs, so each distinct way is multiplied once a block:
way k is its parent's way times the link's own pose. A pair then costs one inverse and one product a frame.
"""

from __future__ import annotations

import numpy as np
from numba import boolean, float64, int64

from replay.kinematics.linkage import Linkage
from replay.kinematics.timeline import compose
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.jit import entry, leaf_kernel

_IDENTITY = np.identity(4)


class RelativePoses:
    """Link pairs (Q, 2) of a linkage, and which ways their relative poses are made of.

    Link l at depth d of its tree has the path of links p_0 (the root) .. p_d = l. Two links share the first m links of
    their paths; the way of each is the rest of its path, named by (m, l), none if it is empty. The way before it,
    (m, p_d-1), is that of its parent.
    """

    def __init__(self, linkage: Linkage, links: Integers) -> None:
        links = np.asarray(links, dtype=np.int64).reshape(-1, 2)
        used, place = np.unique(links, return_inverse=True)
        place = place.reshape(links.shape)
        paths = [linkage.ancestors(int(link))[::-1] for link in used]
        depth = max(map(len, paths), default=0)
        table = np.array([path + [-1] * (depth - len(path)) for path in paths], dtype=np.int64).reshape(-1, depth)
        first, second = table[place[:, 0]], table[place[:, 1]]
        shared = np.cumprod((first == second) & (first >= 0), axis=1).sum(axis=1)
        length = np.array([len(path) for path in paths], dtype=np.int64)
        empty = length[place] == shared[:, None]
        count = len(linkage.links)
        wanted = np.where(empty, -1, shared[:, None] * count + links)
        # every way and those before it, parents first: by the number of links above the way's last one
        above = np.full(count, -1, dtype=np.int64)
        for path in paths:
            above[path] = np.arange(len(path))
        keys = np.unique(wanted[~empty])
        fresh = keys
        while len(fresh):
            longer = above[fresh % count] > fresh // count
            fresh = np.setdiff1d(fresh[longer] - fresh[longer] % count + linkage.parents[fresh[longer] % count], keys)
            keys = np.union1d(keys, fresh)
        keys = keys[np.argsort(above[keys % count], kind="stable")]
        order = np.argsort(keys)
        parents = np.where(above[keys % count] > keys // count, keys - keys % count + linkage.parents[keys % count], -1)
        self._ways = np.stack([_rows(parents, keys, order), keys % count], axis=1)
        self._pairs = np.ascontiguousarray(_rows(wanted, keys, order))

    @property
    def count(self) -> int:
        """How many link pairs there are."""
        return len(self._pairs)

    def of(self, local: Floats, chosen: Integers | None = None, wanted: Flags | None = None) -> Floats:
        """Return T_a_b (Q, n, 4, 4) of link pairs.

        Args:
            local: (n, L, 4, 4) link poses in their parents.
            chosen: (Q,) which link pairs, all if None.
            wanted: (Q, n) in which frames, in all if None; what is returned of others means nothing.
        """
        n, pairs = len(local), self._pairs if chosen is None else self._pairs[chosen]
        wanted = np.ones((len(pairs), n), dtype=bool) if wanted is None else wanted
        table, result = np.empty((len(self._ways), n, 4, 4)), np.empty((len(pairs), n, 4, 4))
        needed = np.zeros((len(self._ways), n), dtype=bool)
        local = np.ascontiguousarray(local)
        _relative(local, self._ways, pairs, needed, wanted, table, _IDENTITY, _IDENTITY.copy(), result)
        return result


def _rows(wanted: Integers, keys: Integers, order: Integers) -> Integers:
    """Return the row of each wanted key in `keys`, which `order` sorts; -1 stays."""
    if len(keys) == 0:
        return wanted
    found: Integers = order[np.searchsorted(keys[order], np.maximum(wanted, keys.min()))]
    return np.where(wanted < 0, -1, found)


@entry(
    float64[:, :, :, ::1],
    int64[:, ::1],
    int64[:, ::1],
    boolean[:, ::1],
    boolean[:, ::1],
    float64[:, :, :, ::1],
    float64[:, ::1],
    float64[:, ::1],
    float64[:, :, :, ::1],
)
@leaf_kernel
def _relative(
    local: Floats,
    ways: Integers,
    pairs: Integers,
    needed: Flags,
    wanted: Flags,
    table: Floats,
    identity: Floats,
    inverse: Floats,
    result: Floats,
) -> None:
    """Fill result (Q, n, 4, 4) where it is wanted (Q, n).

    `needed` (ways, n), all False, `table` (ways, n, 4, 4) and `inverse` (4, 4), an identity at first, are scratch.
    """
    n = local.shape[0]
    for q in range(len(pairs)):
        for side in range(2):
            if pairs[q, side] >= 0:
                for f in range(n):
                    needed[pairs[q, side], f] |= wanted[q, f]
    for k in range(len(ways) - 1, -1, -1):
        if ways[k, 0] >= 0:
            for f in range(n):
                needed[ways[k, 0], f] |= needed[k, f]
    for k in range(len(ways)):
        parent, link = ways[k, 0], ways[k, 1]
        for f in range(n):
            if needed[k, f]:
                compose(identity if parent < 0 else table[parent, f], local[f, link], table[k, f])
    for q in range(len(pairs)):
        a, b = pairs[q, 0], pairs[q, 1]
        for f in range(n):
            if not wanted[q, f]:
                continue
            up = identity if a < 0 else table[a, f]
            for i in range(3):
                for j in range(3):
                    inverse[i, j] = up[j, i]
                inverse[i, 3] = -(up[0, i] * up[0, 3] + up[1, i] * up[1, 3] + up[2, i] * up[2, 3])
            compose(inverse, identity if b < 0 else table[b, f], result[q, f])
