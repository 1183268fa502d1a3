"""A batch of pairs in all frames of a block: what is asked of the broad and the narrow phase, and what they answer."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import boolean, float64, int64, uint8

from replay.numerics.arrays import Bytes, Flags, Floats, Integers
from replay.numerics.jit import record

SKIP, RUN, REPEAT = 0, 1, 2
"""What the narrow phase has to do for a pair in a frame: nothing, look, or copy the frame before."""


class PairFrames(NamedTuple):
    """P pairs in n frames, as kernels take them.

    Attributes:
        pairs: (P, 4): body a, body b, row of `poses`, row of `turns`.
        poses: (Q, n, 4, 4) T_a_b of the links of the pairs.
        turns: (L, n, 3, 3) rotations of links in world, read for boxes along the world's axes only.
        task: (n, P) SKIP, RUN or REPEAT; written by the broad phase.
        level: (n, P) 0 clear, 1 bounds, written by the broad phase; 2 contact, by the narrow phase.
        clearance: (n, P) [m]; NaN where the narrow phase found none within the limit or was not asked.
        undecided: (n, P).
    """

    pairs: Integers
    poses: Floats
    turns: Floats
    task: Bytes
    level: Bytes
    clearance: Floats
    undecided: Flags


PAIR_FRAMES_TYPE = record(
    PairFrames,
    int64[:, ::1],
    float64[:, :, :, ::1],
    float64[:, :, :, ::1],
    uint8[:, ::1],
    uint8[:, ::1],
    float64[:, ::1],
    boolean[:, ::1],
)


def unanswered(pairs: Integers, poses: Floats, turns: Floats) -> PairFrames:
    """Return pairs in the frames of their poses, clear and without clearances as yet."""
    shape = poses.shape[1], len(pairs)
    return PairFrames(
        pairs=pairs,
        poses=poses,
        turns=turns,
        task=np.zeros(shape, dtype=np.uint8),
        level=np.zeros(shape, dtype=np.uint8),
        clearance=np.full(shape, np.nan),
        undecided=np.zeros(shape, dtype=bool),
    )
