"""The one jit decorator, and the one place that says where compiled kernels are kept.

numba stamps a cached kernel with the modification time of the file that defines it and never looks at the functions it
calls in other files: edit a callee, and the old machine code is served. Here the cache folder is named by a hash of
every source file that kernels may live in, of numba's and llvmlite's versions and of the processor, so an edit
anywhere leads to a new folder.
"""

from __future__ import annotations

import hashlib
import os
import platform
import shutil
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

import llvmlite
import llvmlite.binding
import numba
from numba.core import config

from replay.numerics import announcement

Function = TypeVar("Function", bound=Callable[..., Any])

KERNEL_ROOMS = ("numerics", "geometry", "kinematics", "collision", "sensing")
"""The rooms of the package in which kernels live."""

_KEPT_CACHES = 4  # a developer switches between a few branches; older folders are removed

announcement.install()


def source_hash(package: Path | None = None) -> str:
    """Return the hash that names the kernel cache: kernel sources, numba, llvmlite, Python and processor."""
    package = package or Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for room in KERNEL_ROOMS:
        for source in sorted((package / room).rglob("*.py")):
            digest.update(source.relative_to(package).as_posix().encode() + b"\0")
            digest.update(hashlib.sha256(source.read_bytes()).digest())
    processor = (llvmlite.binding.get_host_cpu_name(), llvmlite.binding.get_host_cpu_features().flatten())
    identity = (numba.__version__, llvmlite.__version__, sys.version, platform.machine(), processor)
    digest.update(repr(identity).encode())
    return digest.hexdigest()[:20]


@lru_cache(maxsize=1)
def cache_directory() -> Path:
    """Return the folder of this version's compiled kernels; it is created when a kernel is first compiled.

    The first writable place wins: NUMBA_CACHE_DIR if set, the package itself, the user's cache folder, and, for a
    read-only install of a user without a home, a folder of this user in the system's temporary directory.
    """
    name = source_hash()
    for base in _candidate_bases():
        target = base / name
        try:
            target.mkdir(parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=target):
                pass
        except OSError:
            continue
        _prune(base, keep=target)
        return target
    return Path(tempfile.mkdtemp(prefix="replay-kernels-"))


def _candidate_bases() -> list[Path]:
    given = os.environ.get("NUMBA_CACHE_DIR")
    user = Path(os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache")
    identity = os.getuid() if hasattr(os, "getuid") else "user"
    return [
        *([Path(given) / "replay"] if given else []),
        Path(__file__).resolve().parent / "__pycache__" / "kernels",
        user / "replay" / "kernels",
        Path(tempfile.gettempdir()) / f"replay-kernels-{identity}",
    ]


def _prune(base: Path, *, keep: Path) -> None:
    others = [entry for entry in base.iterdir() if entry.is_dir() and entry != keep]
    others.sort(key=lambda entry: entry.stat().st_mtime, reverse=True)
    for entry in others[_KEPT_CACHES - 1 :]:
        shutil.rmtree(entry, ignore_errors=True)


def kernel(function: Function) -> Function:
    """Compile a function under the package's one jit policy.

    Cached (see the module's text), releases the GIL, one thread (results do not depend on the core count), no
    fast-math and no contraction (every operation rounds as IEEE 754 says), and division by zero gives inf or NaN as in
    NumPy: kernels decide by comparison before they divide.
    """
    settings: Any = config  # numba fills this module at run time
    previous = settings.CACHE_DIR
    settings.CACHE_DIR = str(cache_directory())
    try:
        return cast(Function, numba.njit(cache=True, nogil=True, fastmath=False, error_model="numpy")(function))
    finally:
        settings.CACHE_DIR = previous


def leaf_kernel(function: Function) -> Function:
    """Compile as `kernel` does, without reference counting: for kernels that only use arrays they are given.

    numba counts references to every array that a compiled function is passed or slices, with atomic operations, even
    where nothing is kept: 5 ns each, 45 of the 50 ns of a support query of a box. A function that allocates nothing
    needs no counting, since its caller holds the arrays; one that would allocate fails to compile. Nor may it return an
    array: the caller would give back a reference that nobody took. The results are the same. numba has no public option
    for this: should its internal one disappear, the function is compiled as usual.
    """
    dispatcher = kernel(function)
    options = getattr(dispatcher, "targetoptions", None)  # None when NUMBA_DISABLE_JIT leaves the function as it is
    if isinstance(options, dict) and _counting_is_optional():
        options["_nrt"] = False
    return dispatcher


def inlined_kernel(function: Function) -> Function:
    """Compile as `leaf_kernel` does, into the body of every caller: for what is small, or takes many arrays.

    A call passes each field of each array by itself: for two bodies of GJK that is 200 words, 35 of the 70 ns of a
    query that needs one step. The results are the same.
    """
    dispatcher = leaf_kernel(function)
    options = getattr(dispatcher, "targetoptions", None)
    if isinstance(options, dict):
        options["forceinline"] = True
    return dispatcher


@lru_cache(maxsize=1)
def _counting_is_optional() -> bool:
    """Return whether this numba knows the option of compiling without reference counting."""
    try:
        from numba.core.options import DefaultOptions
    except ImportError:
        return False
    return hasattr(DefaultOptions, "_nrt")
