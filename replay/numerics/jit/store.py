"""Where compiled kernels are kept: a file for each kernel and key, whole or not there, never a half.

Files are unpickled, so only what this user has written is read, from a folder that nobody else can write to.
A file begins with the hash of the rest, so one that was cut or damaged is found, removed and compiled again. Whoever
compiles a kernel holds a lock beside its place, so that two processes that need it share the work; a lock dies with its
process. A disk that is full or a folder that cannot be written costs the next run its time and this one nothing.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import shutil
import stat
import tempfile
import time
from collections.abc import Iterator
from functools import lru_cache
from pathlib import Path

from replay.numerics.jit import progress
from replay.numerics.remarks import remark

try:
    import fcntl
except ImportError:  # Windows: processes do not wait for each other, and may compile the same kernel twice
    fcntl = None  # type: ignore[assignment]

_ENDING = ".kernel"
_KEPT = 4  # versions of one kernel: a developer switches between a few branches
_HASH = 32  # bytes
_PATIENCE = 600.0  # seconds to wait for another process that compiles; a kernel takes less than one minute
_PAUSE = 0.05  # seconds
_FULL = {getattr(errno, name) for name in ("ENOSPC", "EDQUOT", "EFBIG") if hasattr(errno, name)}


@lru_cache(maxsize=1)
def directory() -> Path | None:
    """Return the folder of compiled kernels, which is made when it is first asked for; None if they cannot be kept.

    The first place wins that can be written, and by nobody else. Places are NUMBA_CACHE_DIR if set, the package itself,
    the user's cache folder, and, for a read-only install of a user without a home, a folder of this user in the
    system's temporary directory. A place that is full is one: what is there can be read.
    """
    reason = "there is no place for them"
    for base in _candidate_bases():
        try:
            base.mkdir(mode=0o700, parents=True, exist_ok=True)
            _try_to_write(base)
            others = _who_else_writes(base)
        except OSError as error:
            reason = f"{base}: {error.strerror or error}"
            continue
        if others is None:
            return base.resolve()
        reason = f"{base}: {others}"
        remark(f"compiled kernels are not kept in {reason}")
    progress.unkept(reason)
    return None


def _try_to_write(base: Path) -> None:
    try:
        with tempfile.TemporaryFile(dir=base):
            pass
    except OSError as error:
        if error.errno not in _FULL:
            raise


def _candidate_bases() -> Iterator[Path]:
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given:
        yield Path(given) / "replay"
    yield Path(__file__).resolve().parent / "__pycache__" / "kernels"
    with contextlib.suppress(RuntimeError):  # no home
        yield Path(os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache") / "replay" / "kernels"
    with contextlib.suppress(OSError):  # no temporary directory that is not full
        yield Path(tempfile.gettempdir()) / f"replay-kernels-{os.getuid() if hasattr(os, 'getuid') else 'user'}"


def _who_else_writes(base: Path) -> str | None:
    """Return why files in a folder may be another user's, or None."""
    if os.name != "posix":
        return None
    user = os.getuid()
    if base.is_symlink():
        return "it is a link"
    found = base.stat()
    if found.st_uid != user:
        return "it belongs to another user"
    if _shared(found):
        return "others can write to it"  # and may have done so before
    base.chmod(0o700)
    for folder in base.resolve().parents:
        found = folder.stat()
        if found.st_uid not in (0, user):
            return f"{folder} belongs to another user"
        if _shared(found) and not found.st_mode & stat.S_ISVTX:
            return f"others can write to {folder}"
    return None


def _shared(found: os.stat_result) -> bool:
    """Return whether others can write to a folder: anyone, or its group, unless that is this user's own or root's."""
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and found.st_gid != 0 and not _is_private(found.st_gid)


def _is_private(group: int) -> bool:
    """Return whether a group is of this user alone, as on systems where each has one of the same name."""
    import grp
    import pwd

    try:
        found, name = grp.getgrgid(group), pwd.getpwuid(os.getuid()).pw_name
    except KeyError:
        return False
    return found.gr_name == name and set(found.gr_mem) <= {name}


def _path(name: str, key: str) -> Path | None:
    folder = directory()
    return None if folder is None else folder / f"{name}-{key}{_ENDING}"


def has(name: str, key: str) -> bool:
    """Return whether a compiled kernel is there."""
    path = _path(name, key)
    return path is not None and path.exists()


def load(name: str, key: str) -> bytes | None:
    """Return what `save` was given, or None if it is not there; what is not whole, or not ours, is removed."""
    path = _path(name, key)
    if path is None:
        return None
    try:
        data = _own_bytes(path)
    except FileNotFoundError:
        return None
    except OSError:
        data = b""
    if len(data) < _HASH or hashlib.sha256(data[_HASH:]).digest() != data[:_HASH]:
        discard(name, key)
        return None
    with contextlib.suppress(OSError):
        os.utime(path)  # the versions that are used are kept
    return data[_HASH:]


def _own_bytes(path: Path) -> bytes:
    """Return what is in a file of this user; nothing of another's, of a link's or a pipe's."""
    flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
    with os.fdopen(os.open(path, flags), "rb") as stream:
        found = os.fstat(stream.fileno())
        ours = os.name != "posix" or found.st_uid == os.getuid()
        return stream.read() if ours and stat.S_ISREG(found.st_mode) else b""


def discard(name: str, key: str) -> None:
    """Remove a kernel that cannot be used, whatever stands in its place."""
    path = _path(name, key)
    if path is None:
        return
    try:
        path.unlink()
    except OSError:  # a folder
        shutil.rmtree(path, ignore_errors=True)


def save(name: str, key: str, payload: bytes) -> None:
    """Keep a compiled kernel; where that fails, it is said once, and the next process compiles again."""
    path = _path(name, key)
    if path is None:
        return
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
        progress.unkept(error.strerror or str(error))
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
    path = _path(name, key)
    if path is None:
        yield True
        return
    place = path.with_suffix(".lock")
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
