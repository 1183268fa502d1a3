"""What a compiled kernel is made of: its own code and all that it reaches, as one key.

numba stamps a cached kernel with the file that defines it and never looks at the functions it calls in other files:
edit a callee, and the old machine code is served. Here the key of a kernel is a hash over the bytecode of every
function that it can reach (by name, by attribute of a module, by closure), over the constants and defaults they use,
over the options they are compiled with and over the types of the arguments, the fields of named tuples included. So an
edit makes a new key for the kernels that reach it and for no others. What cannot be looked into stands for the whole
file that defines it, so that nothing is ever served stale: it may only be compiled once too often.
"""

from __future__ import annotations

import enum
import hashlib
import inspect
import os
import platform
import sys
from collections.abc import Callable, Iterable, Iterator
from functools import lru_cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import llvmlite
import llvmlite.binding
import numba
import numpy as np
from numba import types

_LIBRARIES = frozenset({"numpy", "numba", "llvmlite"} | sys.stdlib_module_names)
"""Modules that are known by their version: Python's and numba's are part of every key."""

_HAS_DOCSTRING = 0x4000000  # a flag of code from Python 3.13 on

_PLAIN = (bool, int, float, complex, str, bytes, type(None), type(...), np.generic)


def key_of(function: Callable[..., Any], arguments: Iterable[Any]) -> str:
    """Return the key of a kernel for arguments of the given numba types: 32 hexadecimal digits."""
    digest = hashlib.sha256(_identity())
    for argument in arguments:
        _add(digest, "argument", type_text(argument))
    for text in _texts(function):
        _add(digest, text)
    return digest.hexdigest()[:32]


def name_of(function: Callable[..., Any], arguments: Iterable[Any]) -> str:
    """Return the name of a kernel for arguments of the given numba types, the same for all its versions."""
    python = _python_function(function) or function
    place = f"{python.__module__}.{python.__qualname__}".replace("<locals>.", "").removeprefix("replay.")
    taken = hashlib.sha256("; ".join(type_text(argument) for argument in arguments).encode()).hexdigest()[:8]
    return f"{place}-{taken}"


def reached(function: Callable[..., Any]) -> tuple[str, ...]:
    """Return the names of the kernels that a kernel reaches, itself first."""
    return tuple(text.split("\0")[1] for text in _texts(function) if text.startswith("kernel\0"))


def type_text(argument: Any) -> str:
    """Return a numba type as text that tells any two apart; numba's own names leave out the fields of named tuples."""
    if isinstance(argument, types.BaseTuple) and hasattr(argument, "instance_class"):
        named = argument.instance_class
        fields = (f"{name}: {type_text(part)}" for name, part in zip(named._fields, argument.types, strict=True))
        return f"{named.__module__}.{named.__qualname__}({', '.join(fields)})"
    if isinstance(argument, types.BaseTuple):
        return f"({', '.join(type_text(part) for part in argument.types)})"
    return repr(argument)


@lru_cache(maxsize=1)
def _identity() -> bytes:
    """Return what every kernel depends on: versions, processor, numba's settings and this package's policy."""
    processor = (llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten())
    settings = sorted(item for item in os.environ.items() if item[0].startswith("NUMBA_") and "CACHE" not in item[0])
    policy = [source.read_bytes() for source in sorted(Path(__file__).parent.glob("*.py"))]
    versions = (numba.__version__, llvmlite.__version__, np.__version__, sys.version, platform.machine())
    return hashlib.sha256(repr((versions, processor, settings, policy)).encode()).digest()


def _add(digest: Any, *texts: str) -> None:
    for text in texts:
        data = text.encode(errors="surrogatepass")
        digest.update(len(data).to_bytes(8, "little") + data)


