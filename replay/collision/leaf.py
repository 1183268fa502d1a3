"""Kernels that only read and write arrays they are given.

numba counts references to every array that a compiled function is passed, with atomic operations, even where nothing
is kept: 5 ns each, 45 of the 50 ns of a support query of a box. A function that allocates nothing needs no counting:
its caller holds the arrays.
"""

from __future__ import annotations

from replay.numerics.jit import Function, kernel


def leaf(function: Function) -> Function:
    """Compile as `kernel` does, without reference counting; a function that would allocate fails to compile."""
    dispatcher = kernel(function)
    getattr(dispatcher, "targetoptions", {})["_nrt"] = (
        False  # absent when NUMBA_DISABLE_JIT leaves the function as it is
    )
    return dispatcher
