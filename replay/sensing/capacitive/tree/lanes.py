"""Many parts side by side: what is found of them is computed in loops that a compiler turns into vector instructions.

`lanes` is one flat array of columns, LANES numbers each: row i of column k is at k LANES + i. A loop over i without
branches, whose columns are at constant places of one array, is vectorised; every lane rounds as a scalar would, so that
results do not depend on the processor's vectors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import inlined_kernel

Floats = NDArray[np.float64]
Rows = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]

LANES = 64
COLUMNS = 52
"""Size of `lanes`: (COLUMNS x LANES,). Its first 40 columns hold a row of `Clusters.outlines`, `triangles` or
`moments`, or of a pool of pieces, in the columns it has there."""

FROM = 16
"""First of nine columns beside a triangle's row: u, v and z [m] of its corners, as a point rule takes the distance."""

FOUND = 40
ERROR, SHIFT, LEAST, REGION = range(4)
"""What is found of a node or triangle, in the columns from FOUND on: the bound of its error [m], what its expansion or
rule is corrected by [m], a lower bound of its integral [m], and the region it is expanded in, see `region_of`."""

VERDICT, RULE_FOUND, FIRST_RULE, ALLOWED = range(44, 48)
"""Columns: the verdict on a node or triangle; a triangle's rule, the first that comes into question, and the error that
it may make [m]."""

SUM = 49
"""Column: the sum over a node or triangle [m]."""

DROP, OPEN, KEEP = -1, 0, 1
"""Verdicts: nothing of it counts; it must be opened; it can be summed as a whole."""


@inlined_kernel
def padded(count: int) -> int:
    """Return a number of lanes >= count that vectors fill; what is in the lanes beyond count is of no use."""
    return (count + 7) & -8


@inlined_kernel
def load(rows: Rows, columns: int, which: Ints, count: int, lanes: Floats, at: int) -> None:
    """Write the first columns, in fours, of the rows which[:count] to the lanes, from column `at` on.

    A loop over columns would become scattered stores, which take longer than single ones.
    """
    for i in range(count):
        # numbers that numba sees to be constants would have it compile `_copy_four` for each
        row = np.uint64(which[i])
        _copy_four(rows, row, np.uint64(0), lanes, at, i)
        if columns > 4:
            _copy_four(rows, row, np.uint64(4), lanes, at, i)
        if columns > 8:
            _copy_four(rows, row, np.uint64(8), lanes, at, i)
            _copy_four(rows, row, np.uint64(12), lanes, at, i)
        if columns > 16:
            _copy_four(rows, row, np.uint64(16), lanes, at, i)
            _copy_four(rows, row, np.uint64(20), lanes, at, i)
            _copy_four(rows, row, np.uint64(24), lanes, at, i)
            _copy_four(rows, row, np.uint64(28), lanes, at, i)
            _copy_four(rows, row, np.uint64(32), lanes, at, i)
            _copy_four(rows, row, np.uint64(36), lanes, at, i)


@inlined_kernel
def _copy_four(rows: Rows, row: np.uint64, column: np.uint64, lanes: Floats, at: int, i: int) -> None:
    # unsigned, as numba looks for indices below 0
    p = np.uint64(at * LANES + i) + column * np.uint64(LANES)
    lanes[p] = rows[row, column]
    lanes[p + np.uint64(LANES)] = rows[row, column + np.uint64(1)]
    lanes[p + np.uint64(2 * LANES)] = rows[row, column + np.uint64(2)]
    lanes[p + np.uint64(3 * LANES)] = rows[row, column + np.uint64(3)]
