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
from replay.sensing.capacitive.placed_plate import Triple, place_corner
from replay.sensing.capacitive.tree.registers import CORNERS, LANES

Floats = NDArray[np.float64]
Rows = NDArray[np.floating[Any]]
Ints = NDArray[np.int64]


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


@inlined_kernel
def corner_in_lanes(T: Floats, rounding: float, lanes: Floats, corner: int, i: int) -> Triple:
    """Return a corner of the triangle in lane i, in the plate's frame."""
    at = CORNERS + 3 * corner
    return place_corner(T, rounding, lanes[at * LANES + i], lanes[(at + 1) * LANES + i], lanes[(at + 2) * LANES + i])
