"""All that reaches into numba: kernels are lowered one by one, and optimised in those alone that Python calls.

numba makes of every function that it compiles a module that is optimised, turned into machine code, given two wrappers
for callers outside, and kept in a file; then it takes the module into each caller and does all of it again. Of these
kernels few are ever called from outside. Here a function that a kernel calls ends as LLVM code (`KernelLibrary`). When
Python calls a kernel, the code of all that it reaches is linked into one module, which gets the one wrapper it needs,
is optimised as a whole, and is kept under the kernel's key (`reach`, `store`). The arithmetic is the same: with this
package's policy LLVM reorders and contracts nothing.

Besides, while kernels are compiled: Python's garbage collection rests (what it looks through is all in use); constants
among arguments do not make specialisations; and what leads from Python to LLVM does less (`front_end`).

None of this is public in numba, so it holds for the versions it was tried with, `TRIED`. With another version, or when
a name that it needs is gone, `AVAILABLE` is false and kernels are compiled by numba's public decorator: the same
numbers, only slower, which is said. What else is not public stands below, `UNCOUNTED` and what follows it, and is left
out where numba has it no more. When a version is added: run the tests, `replay bench start` and `replay bench --quick`.
"""

from __future__ import annotations

import contextlib
import gc
import os
import pickle
from collections.abc import Iterator
from typing import Any

import numba
from numba import config, types
from numba.core import event

from replay.numerics.jit import front_end, linking, progress, records, store
from replay.numerics.jit.linking import KernelLibrary
from replay.numerics.jit.reach import key_of, name_of, reached

TRIED = ("0.68.",)
"""Beginnings of the versions of numba whose inner side is known."""

_NEEDED: tuple[tuple[Any, tuple[str, ...]], ...] = ()
try:
    from numba.core import serialize, sigutils, typing
    from numba.core.compiler import CompileResult
    from numba.core.compiler_lock import global_compiler_lock
    from numba.core.options import DefaultOptions
    from numba.core.registry import CPUDispatcher, cpu_target
    from numba.core.runtime import rtsys

    _NEEDED = (
        (CPUDispatcher, ("compile", "add_overload", "get_call_template", "get_overload")),
        (CompileResult, ("_reduce", "_rebuild", "_replace")),
        (serialize, ("dumps",)),
        (sigutils, ("normalize_signature",)),
    )
except ImportError:  # another numba: see the module's text
    CPUDispatcher: Any = object  # type: ignore[no-redef]
    DefaultOptions: Any = object  # type: ignore[no-redef]

AVAILABLE = (
    numba.__version__.startswith(TRIED)
    and bool(_NEEDED and front_end.NEEDED and linking.NEEDED and records.NEEDED)
    and all(
        hasattr(place, name)
        for place, names in (*_NEEDED, *front_end.NEEDED, *linking.NEEDED, *records.NEEDED)
        for name in names
    )
)
"""Whether this numba is one whose inner side is known."""


_COUNTS = hasattr(DefaultOptions, "_nrt")
COUNTED: dict[str, Any] = {"_nrt": True} if _COUNTS else {}
UNCOUNTED: dict[str, Any] = {"_nrt": False} if _COUNTS else {}
"""The options of compiling with and without reference counting; numba hands the caller's down if none is stated."""

if hasattr(config, "_config_fname"):
    # numba takes settings from a .numba_config.yaml too, if one lies in the folder that a command is called in; what a
    # kernel computes, and whether it is compiled, is none of that folder's business
    _settings: Any = config
    _settings._config_fname = os.devnull
    _settings.reload_config()


class _Forgiving:
    """numba's own cache of a function: what cannot be read in it is compiled again, what cannot be written not kept."""

    def __init__(self, cache: Any) -> None:
        self._cache = cache

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        try:
            return self._cache.load_overload(sig, target_context)
        except Exception:  # whatever unpickling half a file raises
            with contextlib.suppress(OSError):
                self._cache.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        try:
            self._cache.save_overload(sig, data)
        except Exception as error:
            progress.unkept(str(error))

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)


def forgiving(dispatcher: Any) -> Any:
    """Return what numba's public decorator made, with a cache that is no reason to fail."""
    if hasattr(dispatcher, "_cache"):
        dispatcher._cache = _Forgiving(dispatcher._cache)
    return dispatcher


