"""The one jit policy, as decorators."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
from numba import config

from replay.numerics.jit import compiler, store
from replay.numerics.jit.plain import plain

Function = TypeVar("Function", bound=Callable[..., Any])

# forceinline is stated, because numba hands it down: whatever an inlined kernel calls would be inlined too, thrice a
# double-double search of thousands of instructions
_OPTIONS: dict[str, Any] = {"nogil": True, "fastmath": False, "error_model": "numpy", "forceinline": False}

_settings: Any = config  # numba fills this module at run time


def kernel(function: Function) -> Function:
    """Compile a function under the package's one jit policy.

    Kept in a file (see `store`), releases the GIL, one thread (results do not depend on the core count), no fast-math
    and no contraction (every operation rounds as IEEE 754 says), and division by zero gives inf or NaN as in NumPy:
    kernels decide by comparison before they divide.
    """
    return cast(Function, _compiled(function, compiler.COUNTED))


def leaf_kernel(function: Function) -> Function:
    """Compile as `kernel` does, without reference counting: for kernels that only use arrays they are given.

    numba counts references to every array that a compiled function is passed or slices, with atomic operations, even
    where nothing is kept: 5 ns each, 45 of the 50 ns of a support query of a box. A function that allocates nothing
    needs no counting, since its caller holds the arrays; one that would allocate fails to compile. Nor may it return an
    array: the caller would give back a reference that nobody took. The results are the same. numba has no public option
    for this: should its internal one disappear, the function is compiled as usual.
    """
    return cast(Function, _compiled(function, compiler.UNCOUNTED))


def inlined_kernel(function: Function) -> Function:
    """Compile as `leaf_kernel` does, into the body of every caller: for what is small, or takes many arrays.

    A call passes each field of each array by itself: for two bodies of GJK that is 200 words, 35 of the 70 ns of a
    query that needs one step. The results are the same.
    """
    options = {"forceinline": True, **compiler.UNCOUNTED}
    return cast(Function, _compiled(function, options))


def _compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    if _settings.DISABLE_JIT:
        return plain(function)
    if compiler.AVAILABLE:
        wanted = {"nopython": True, "boundscheck": None, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        return compiler.KernelDispatcher(function, targetoptions={**wanted, **_OPTIONS, **options})
    folder, previous = _numbas_own_cache(), _settings.CACHE_DIR
    if folder is not None:
        _settings.CACHE_DIR = str(folder)
    try:
        return compiler.forgiving(numba.njit(cache=folder is not None, **{**_OPTIONS, **options})(function))
    finally:
        _settings.CACHE_DIR = previous


@lru_cache(maxsize=1)
def _numbas_own_cache() -> Path | None:
    """Return a folder for numba's own cache: it looks at one file only, so the folder is named by all sources."""
    folder = store.directory()
    if folder is None:
        return None
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parents[2]
    for source in sorted(package.rglob("*.py")):
        digest.update(source.relative_to(package).as_posix().encode() + b"\0" + source.read_bytes())
    return folder / f"plain-{digest.hexdigest()[:20]}"
