"""What the decorators promise: the same results whichever way kernels are compiled."""

import importlib
import pkgutil

import numba
import numpy as np
import pytest
from numba.core.registry import CPUDispatcher

from replay.numerics import jit
from replay.numerics.jit import compiler

KERNEL_ROOMS = ("numerics", "geometry", "kinematics", "collision", "sensing")


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
def test_leaf_kernels_call_leaf_kernels_only():
    # What a leaf kernel calls is compiled without reference counting too, if it is the first to call it: something that
    # allocates would compile or not depending on what ran before.
    leaves = []
    for room in KERNEL_ROOMS:
        package = importlib.import_module(f"replay.{room}")
        for found in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            for value in vars(importlib.import_module(found.name)).values():
                if isinstance(value, CPUDispatcher) and value.targetoptions.get("_nrt") is False:
                    leaves.append(value.py_func)
    assert len(leaves) > 50
    for leaf in leaves:
        called = (leaf.__globals__.get(name) for name in leaf.__code__.co_names)
        for callee in called:
            if isinstance(callee, CPUDispatcher):
                assert callee.targetoptions.get("_nrt") is False, f"{leaf.__module__}.{leaf.__name__}: {callee}"


def test_without_a_compiler_kernels_are_the_functions_themselves(package):
    code = "print(outer(1.0), type(outer).__name__)"
    assert package.run(code, NUMBA_DISABLE_JIT="1") == "20.0 function"
