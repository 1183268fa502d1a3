"""Distinct rows are those of numpy.unique."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from replay.numerics.rows import distinct_rows

VALUES = st.one_of(st.sampled_from([0.0, -0.0, 1.0, -1.0, np.inf, -np.inf]), st.floats(allow_nan=False))


@given(
    arrays.arrays(np.float64, st.tuples(st.integers(0, 40), st.integers(1, 4)), elements=VALUES)
    | arrays.arrays(np.int64, st.tuples(st.integers(0, 40), st.just(3)), elements=st.integers(-2, 2))
)
def test_rows_are_those_of_numpy(table):
    rows, first, kind = np.unique(table, axis=0, return_index=True, return_inverse=True)
    found = distinct_rows(table)
    assert np.array_equal(found.rows, rows) and found.rows.dtype == table.dtype
    assert np.array_equal(found.first, first)
    assert np.array_equal(found.kind, kind.reshape(-1))
    assert np.array_equal(table[found.first].view(np.int64), found.rows.view(np.int64)), "the first one stays"


@pytest.mark.parametrize("count", [0, 1])
def test_few_rows(count):
    found = distinct_rows(np.zeros((count, 3)))
    assert (found.rows.shape, found.first.shape, found.kind.shape) == ((count, 3), (count,), (count,))
