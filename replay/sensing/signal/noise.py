"""Random numbers by their place: those of a sample depend on seed, sensor and number of the sample alone.

A counter-based generator (Philox 4x64) turns a key and a counter into four words, so that blocks, workers and the order
of computing do not matter. The key is a hash of seed, kind and name; the counter is the number of the sample.
"""

from __future__ import annotations

import hashlib
import math

import numpy as np
from numpy.random import Philox

from replay.numerics.arrays import Floats

_UNIT = 2.0**-53


def noise_key(seed: int, kind: str, name: str) -> int:
    """Return the key (128 bits) of a sensor's random numbers."""
    return int.from_bytes(hashlib.sha256(f"{seed}/{kind}/{name}".encode()).digest()[:16], "little")


def random_numbers(key: int, first: int, count: int) -> tuple[Floats, Floats]:
    """Return a normal and a uniform number for each of some samples.

    Args:
        key: see `noise_key`.
        first, count: samples first..first+count-1, first >= 0.

    Returns:
        (count,) of mean 0 and standard deviation 1, and (count,) in [0, 1), independent of each other.

    Source: Salmon et al. 2011 (Philox); Box and Muller 1958, one of the two numbers.
    """
    words = Philox(key=key, counter=first).random_raw(4 * count).reshape(count, 4) >> np.uint64(11)
    radius, turn, uniform = ((words[:, k].astype(np.float64)) * _UNIT for k in range(3))
    # math's functions: the same last digits whatever vector instructions a processor has
    normal = [
        math.sqrt(-2.0 * math.log(1.0 - u)) * math.cos(2.0 * math.pi * v)
        for u, v in zip(radius.tolist(), turn.tolist(), strict=True)
    ]
    return np.array(normal, dtype=np.float64), uniform
