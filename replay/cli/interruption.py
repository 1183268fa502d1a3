"""Ctrl-C, and requests of the system to stop, end a command the same way and are never lost.

The handler raises KeyboardInterrupt wherever the program is. When that is a callback from native code, as while kernels
are loaded, Python drops the exception or the library turns it into another; so the request is remembered and asked for.
"""

from __future__ import annotations

import signal
import threading
from types import FrameType

_SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")
_requested = threading.Event()


def install() -> None:
    """Let SIGINT (Ctrl-C), SIGTERM and SIGHUP (a closed terminal) raise KeyboardInterrupt."""
    for name in _SIGNALS:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
            signal.signal(number, _interrupt)


def requested() -> bool:
    """Return whether the command was asked to stop."""
    return _requested.is_set()


def check() -> None:
    """Raise KeyboardInterrupt when the command was asked to stop and still runs."""
    if requested():
        raise KeyboardInterrupt


def _interrupt(number: int, frame: FrameType | None) -> None:
    _requested.set()
    raise KeyboardInterrupt
