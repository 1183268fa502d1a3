"""One writer a folder: whoever writes a run folder or a baseline folder claims it first, and others are refused.

The claim is a lock on the file `.lock` in the folder, which names the process. It ends with the process and with the
workers that it has handed the file to: they write there too, and for a moment may outlive a process that is killed.
"""

from __future__ import annotations

import contextlib
import datetime
import json
import os
import platform
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil
from typing_extensions import TypedDict

from replay.errors import BusyError
from replay.json_text import read_json, typed
from replay.logs.file_lock import is_at, lock
from replay.logs.part_file import refuse_link, write_error

LOCK = ".lock"
_SECONDS_OF_DYING = 15.0
"""As long is waited for the workers of a process that is gone."""
_PAUSE = 0.02


class Signature(TypedDict):
    """What the lock's file says of who has it."""

    process: int
    host: str
    since: str


@dataclass(frozen=True)
class Claim:
    """A folder that is ours.

    Attributes:
        handle: of its lock, for workers to inherit; None for a folder that is read where nothing can be written.
        thread: whose it is.
    """

    handle: int | None
    thread: int

    @property
    def handles(self) -> tuple[int, ...]:
        """What workers inherit."""
        return () if self.handle is None else (self.handle,)


_ours: dict[tuple[Path, int], Claim] = {}


@contextlib.contextmanager
def claim(directory: Path, *, shared: bool = False) -> Iterator[Claim]:
    """Claim a folder for a `with` block; it is made when it is not there, with those above
    it, and they are removed when they are empty at the end then.

    Claims of the same thread may lie within each other.

    Args:
        directory: the folder.
        shared: it is only read, and shared with others that do the same. A folder that cannot be locked, because it is
            not there or may not be written, needs no claim.

    Raises:
        BusyError: another process, or another thread, uses the folder.
        WriteError: it cannot be made or written, or its lock is a link.
    """
    thread = threading.get_ident()
    key = directory.resolve(), thread
    if key in _ours:
        yield _ours[key]
        return
    made = [] if shared else [folder for folder in (directory, *directory.parents) if not folder.exists()]
    try:
        if not shared:
            directory.mkdir(parents=True, exist_ok=True)
        handle: int | None = _acquire(directory, shared)
    except OSError as error:
        if not shared:
            raise write_error(directory, error) from None
        handle = None
    _ours[key] = Claim(handle, thread)
    try:
        yield _ours[key]
    finally:
        del _ours[key]
        if handle is not None:
            _release(directory, handle)
        with contextlib.suppress(OSError):
            for folder in made:
                folder.rmdir()


def _acquire(directory: Path, shared: bool) -> int:
    path = directory / LOCK
    until = time.monotonic() + _SECONDS_OF_DYING
    while True:
        late = time.monotonic() > until
        refuse_link(path)
        handle = os.open(path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o666)
        try:
            ours = lock(handle, shared=shared)
            if ours and is_at(handle, path) and os.fstat(handle).st_nlink > 1:
                path.unlink()  # it is a file of another place too (a hard link), and not for us to write
            elif ours and is_at(handle, path):
                _sign(handle)
                handle, signed = -1, handle
                return signed
            if not ours:
                user, alive = _user(handle)
                if alive or late:
                    raise BusyError(str(directory), user)
            elif late:
                raise BusyError(str(directory), "others, which remove its lock all the time")
        finally:
            if handle >= 0:
                os.close(handle)
        time.sleep(_PAUSE)


def _release(directory: Path, handle: int) -> None:
    """Remove the lock's file, unless others share it, and give it up."""
    with contextlib.suppress(OSError):
        path = directory / LOCK
        if lock(handle) and is_at(handle, path):
            path.unlink()
    os.close(handle)


def _sign(handle: int) -> None:
    now = datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
    text = json.dumps({"process": os.getpid(), "host": platform.node(), "since": now})
    with contextlib.suppress(OSError):  # on a full disk nobody is named, but the lock holds
        os.ftruncate(handle, 0)
        os.pwrite(handle, text.encode(), 0) if hasattr(os, "pwrite") else os.write(handle, text.encode())


def _user(handle: int) -> tuple[str, bool]:
    """Return who holds a lock, and whether that process lives; one that nothing is known of is taken to."""
    for _ in range(10):  # it may be about to sign
        try:
            os.lseek(handle, 0, os.SEEK_SET)
            signed = typed(read_json(os.read(handle, 4096)), Signature)
            if not 0 < signed["process"] < 1 << 31:
                raise ValueError("no number of a process")
            break
        except (OSError, ValueError):
            time.sleep(_PAUSE)
    else:
        return "another process", True
    number, host, since = signed["process"], signed["host"], signed["since"]
    if host != platform.node():
        return f"process {number} on {host} since {since}", True
    if _lives(number):
        return f"process {number} since {since}", True
    return f"what process {number}, which has ended, has left running", False


def _lives(number: int) -> bool:
    try:
        return psutil.Process(number).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False
    except psutil.Error:
        return True
