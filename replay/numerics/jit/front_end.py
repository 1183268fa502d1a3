"""From Python to LLVM, with less of what numba does on the way; most of the time of compiling is spent there.

Left out are passes that find nothing in kernels, which have no closures and no operators on whole arrays (a closure
would not compile, an operator would make an array at each step); the types of operators are looked for once, not at
each use; and numba's option sets compare without rebuilding their defaults. The code that comes out is the same. For
which numba this holds: `compiler`.
"""

from __future__ import annotations

import contextlib
import operator
from collections.abc import Iterator
from typing import Any

from numba import types

NEEDED: tuple[tuple[Any, tuple[str, ...]], ...] = ()
"""What of numba is needed here: names by where they are; empty where it cannot be imported."""

_LEFT_OUT: tuple[Any, ...] = ()
try:
    from numba.core.compiler import CompilerBase, DefaultPassBuilder
    from numba.core.targetconfig import TargetConfig
    from numba.core.typed_passes import InlineOverloads, NopythonRewrites
    from numba.core.untyped_passes import InlineClosureLikes, InlineInlinables, LiteralUnroll, WithLifting

    NEEDED = (
        (TargetConfig, ("__hash__", "__eq__", "options")),
        (types.Function, ("get_call_type",)),
        (DefaultPassBuilder, ("define_nopython_pipeline",)),
    )
    _LEFT_OUT = (InlineClosureLikes, InlineInlinables, InlineOverloads, LiteralUnroll, NopythonRewrites, WithLifting)
except ImportError:  # another numba
    CompilerBase: Any = object  # type: ignore[no-redef]


class KernelPipeline(CompilerBase):  # type: ignore[misc]
    """numba's passes, without those that find nothing in kernels."""

    def define_pipelines(self) -> list[Any]:
        """Return the one way from bytecode to LLVM."""
        manager = DefaultPassBuilder.define_nopython_pipeline(self.state)
        manager.passes = [each for each in manager.passes if each[0] not in _LEFT_OUT]
        manager.finalize()
        return [manager]


_PLAIN = (types.Float, types.Integer, types.IntegerLiteral, types.Boolean)
_GATHERED = (types.Array, types.UniTuple, types.Tuple)
_known: dict[Any, tuple[Any, Any]] = {}


@contextlib.contextmanager
def known_operators() -> Iterator[None]:
    """Let the types of operators be looked for once; under numba's lock, so nothing of another thread is meant."""
    changed: Any = types.Function
    changed.get_call_type = _operator_types
    try:
        yield
    finally:
        del changed.get_call_type


def _operator_types(self: Any, context: Any, args: Any, kws: Any) -> Any:
    """Return the types of a call as numba does; those of operators on numbers and arrays are looked for once."""
    is_operator = getattr(self.typing_key, "__module__", None) == operator.add.__module__
    if kws or not is_operator or not all(_is_plain(argument) for argument in args):
        return super(types.Function, self).get_call_type(context, args, kws)
    known = _known.get((id(self), args))
    if known is None:
        known = _known[id(self), args] = (super(types.Function, self).get_call_type(context, args, kws), self)
    return known[0]


def _is_plain(argument: Any) -> bool:
    """Whether a type is a number, or an array or a tuple of numbers."""
    if type(argument) in _PLAIN:
        return True
    return type(argument) in _GATHERED and all(type(each) in _PLAIN for each in _parts(argument))


def _parts(argument: Any) -> tuple[Any, ...]:
    return (argument.dtype,) if isinstance(argument, types.Array) else tuple(argument.types)


def compare_options_quickly() -> None:
    """Let option sets be equal and hash as numba's are and do: it builds a dictionary of all options each time."""
    options: Any = TargetConfig
    options.__eq__ = _same_options
    options.__hash__ = _hash_of_options


def _same_options(self: Any, other: Any) -> Any:
    if not isinstance(other, TargetConfig):
        return NotImplemented
    mine, others = self._values, other._values
    if mine == others:
        return True
    options = self.options
    return options.keys() == other.options.keys() and all(
        mine.get(name, options[name].default) == others.get(name, options[name].default)
        for name in mine.keys() | others.keys()
    )


def _hash_of_options(self: Any) -> int:
    return hash(type(self))  # numba's is of the names of the options, which are always the same
