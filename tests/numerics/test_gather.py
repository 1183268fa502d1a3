"""Rows that are gathered into columns are what indexing gives, in single precision too."""

import numpy as np
import pytest

from replay.numerics.gather import transpose_four
from replay.numerics.jit import kernel


@kernel
def _gathered(rows, which, column, columns):
    for first in range(0, len(which), 4):
        transpose_four(rows, which, first, column, columns, 3 + first, 2 * len(which))


@pytest.mark.parametrize("kind", [np.float64, np.float32])
def test_four_rows_become_columns(kind):
    rng = np.random.default_rng(2)
    rows = rng.normal(size=(50, 9)).astype(kind)
    which = rng.integers(50, size=8)
    columns = np.full(4 * 16 + 3, np.nan)
    _gathered(rows, which, 5, columns)
    expected = np.full_like(columns, np.nan)
    for k in range(4):
        expected[3 + 16 * k : 11 + 16 * k] = rows[which, 5 + k]
    np.testing.assert_array_equal(columns, expected)
