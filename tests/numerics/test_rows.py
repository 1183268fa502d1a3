"""Distinct rows are those of numpy.unique."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from replay.numerics import rows
from replay.numerics.rows import distinct_rows

VALUES = st.one_of(st.sampled_from([0.0, -0.0, 1.0, -1.0, np.inf, -np.inf]), st.floats(allow_nan=False))


@given(
    arrays.arrays(np.float64, st.tuples(st.integers(0, 40), st.integers(1, 4)), elements=VALUES)
    | arrays.arrays(np.int64, st.tuples(st.integers(0, 40), st.just(3)), elements=st.integers(-2, 2))
)
def test_rows_are_those_of_numpy(table):
    expected, first, kind = np.unique(table, axis=0, return_index=True, return_inverse=True)
    found = distinct_rows(table)
    assert np.array_equal(found.rows, expected) and found.rows.dtype == table.dtype
    assert np.array_equal(found.first, first)
    assert np.array_equal(found.kind, kind.reshape(-1))
    assert np.array_equal(table[found.first].view(np.int64), found.rows.view(np.int64)), "the first one stays"


@pytest.mark.parametrize("spread", [rows._ODD, np.uint64(0)], ids=["hashed", "all hashes meet"])
@pytest.mark.parametrize("dtype", [np.float64, np.int64, np.float32])
def test_large_tables_are_sorted_by_a_hash(spread, dtype, monkeypatch):
    monkeypatch.setattr(rows, "_ODD", spread)
    rng = np.random.default_rng(3)
    table = rng.integers(-6, 7, size=(5000, 3)).astype(dtype)
    table[::7] *= -1  # -0.0 among the floats
    found, first, kind = np.unique(table, axis=0, return_index=True, return_inverse=True)
    mine = distinct_rows(table)
    assert np.array_equal(mine.rows, found) and mine.rows.dtype == dtype
    assert np.array_equal(mine.first, first) and np.array_equal(mine.kind, kind.reshape(-1))
    again = distinct_rows(mine.rows)
    assert np.array_equal(again.rows, found) and np.array_equal(again.kind, np.arange(len(found)))


@pytest.mark.parametrize("count", [0, 1])
def test_few_rows(count):
    found = distinct_rows(np.zeros((count, 3)))
    assert (found.rows.shape, found.first.shape, found.kind.shape) == ((count, 3), (count,), (count,))
