"""The memory that a sum over a tree works in, made once for all poses; hard triangles have their own, see `Pieces`."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.numerics.jit import kernel
from replay.sensing.capacitive.tree.lanes import COLUMNS, LANES
from replay.sensing.capacitive.tree.part_queue import RULES, Queue, new_queue

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
    )
