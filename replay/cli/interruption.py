"""Ctrl-C, and requests of the system to stop, end a command the same way and are never lost.

The handler raises KeyboardInterrupt wherever the program is. When that is a callback from native code, as while kernels
are loaded, Python drops the exception or the library turns it into another; so the request is remembered and asked for.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_requested = threading.Event()
_settled = threading.Event()


def install() -> None:
    """Let SIGINT (Ctrl-C), SIGTERM and SIGHUP (a closed terminal) raise KeyboardInterrupt."""
    _handle(_interrupt)


def check() -> None:
    """Raise KeyboardInterrupt when the command was asked to stop and still runs."""
    if _requested.is_set():
        raise KeyboardInterrupt


def settle() -> None:
    """Say that what is done is decided, and all that is left is to write it down, which is better not left half done.

    One request to stop changes nothing from here on; another one ends the command all the same.
    """
    _settled.set()


def over() -> bool:
    """Ignore what comes while the interpreter ends; return whether the command was asked to stop before."""
    _settled.set()
    _handle(signal.SIG_IGN)
    return _requested.is_set()


def _handle(handler: Callable[[int, FrameType | None], None] | signal.Handlers) -> None:
    for name in _SIGNALS:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    if _settled.is_set():
        _settled.clear()
        return
    _requested.set()
    raise KeyboardInterrupt