def _texts(function: Callable[..., Any]) -> Iterator[str]:
    """Yield what a kernel is made of, each function once."""
    numbers = {id(function): 0}
    waiting = [function]

    def number(found: Any) -> int:
        if id(found) not in numbers:
            numbers[id(found)] = len(numbers)
            waiting.append(found)
        return numbers[id(found)]

    while waiting:
        found = waiting.pop()
        python: Any = _python_function(found) or found
        yield f"kernel\0{python.__module__}.{python.__qualname__}\0{numbers[id(found)]} {_options(found)}"
        yield repr((python.__defaults__, python.__kwdefaults__))
        for code in _codes(python.__code__):
            yield _code_text(code, python.__doc__)
            names = {**dict(_globals_of(code, python)), **_cells_of(python)}
            for name in sorted(names):
                yield f"{name} = " + _value_text(names[name], code, number, depth=0)


def _python_function(found: Any) -> Any:
    """Return the Python function of a kernel, or None if it is none; without a compiler, kernels are functions."""
    return getattr(found, "py_func", None)


def _options(found: Any) -> str:
    return repr(sorted(getattr(found, "targetoptions", {}).items(), key=str))


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _code_text(code: CodeType, docstring: str | None) -> str:
    """Return what a function does, as text: neither its place in the file nor its docstring."""
    constants = [constant for constant in code.co_consts if not isinstance(constant, CodeType)]
    if constants and docstring is not None and constants[0] == docstring:
        constants[0] = None
    flags = code.co_flags & ~_HAS_DOCSTRING
    shape = (code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, flags, code.co_exceptiontable)
    names = (code.co_names, code.co_varnames, code.co_cellvars, code.co_freevars)
    return repr((code.co_code, [_constant_text(constant) for constant in constants], shape, names))


def _constant_text(constant: Any) -> str:
    if isinstance(constant, frozenset):
        return f"frozenset({sorted(_constant_text(part) for part in constant)})"
    if isinstance(constant, tuple):
        return f"({', '.join(_constant_text(part) for part in constant)})"
    return f"{type(constant).__name__} {constant!r}"


def _globals_of(code: CodeType, function: FunctionType) -> Iterator[tuple[str, Any]]:
    for name in code.co_names:
        if name in function.__globals__:
            yield name, function.__globals__[name]


def _cells_of(function: FunctionType) -> dict[str, Any]:
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    return {name: cell.cell_contents for name, cell in cells}


def _value_text(value: Any, code: CodeType, number: Callable[[Any], int], *, depth: int) -> str:
    """Return what a name stands for, as text; functions that are compiled too are queued, and named by their number."""
    if isinstance(value, _PLAIN):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, np.ndarray):
        return f"array {value.dtype.str} {value.shape} {hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, tuple | list | frozenset):
        parts = [_value_text(part, code, number, depth=depth) for part in value]
        return f"{type(value).__name__} {sorted(parts) if isinstance(value, frozenset) else parts}"
    if _python_function(value) is not None:
        return f"kernel {number(value)}"
    if isinstance(value, enum.Enum):
        return f"{type(value).__qualname__}.{value.name} {value.value!r}"
    if isinstance(value, ModuleType):
        if _is_library(value.__name__) or depth > 8:
            return f"library {value.__name__}"
        used = {name: getattr(value, name) for name in code.co_names if hasattr(value, name)}
        parts = [f"{name} = {_value_text(used[name], code, number, depth=depth + 1)}" for name in sorted(used)]
        return f"module {value.__name__} {parts}"
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", "")
    if isinstance(value, type) and issubclass(value, tuple) and hasattr(value, "_fields"):
        return f"named tuple {module}.{name} {value._fields} {getattr(value, '_field_defaults', None)}"
    if isinstance(value, type) and issubclass(value, enum.Enum):
        return f"enumeration {module}.{name} {[(member.name, member.value) for member in value]!r}"
    if module is not None and not _is_library(module):
        return f"{module}.{name} of {_file_hash(module)}"
    return f"{module}.{name}" if name else repr(value)


def _is_library(module: str) -> bool:
    return module.split(".", maxsplit=1)[0] in _LIBRARIES


def _file_hash(module: str) -> str:
    """Return the hash of the file that defines a module: an intrinsic's or an overload's code stands beside it."""
    try:
        return hashlib.sha256(Path(inspect.getfile(sys.modules[module])).read_bytes()).hexdigest()
    except (KeyError, TypeError, OSError):  # typed in at a prompt
        return f"{os.getpid()} {id(sys.modules.get(module))}"
