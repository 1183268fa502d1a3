"""The parts of a sum by their error per effort, worst first: a queue of buckets, half an octave each; and the memory.

A part is a tree node or a triangle whose share is known within an error. Parts live in slots. A slot's row of `values`
holds what was found of its part (see `lanes`), its row of `labels` what it is. The last that came into a bucket leaves
it first, so that results repeat.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import inlined_kernel, record_like
from replay.sensing.capacitive.tree.registers import (
    COLUMNS,
    ERROR,
    FOUND,
    FREE,
    LABELS,
    LANES,
    LEAST,
    NEXT,
    PART,
    RULE,
    RULES,
    VALUES,
)

_NONE = -1
_USED, _HIGHEST, _UNUSED = range(3)
BUCKETS = 256
_BUCKET_OF_ONE = 240
_SHIFT = 51
"""A positive double shifted right by so many bits is its exponent and the first bit of its fraction."""

_ONE = int(np.float64(1.0).view(np.int64)) >> _SHIFT


class Queue(NamedTuple):
    """Room for the parts of one sum."""

    values: Floats  # (capacity, 4) ERROR, SHIFT, LEAST and REGION, see `lanes`
    labels: Integers  # (capacity, 3) PART, RULE and NEXT
    heads: Integers  # (256,) first slot of each bucket, or -1
    state: Integers  # (3,) slots ever used, a bucket above which all are empty, first free slot or -1


def new_queue(capacity: int) -> Queue:
    """Return room for so many parts, not yet `empty`."""
    return Queue(
        np.empty((capacity, VALUES)),
        np.empty((capacity, LABELS), np.int64),
        np.empty(BUCKETS, np.int64),
        np.empty(3, np.int64),
    )


@inlined_kernel
def empty(queue: Queue) -> None:
    """Take out all parts."""
    queue.heads[:] = _NONE
    queue.state[_USED], queue.state[_HIGHEST], queue.state[_UNUSED] = 0, 0, _NONE


@inlined_kernel
def slots_used(queue: Queue) -> int:
    """Return how many slots there are to look through for parts; FREE ones hold none."""
    return queue.state[_USED]  # type: ignore[no-any-return]


@inlined_kernel
def push(queue: Queue, part: int, rule: int, lanes: Floats, i: int, urgency: float) -> None:
    """Add a part, found in lane i; urgency >= 0 is its error per effort, in units in which it is 1 at most."""
    slot = queue.state[_UNUSED]
    if slot == _NONE:
        slot = queue.state[_USED]
        queue.state[_USED] = slot + 1
    else:
        queue.state[_UNUSED] = queue.labels[slot, NEXT]
    halves = int(np.float64(urgency).view(np.int64)) >> _SHIFT
    bucket = min(max(_BUCKET_OF_ONE + halves - _ONE, 0), BUCKETS - 1)
    queue.labels[slot, PART], queue.labels[slot, RULE], queue.labels[slot, NEXT] = part, rule, queue.heads[bucket]
    queue.heads[bucket] = slot
    queue.state[_HIGHEST] = max(queue.state[_HIGHEST], bucket)
    at = np.uint64(slot)
    queue.values[at, np.uint64(0)] = lanes[np.uint64(FOUND * LANES + i)]
    queue.values[at, np.uint64(1)] = lanes[np.uint64((FOUND + 1) * LANES + i)]
    queue.values[at, np.uint64(2)] = lanes[np.uint64((FOUND + 2) * LANES + i)]
    queue.values[at, np.uint64(3)] = lanes[np.uint64((FOUND + 3) * LANES + i)]


@inlined_kernel
def pop(queue: Queue) -> int:
    """Take out a part of the highest bucket; return its slot, which is overwritten by the next push, or -1."""
    bucket = queue.state[_HIGHEST]
    while bucket > 0 and queue.heads[bucket] == _NONE:
        bucket -= 1
    queue.state[_HIGHEST] = bucket
    slot = queue.heads[bucket]
    if slot != _NONE:
        queue.heads[bucket] = queue.labels[slot, NEXT]
        queue.labels[slot, NEXT] = queue.state[_UNUSED]
        queue.state[_UNUSED] = slot
    return slot  # type: ignore[no-any-return]


@inlined_kernel
def doubt_and_least(queue: Queue, least: float) -> tuple[float, float]:
    """Return the sum of the parts' error bounds, and of their lower bounds and `least` [m]."""
    doubt = 0.0
    for slot in range(slots_used(queue)):
        if queue.labels[slot, RULE] != FREE:
            doubt += queue.values[slot, ERROR]
            least += queue.values[slot, LEAST]
    return doubt, least


class Room(NamedTuple):
    """Memory for the sum over n triangles."""

    queue: Queue
    stack: Integers  # (n + LANES,) nodes to judge
    across: Integers  # (n + LANES,) nodes that may be across z = 0
    tasks: Integers  # (n,) triangles to judge
    firsts: Integers  # (n,) the first rule to try on each
    hard: Integers  # (n,) triangles without a rule
    lists: Integers  # (RULES + 1, >= n) slots of the queue by rule; the last row counts them
    batch: Integers  # (LANES,) what the lanes are about
    keepers: Integers  # (LANES,) lanes of nodes that become parts
    openers: Integers  # (LANES,) nodes to open, or their lanes
    lanes: Floats  # (COLUMNS x LANES,)


def new_room(n: int) -> Room:
    """Return the memory for a sum over n triangles."""
    return Room(
        new_queue(n),
        np.empty(n + LANES, np.int64),
        np.empty(n + LANES, np.int64),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty(n, np.int64),
        np.empty((RULES + 1, max(n, RULES)), np.int64),
        np.empty(LANES, np.int64),
        np.empty(LANES, np.int64),
        np.empty(LANES, np.int64),
        np.zeros(COLUMNS * LANES),
    )


ROOM_TYPE = record_like(new_room(1))
