"""Named tuples that Python gives to kernels are handed on by address, and hold what they hold."""

import sys
from typing import NamedTuple

import numba
import numpy as np
import pytest
from numba import float64, int64

from replay.numerics.jit import kernel, leaf_kernel, record, record_like
from replay.numerics.jit.reach import type_text


class Inner(NamedTuple):
    values: np.ndarray
    factor: float


class Outer(NamedTuple):
    inner: Inner
    names: np.ndarray
    count: int


OUTER = record(Outer, record(Inner, float64[::1], float64), int64[:, ::1], int64)


def made(n=4, factor=2.0):
    return Outer(Inner(np.arange(float(n)), factor), np.arange(6).reshape(2, 3), n)


@leaf_kernel
def total(outer):
    found = 0.0
    for k in range(outer.count):
        found += outer.inner.factor * outer.inner.values[k]
    return found + outer.names[1, 2]


@leaf_kernel
def halve(inner):
    for k in range(len(inner.values)):
        inner.values[k] *= 0.5


@kernel
def halve_and_add(outer, other):
    halve(outer.inner)
    kept = outer.inner.values
    return total(outer) + total(other), kept


def test_fields_are_those_of_the_tuple_also_of_one_within_another():
    assert total(made()) == 2.0 * (0 + 1 + 2 + 3) + 5
    assert total(made(3, -1.0)) == -3.0 + 5


def test_what_is_written_to_a_record_s_arrays_is_written_to_the_caller_s():
    outer = made()
    found, kept = halve_and_add(outer, outer)  # the same one twice
    assert outer.inner.values.tolist() == [0.0, 0.5, 1.0, 1.5]
    assert found == 2 * total(outer)
    assert kept is outer.inner.values or np.shares_memory(kept, outer.inner.values)


@pytest.mark.compiled
def test_arrays_are_given_back_as_often_as_taken():
    outer = made(4000)
    halve_and_add(outer, made())
    before = sys.getrefcount(outer.inner.values)
    for _ in range(100):
        halve_and_add(outer, made())
    after = sys.getrefcount(outer.inner.values)  # an assertion holds what it looks at
    assert after == before


@pytest.mark.compiled
def test_what_is_declared_is_what_a_call_finds():
    assert numba.typeof(made()) == OUTER == record_like(made())
    assert type_text(OUTER) == type_text(numba.typeof(made(7)))
    assert numba.typeof(Outer(Inner(np.arange(4), 2.0), np.arange(6).reshape(2, 3), 4)) != OUTER
    assert "inner: " in type_text(OUTER)
    assert "factor: float64" in type_text(OUTER)


@pytest.mark.compiled
def test_a_record_is_one_argument_however_much_it_holds(monkeypatch, tmp_path):
    monkeypatch.setattr("replay.numerics.jit.store.directory", lambda: tmp_path)

    @leaf_kernel
    def first(outer):
        return outer.inner.values[0]

    assert first(made()) == 0.0
    (lowered,) = first._lowered.values()
    (function,) = (
        each for each in lowered.library._final_module.functions if each.name == lowered.fndesc.llvm_func_name
    )
    names = [argument.name for argument in function.arguments]
    assert names == ["retptr", "excinfo", "arg.outer"]


@pytest.mark.compiled
def test_a_field_that_is_not_there_is_an_error():
    @kernel
    def wrong(outer):
        return outer.nothing

    with pytest.raises(numba.TypingError, match="nothing"):
        wrong(made())
    with pytest.raises(ValueError, match="zip"):
        record(Inner, float64)
    with pytest.raises(numba.TypingError, match="count"):
        total(Inner(np.zeros(3), 1.0))


@pytest.mark.compiled
def test_numba_s_public_decorator_takes_records_too():
    plain = numba.njit(total.py_func)
    assert plain(made()) == total(made())
