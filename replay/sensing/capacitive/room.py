"""The memory that one sum over a tree works in, made once for all poses."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel
from replay.sensing.capacitive.exact import SCRATCH
from replay.sensing.capacitive.lanes import COLUMNS, LANES
from replay.sensing.capacitive.part_queue import RULES, Queue, new_queue
from replay.sensing.capacitive.triangle_pieces import Pieces, new_pieces

Floats = NDArray[np.float64]
Ints = NDArray[np.int64]


class Room(NamedTuple):
    """Memory for the sum over n triangles."""

    queue: Queue
    stack: Ints  # (n + LANES,) nodes to judge
    tasks: Ints  # (n,) triangles to judge
    firsts: Ints  # (n,) the first rule to try on each
    hard: Ints  # (n,) triangles without a rule
    lists: Ints  # (RULES + 1, >= n) slots of the queue by rule; the last row counts them
    batch: Ints  # (LANES,) what the lanes are about
    lanes: Floats  # (COLUMNS x LANES,)
    triangle: Floats  # (3, 3) for the closed form
    scratch: Floats  # SCRATCH, for the closed form
    pieces: Pieces


@kernel
def new_room(n: int) -> Room:
    """Return the memory for a sum over n triangles."""
    return Room(
        new_queue(n),
        np.empty(n + LANES, np.int64),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty((RULES + 1, max(n, RULES)), np.int64),
        np.empty(LANES, np.int64),
        np.zeros(COLUMNS * LANES),
        np.empty((3, 3)),
        np.empty(SCRATCH),
        new_pieces(),
    )
