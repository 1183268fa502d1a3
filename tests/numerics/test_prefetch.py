"""Asking for memory ahead: it reaches the processor, and changes nothing."""

import numpy as np
import pytest
from numba.core import config

from replay.numerics.jit import leaf_kernel
from replay.numerics.prefetch import prefetch


@leaf_kernel
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
