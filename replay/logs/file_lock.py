"""Locks on open files; the system ends them together with the last process that has the file open, however it ends."""

from __future__ import annotations

import os
import sys
from pathlib import Path

_BYTE = 2**31 - 2  # that Windows locks; nobody can read a byte that is locked there, so it is one behind the text


def lock(handle: int, *, shared: bool = False, wait: bool = False) -> bool:
    """Lock an open file; return whether it is ours now. A file system without locks says yes to everybody.

    Args:
        handle: descriptor of the file.
        shared: others that want the same may have it too. On Windows nobody else may.
        wait: until it can be ours; on Windows 10 s at most.
    """
    try:
        if sys.platform == "win32":
            import msvcrt

            os.lseek(handle, _BYTE, os.SEEK_SET)
            msvcrt.locking(handle, msvcrt.LK_LOCK if wait else msvcrt.LK_NBLCK, 1)
        else:
            import fcntl

            fcntl.flock(handle, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | (0 if wait else fcntl.LOCK_NB))
    except (BlockingIOError, PermissionError):
        return False
    except OSError:
        return True
    return True


def is_at(handle: int, path: Path) -> bool:
    """Return whether an open file is the one that stands at a path, and not one that has gone from there."""
    try:
        return os.path.samestat(os.fstat(handle), path.lstat())
    except OSError:
        return False
