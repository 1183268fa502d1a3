"""Influences of pairs of nodes that are rigid to each other, kept for the next pose that asks."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import float64, int64

from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import inlined_kernel, leaf_kernel, record
from replay.sensing.electrostatics.nodes import WITHIN, Nodes, node_mean

_SIZE = 1 << 20
_FULL = int(0.7 * _SIZE)
_MIX = np.uint64(0x9E3779B97F4A7C15)
_SHIFT = np.uint64(44)


class KnownInfluences(NamedTuple):
    """A table with open addresses: keys (2^20,), -1 for none, values (2^20,) [1/m], and how many there are."""

    keys: Integers
    values: Floats
    filled: Integers  # (1,)


MEMORY_TYPE = record(KnownInfluences, int64[::1], float64[::1], int64[::1])


def make_memory() -> KnownInfluences:
    """Return a memory that holds nothing."""
    return KnownInfluences(np.full(_SIZE, -1), np.zeros(_SIZE), np.zeros(1, np.int64))


@inlined_kernel
def _place(memory: KnownInfluences, key: int) -> int:
    """Return where a key is, or would be."""
    at = np.int64((np.uint64(key) * _MIX) >> _SHIFT)
    while memory.keys[at] != -1 and memory.keys[at] != key:
        at = (at + 1) & (_SIZE - 1)
    return int(at)


@leaf_kernel
def _before(nodes: Nodes, i: int, j: int) -> bool:
    """Return an order of two nodes that their places decide."""
    if nodes.panels.diameter[i] != nodes.panels.diameter[j]:
        return bool(nodes.panels.diameter[i] < nodes.panels.diameter[j])
    for axis in range(3):
        if nodes.panels.centroid[i, axis] != nodes.panels.centroid[j, axis]:
            return bool(nodes.panels.centroid[i, axis] < nodes.panels.centroid[j, axis])
    return i < j


@inlined_kernel
def recalled(memory: KnownInfluences, i: int, j: int) -> float:
    """Return the mean of 1/r over two nodes of one body; 0 if it is not known."""
    key = (min(i, j) << 24) | max(i, j)
    at = _place(memory, key)
    return float(memory.values[at]) if memory.keys[at] == key else 0.0


@leaf_kernel
def remembered(memory: KnownInfluences, nodes: Nodes, i: int, j: int, stack: Integers, shares: Floats) -> float:
    """Return the mean of 1/r over two nodes of one body; once the memory is full, what is new is computed each time."""
    key = (min(i, j) << 24) | max(i, j)
    at = _place(memory, key)
    if memory.keys[at] == key:
        return float(memory.values[at])
    # numbers of halves tell in which order they were made; the value must not
    first, second = (i, j) if _before(nodes, i, j) else (j, i)
    value = node_mean(nodes, first, nodes, second, WITHIN, stack, shares)
    if memory.filled[0] < _FULL:
        memory.keys[at], memory.values[at] = key, value
        memory.filled[0] += 1
    return value
