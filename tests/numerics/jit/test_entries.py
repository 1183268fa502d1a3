"""Entries are compiled ahead with exactly the types that scenarios call them with."""

import numpy as np
import pytest
from numba import float64, int64

from replay.numerics.jit import compile_entries, entries_of, entry, kernel, progress
from replay.numerics.jit.reach import key_of, name_of


@entry(float64[::1], int64)
@kernel
def _pick(row, k):
    return row[k]


@entry(float64[::1])
@kernel
def _sum(row):
    total = 0.0
    for x in row:
        total += x
    return total


@pytest.mark.compiled
def test_entries_are_ready_with_the_types_they_declare(monkeypatch, tmp_path):
    monkeypatch.setattr("replay.numerics.jit.store.directory", lambda: tmp_path)
    shared = []
    compile_entries([_pick, _sum, _pick], share=lambda: shared.append(1))
    assert shared == [1]
    assert list(_pick.overloads) == [(float64[::1], int64)]
    assert {file.name for file in tmp_path.iterdir()} == {
        f"{name_of(each, each.declared)}-{key_of(each, each.declared)}.kernel" for each in (_pick, _sum)
    }
    assert _pick(np.array([1.0, 2.0]), 1) == 2.0
    assert len(_pick.overloads) == 1
    compile_entries([_pick, _sum], share=lambda: shared.append(2))
    assert shared == [1]


def test_functions_without_a_compiler_need_nothing():
    compile_entries([lambda: None])


def test_entries_of_a_module_are_those_it_declares_itself():
    import replay.collision.narrow as narrow
    import replay.collision.pipeline as pipeline

    assert entries_of(narrow) == (narrow.decide_by_doubles,)  # the others are rare
    assert entries_of(pipeline) == ()


def test_one_batch_is_counted_at_a_time():
    assert progress.counted() is progress.counted()
