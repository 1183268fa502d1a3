"""What the decorators promise: the same results whichever way kernels are compiled."""

import numba
import numpy as np
import pytest

from replay.numerics import jit
from replay.numerics.jit import compiler


def total(rows):
    result = 0.0
    for row in rows:
        result += row[0] / row[1]
    return result


@pytest.mark.compiled
def test_leaf_kernels_compute_what_kernels_do_with_or_without_the_option(monkeypatch):
    rows = np.random.default_rng(1).normal(size=(50, 2))
    expected = jit.kernel(total)(rows)
    leaf = jit.leaf_kernel(total)
    assert leaf.targetoptions["_nrt"] is False
    assert leaf(rows) == expected
    monkeypatch.setattr(compiler, "UNCOUNTED", {})
    usual = jit.leaf_kernel(total)
    assert "_nrt" not in usual.targetoptions
    assert usual(rows) == expected


@pytest.mark.compiled
def test_a_leaf_kernel_that_allocates_fails_to_compile():
    @jit.leaf_kernel
    def allocates(n):
        return np.zeros(n).sum()

    with pytest.raises(numba.core.errors.NumbaError):
        allocates(3)


@pytest.mark.compiled
def test_a_leaf_kernel_may_be_the_first_to_call_one_that_allocates():
    # numba hands the caller's way of counting down, to what states none: it would compile or not by what ran before
    @jit.kernel
    def allocates(n):
        return np.zeros(n).sum() + n

    @jit.leaf_kernel
    def leaf(n):
        return allocates(n) + 1.0

    assert leaf(3) == 4.0


def test_without_a_compiler_kernels_are_the_functions_themselves(package):
    code = "print(outer(1.0), type(outer).__name__)"
    assert package.run(code, NUMBA_DISABLE_JIT="1") == "20.0 function"
