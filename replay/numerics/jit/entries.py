"""Kernels that scenarios call: with the types they take declared, they can be compiled before anything calls them.

`compile_entries` makes a list of them ready, and leaves to another process what that one is compiling: so any number of
processes that call it share the work. Each takes what has least in common with what others have taken: kernels that
call the same ones go to one process, which looks into these once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cached_property
from types import ModuleType
from typing import Any, TypeVar

import numba
from numba import typeof, types

from replay.numerics.jit import compiler, progress, records, store
from replay.numerics.jit.reach import key_of, name_of, reached
from replay.numerics.remarks import remark

Function = TypeVar("Function", bound=Callable[..., Any])


def record(named_tuple: Any, *fields: Any) -> Any:
    """Return the numba type of a named tuple that Python gives to kernels, given those of its fields in order."""
    if compiler.AVAILABLE:
        records.are_records(named_tuple)
        return records.Record(named_tuple, fields)
    if len({*fields}) == 1:
        return types.NamedUniTuple(fields[0], len(fields), named_tuple)
    return types.NamedTuple(fields, named_tuple)


def record_like(made: Any) -> Any:
    """Return the numba type of named tuples like one that was made, with those it holds."""
    return record(type(made), *(record_like(field) if isinstance(field, tuple) else typeof(field) for field in made))


def entry(*arguments: Any) -> Callable[[Function], Function]:
    """Declare the numba types of what scenarios call a kernel with; stands above the kernel's own decorator."""

    def declared(kernel: Function) -> Function:
        kernel.declared = arguments  # type: ignore[attr-defined]
        return kernel

    return declared


def rare_entry(*arguments: Any) -> Callable[[Function], Function]:
    """Declare a kernel that few scenarios call, and that takes long to compile: when it is called first, not before."""

    def declared(kernel: Function) -> Function:
        kernel.declared, kernel.rare = arguments, True  # type: ignore[attr-defined]
        return kernel

    return declared


def entries_of(*modules: ModuleType) -> tuple[Any, ...]:
    """Return the kernels that modules declare as entries, but for rare ones, in the order in which they stand there."""
    return tuple(
        value
        for module in modules
        for value in vars(module).values()
        if hasattr(value, "declared") and not hasattr(value, "rare") and value.__module__ == module.__name__
    )


@dataclass(frozen=True)
class _Entry:
    """A kernel and its declared arguments, with what takes a moment to find out."""

    kernel: Any

    @cached_property
    def name(self) -> str:
        return name_of(self.kernel, self.kernel.declared)

    @cached_property
    def key(self) -> str:
        return key_of(self.kernel, self.kernel.declared)

    @cached_property
    def parts(self) -> frozenset[str]:
        """The kernels it reaches, itself included."""
        return frozenset(reached(self.kernel))

    @property
    def is_ready(self) -> bool:
        """Whether it is compiled already, by this process or another."""
        return store.has(self.name, self.key)

    @property
    def is_claimed(self) -> bool:
        """Whether a process is compiling it."""
        return store.is_claimed(self.name, self.key)


def compile_entries(kernels: Iterable[Any], share: Callable[[], None] = lambda: None) -> None:
    """Make kernels ready to be called with what they declare: from their files, or by compiling them.

    Args:
        kernels: decorated by `entry`; without a compiler (NUMBA_DISABLE_JIT) there is nothing to do.
        share: called when more than one is not compiled yet, so that other processes can be asked to do the same; not
            where numba keeps kernels itself (`compiler.AVAILABLE`), since nobody knows what it has.
    """
    if not compiler.AVAILABLE:
        known = f"({compiler.TRIED[0]}x is)"
        remark(f"numba {numba.__version__} is not known from within {known}: kernels are the same, compiled slower")
    entries = [_Entry(kernel) for kernel in dict.fromkeys(kernels) if hasattr(kernel, "compile")]
    missing = [entry for entry in entries if compiler.AVAILABLE and not entry.is_ready]
    if missing:
        if len(missing) > 1 and store.directory() is not None:
            share()
        _compile(missing)
    for each in entries:
        each.kernel.compile(each.kernel.declared)


def _compile(missing: list[_Entry]) -> None:
    mine: list[_Entry] = []

    def elsewhere() -> int:
        return sum(len(entry.parts) for entry in missing if entry not in mine and entry.is_ready)

    counted = progress.counted()
    counted.begin(sum(len(entry.parts) for entry in missing), elsewhere)
    try:
        while left := [entry for entry in missing if entry not in mine and not entry.is_ready]:
            taken = [entry for entry in left if entry.is_claimed]
            others: frozenset[str] = frozenset()
            for entry in missing:
                if entry in taken or (entry not in left and entry not in mine):
                    others |= entry.parts
            # what others are compiling comes last, and is done by then, or they are dead
            free = [entry for entry in left if entry not in taken] or left
            mine.append(max(free, key=lambda entry: len(entry.parts - others)))
            mine[-1].kernel.compile(mine[-1].kernel.declared)
    finally:
        counted.end()
