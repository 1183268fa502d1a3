"""Compiled kernels: the one policy, what each is made of, where they are kept, and how they are made ready at once.

`policy` has the decorators, `entries` the kernels that scenarios call (with the types they take), `reach` what a kernel
is made of and so its key, `records` how named tuples are handed on, `store` the files, `compiler` and `linking` all
that reaches into numba, `progress` what the user is told.
"""

from __future__ import annotations

from replay.numerics.jit.entries import compile_entries, entries_of, entry, rare_entry, record, record_like
from replay.numerics.jit.policy import inlined_kernel, kernel, leaf_kernel

__all__ = [
    "compile_entries",
    "entries_of",
    "entry",
    "inlined_kernel",
    "kernel",
    "leaf_kernel",
    "rare_entry",
    "record",
    "record_like",
]