class KernelDispatcher(CPUDispatcher):  # type: ignore[misc]
    """A kernel: `overloads` are compiled for Python to call, `_lowered` for kernels to take in."""

    def __init__(self, py_func: Any, locals: Any = None, targetoptions: Any = None, **options: Any) -> None:
        pipeline = front_end.KernelPipeline
        super().__init__(py_func, locals, targetoptions, pipeline_class=pipeline, **options)
        self._lowered: dict[Any, Any] = {}

    def compile(self, sig: Any) -> Any:
        """Return what Python calls for arguments of the given types, compiling it if nobody has."""
        arguments = tuple(sigutils.normalize_signature(sig)[0])
        with global_compiler_lock:
            if arguments in self.overloads:
                return self.overloads[arguments].entry_point
            name, key = name_of(self, arguments), key_of(self, arguments)
            result = self._kept(name, key)
            if result is None:
                with store.claim(name, key):  # another process may compile it: then it is there after the wait
                    result = self._kept(name, key) or self._compiled(arguments, name, key)
            self.add_overload(result)
            return result.entry_point

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """Return how a kernel calls this one; constants count as numbers like others."""
        pysig, folded = self._compiler.fold_argument_types(args, kws)
        arguments = tuple(types.unliteral(argument) for argument in folded)
        details = {"dispatcher": self, "args": arguments, "return_type": None}
        with global_compiler_lock, _lowering():
            if arguments not in self._lowered:
                with event.trigger_event("numba:compile", data=details):
                    self._lower(arguments)
            result = self._lowered[arguments]
        template = typing.make_concrete_template(self.py_func.__name__, self.py_func.__name__, [result.signature])
        return template, pysig, arguments, {}

    def get_overload(self, sig: Any) -> Any:
        """Return what stands for the kernel in one that calls it."""
        return self._lowered[tuple(sigutils.normalize_signature(sig)[0])].entry_point

    def _kept(self, name: str, key: str) -> Any:
        """Return the kernel from its file, or None."""
        payload = store.load(name, key)
        if payload is None:
            return None
        rtsys.initialize(self.targetctx)  # code needs no more; numba refreshes all that compiling needs: half a second
        try:
            result = CompileResult._rebuild(self.targetctx, *pickle.loads(payload))
        except Exception:  # whole, and yet of no use: compiling it again mends it
            store.discard(name, key)
            return None
        self._cache_hits[tuple(result.signature.args)] += 1
        return result

    def _compiled(self, arguments: tuple[Any, ...], name: str, key: str) -> Any:
        """Compile the kernel and keep it."""
        counted = progress.counted()
        counted.begin(len(reached(self)))
        details = {"dispatcher": self, "args": arguments, "return_type": None}
        try:
            with event.trigger_event("numba:compile", data=details), _lowering():
                result = self._wrapped(self._lower(arguments))
            store.save(name, key, serialize.dumps(result._reduce()))
        finally:
            counted.end()
        self._cache_misses[arguments] += 1
        return result

    def _wrapped(self, lowered: Any) -> Any:
        """Return what was lowered as machine code that Python can call."""
        context, described = lowered.target_context, lowered.fndesc
        library = context.codegen().create_library(described.qualname)
        library.environment = described.env_name
        library.enable_object_caching()
        with context.push_code_library(library):
            context.create_cpython_wrapper(
                library, described, lowered.environment, lowered.call_helper, release_gil=True
            )
        library.add_linking_library(lowered.library)
        library.finalize()
        library.emit()
        entry = context.get_executable(library, described, lowered.environment)
        return lowered._replace(library=library, entry_point=entry, type_annotation="")

    def _lower(self, arguments: tuple[Any, ...]) -> Any:
        if arguments not in self._lowered:
            with self._compiling_counter:
                self._lowered[arguments] = self._compiler.compile(arguments, None)
        return self._lowered[arguments]


@contextlib.contextmanager
def _lowering() -> Iterator[None]:
    """Let numba make `KernelLibrary` of what it compiles; under its lock, so nothing of another thread is meant."""
    codegen: Any = cpu_target.target_context.codegen()
    if "_library_class" in vars(codegen):  # within another
        yield
        return
    cpu_target.target_context.refresh()  # numba's own runtime is a library too, and no kernel
    collecting = gc.isenabled()
    gc.disable()
    codegen._library_class = KernelLibrary
    codegen.set_env = lambda name, environment: None  # until it is emitted it has no place for one
    try:
        with front_end.known_operators():
            yield
    finally:
        del codegen._library_class, codegen.set_env
        if collecting:
            gc.enable()


if AVAILABLE:
    front_end.compare_options_quickly()
