"""Many parts side by side: what is found of them is computed in loops that a compiler turns into vector instructions.

`lanes` is one flat array of columns, LANES numbers each: row i of column k is at k LANES + i. A loop over i without
branches, whose columns are at constant places of one array, is vectorised; every lane rounds as a scalar would, so that
results do not depend on the processor's vectors.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.numerics.arrays import Floats, Integers
from replay.numerics.gather import transpose_four
from replay.numerics.jit import inlined_kernel
from replay.numerics.triples import Triple
from replay.sensing.capacitive.placed_plate import Pose, place_corner
from replay.sensing.capacitive.tree.registers import CORNERS, LANES

Rows = NDArray[np.floating[Any]]


@inlined_kernel
def padded(count: int) -> int:
    """Return a number of lanes >= count that vectors fill; what is in the lanes beyond count is of no use."""
    return (count + 7) & -8


@inlined_kernel
def load(rows: Rows, columns: int, which: Integers, count: int, lanes: Floats, at: int) -> None:
    """Write the first columns, in fours, of the rows which[:count] to the lanes, from column `at` on.

    `which` is filled up with its last one, to a multiple of four.
    """
    for i in range(count, (count + 3) & -4):
        which[i] = which[count - 1]
    for first in range(0, count, 4):
        for column in range(0, columns, 4):
            transpose_four(rows, which, first, column, lanes, (at + column) * LANES + first, LANES)


@inlined_kernel
def corner_in_lanes(T: Pose, rounding: float, lanes: Floats, corner: int, i: int) -> Triple:
    """Return a corner of the triangle in lane i, in the plate's frame."""
    at = CORNERS + 3 * corner
    return place_corner(T, rounding, lanes[at * LANES + i], lanes[(at + 1) * LANES + i], lanes[(at + 2) * LANES + i])
