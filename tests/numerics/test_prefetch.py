"""Asking for memory ahead: it reaches the processor, and changes nothing."""

import numpy as np
import pytest
from numba import njit
from numba.core import config

from replay.numerics.prefetch import prefetch


@njit  # not a kernel of ours: these are kept on disk, and what is read from there cannot be inspected
def _total(rows, order):
    total = 0.0
    for row in order:
        prefetch(rows, row, 1)
        total += rows[row, 1]
    return total


@pytest.mark.parametrize("kind", [np.float64, np.float32, np.int64])
def test_a_sum_is_the_same(kind):
    rows = np.arange(12).reshape(4, 3).astype(kind)
    assert _total(rows, np.array([3, 0, 2])) == 10.0 + 1.0 + 7.0
    assert config.DISABLE_JIT or "prefetch" in _total.inspect_asm(_total.signatures[-1])
