"""Scalar products of rows, summed in one order on every machine."""

from __future__ import annotations

import numpy as np
from numba import float64

from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel


@entry(float64[:, ::1], float64[:, ::1])
@kernel
def products(first: Floats, second: Floats) -> Floats:
    """Return the scalar products (k, m) of rows (k, n) with rows (m, n)."""
    result = np.zeros((len(first), len(second)))
    for i in range(len(first)):
        for j in range(len(second)):
            total = 0.0
            for k in range(first.shape[1]):
                total += first[i, k] * second[j, k]
            result[i, j] = total
    return result
