"""Where compiled kernels are kept: a file for each kernel and key, whole or not there, never a half.

A file begins with the hash of the rest, so one that was cut or damaged is found, removed and compiled again. Whoever
compiles a kernel holds a lock beside its place, so that two processes that need it share the work; a lock dies with its
process. A disk that is full or a folder that cannot be written costs the next run its time and this one nothing.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import stat
import tempfile
import time
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from replay.numerics.jit import progress

try:
    import fcntl
except ImportError:  # Windows: processes do not wait for each other, and may compile the same kernel twice
    fcntl = None  # type: ignore[assignment]

_ENDING = ".kernel"
_KEPT = 4  # versions of one kernel: a developer switches between a few branches
_HASH = 32  # bytes
_PATIENCE = 600.0  # seconds to wait for another process that compiles; a kernel takes less than one minute
_PAUSE = 0.05  # seconds


@lru_cache(maxsize=1)
def directory() -> Path:
    """Return the folder of compiled kernels; it is created when it is first asked for.

    The first place wins that can be written, and by nobody else: numba unpickles what is there. Places are
    NUMBA_CACHE_DIR if set, the package itself, the user's cache folder, and, for a read-only install of a user without
    a home, a folder of this user in the system's temporary directory.
    """
    for base in _candidate_bases():
        try:
            base.mkdir(mode=0o700, parents=True, exist_ok=True)
            with tempfile.TemporaryFile(dir=base):
                pass
            others = _who_else_writes(base)
        except OSError:
            continue
        if others is None:
            return base
        progress.remark(f"compiled kernels are not kept in {base}: {others}")
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


def _who_else_writes(base: Path) -> str | None:
    """Return why files in a folder may be another user's, or None."""
    if os.name != "posix":
        return None
    user = os.getuid()
    if base.is_symlink():
        return "it is a link"
    if base.stat().st_uid != user:
        return "it belongs to another user"
    base.chmod(0o700)
    for folder in base.resolve().parents:
        found = folder.stat()
        if found.st_uid not in (0, user):
            return f"{folder} belongs to another user"
        shared = stat.S_IWOTH | (0 if found.st_gid in (0, os.getegid()) else stat.S_IWGRP)
        if found.st_mode & shared and not found.st_mode & stat.S_ISVTX:
            return f"others can write to {folder}"
    return None


def _path(name: str, key: str) -> Path:
    return directory() / f"{name}-{key}{_ENDING}"


def has(name: str, key: str) -> bool:
    """Return whether a compiled kernel is there."""
    return _path(name, key).exists()


def load(name: str, key: str) -> bytes | None:
    """Return what `save` was given, or None if it is not there; what is not whole is removed."""
    path = _path(name, key)
    try:
        data = path.read_bytes()
    except OSError:
        return None
    if hashlib.sha256(data[_HASH:]).digest() != data[:_HASH]:
        discard(name, key)
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # the versions that are used are kept
    return data[_HASH:]


def discard(name: str, key: str) -> None:
    """Remove a kernel that cannot be used."""
    with contextlib.suppress(OSError):
        _path(name, key).unlink()


def save(name: str, key: str, payload: bytes) -> None:
    """Keep a compiled kernel; where that fails, it is said once, and the next process compiles again."""
    path = _path(name, key)
    try:
        descriptor, name_of_part = tempfile.mkstemp(dir=path.parent, prefix=f"{path.stem}.", suffix=".part")
        part = Path(name_of_part)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(hashlib.sha256(payload).digest() + payload)
            part.replace(path)
        except OSError:
            part.unlink(missing_ok=True)
            raise
    except OSError as error:
        progress.remark(f"compiled kernels cannot be kept: {error.strerror or error}; the next run compiles them again")
        return
    _prune(name, path.parent)


def _prune(name: str, folder: Path) -> None:
    found = []
    for path in folder.glob(f"{name}-*"):
        with contextlib.suppress(OSError):  # another process removed it
            found.append((path.stat().st_mtime, path))
    kept = [path for _, path in sorted(found, reverse=True) if path.suffix == _ENDING][:_KEPT]
    yesterday = time.time() - 86400.0
    for changed, path in found:
        if path not in kept and (path.suffix == _ENDING or changed < yesterday):  # the rest of a killed process
            with contextlib.suppress(OSError):
                path.unlink()


def is_claimed(name: str, key: str) -> bool:
    """Return whether a process compiles a kernel now."""
    with claim(name, key, wait=False) as mine:
        return not mine


@contextlib.contextmanager
def claim(name: str, key: str, *, wait: bool = True) -> Iterator[bool]:
    """Hold the right to compile a kernel; yields whether it is this process's.

    Args:
        name, key: which.
        wait: for another process that has it: until it is done or dead, at most ten minutes.
    """
    place = _path(name, key).with_suffix(".lock")
    try:
        descriptor = os.open(place, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
    except OSError:
        yield True
        return
    try:
        mine = _locked(descriptor, wait=wait)
        yield mine
        if mine:
            with contextlib.suppress(OSError):
                place.unlink()
    finally:
        os.close(descriptor)


def _locked(descriptor: int, *, wait: bool) -> bool:
    if fcntl is None:
        return True
    deadline = time.monotonic() + (_PATIENCE if wait else 0.0)
    while True:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            if time.monotonic() >= deadline:
                return False
            time.sleep(_PAUSE)
        except OSError:  # a file system without locks
            return True
        else:
            return True
