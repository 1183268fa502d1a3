"""Ctrl-C, and requests of the system to stop, end a command the same way and are never lost.

The handler raises KeyboardInterrupt wherever the program is. When that is a callback from native code, as while kernels
are loaded, Python drops the exception or the library turns it into another; so the request is remembered and asked for.
"""

from __future__ import annotations

import contextlib
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_SECONDS_OF_ONE_REQUEST = 0.5
"""Who stops a process and its group, as `timeout` does, sends the same request twice."""

_requested = threading.Event()
_settled = threading.Event()
_held: list[None] = []
_last = -math.inf


def install() -> None:
    """Let SIGINT (Ctrl-C), SIGTERM and SIGHUP (a closed terminal) raise KeyboardInterrupt."""
    _handle(_interrupt)


def check() -> None:
    """Raise KeyboardInterrupt when the command was asked to stop and still runs."""
    if _requested.is_set():
        raise KeyboardInterrupt


@contextlib.contextmanager
def undisturbed() -> Iterator[None]:
    """Let a request to stop wait for the next `check` within a `with` block; another one ends the command at once."""
    _held.append(None)
    try:
        yield
    finally:
        _held.pop()


def settle() -> None:
    """Say that what is done is decided, and all that is left is to write it down, which is better not left half done.

    One request to stop changes nothing from here on; another one ends the command all the same.
    """
    _settled.set()


def over() -> bool:
    """Ignore what comes while the interpreter ends; return whether the command was asked to stop before."""
    _settled.set()
    _handle(signal.SIG_IGN)
    exec("")  # Python forgets that an interrupt once passed through an exec of text, for which `python -m` kills itself
    return _requested.is_set()


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    for name in _SIGNALS:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _last
    now = time.monotonic()
    repeated, _last = now - _last < _SECONDS_OF_ONE_REQUEST, now
    if repeated:
        return
    if _settled.is_set():
        _settled.clear()
        return
    again = _requested.is_set()
    _requested.set()
    if again or not _held:
        raise KeyboardInterrupt
