"""What the user is told while kernels are compiled: nothing for moments, one line when it takes longer."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable

from numba.core import event

TEXT = "compiling kernels; this takes about a minute, once"

_PATIENCE = 2.0  # seconds without a word; a single small kernel takes less


class Announcement(event.Listener):
    """Says once, while it happens, that kernels are compiled, as soon as that has taken longer than its patience.

    numba begins and ends an event around each compilation that its cache did not save. Those of callees lie within
    those of their callers, and one thread compiles at a time.

    Args:
        tell: is called with the line, from a thread of its own.
        patience: time [s] of compiling, all kernels together, before it is.
    """

    def __init__(self, tell: Callable[[str], None], *, patience: float = _PATIENCE) -> None:
        self.tell = tell
        self._left = patience
        self._depth = 0
        self._begin = 0.0
        self._timer: threading.Timer | None = None
        self._told = False

    def on_start(self, event: event.Event) -> None:
        """Begin to wait."""
        self._depth += 1
        if self._depth == 1 and not self._told:
            self._begin = time.monotonic()
            self._timer = threading.Timer(max(self._left, 0.0), self._say)
            self._timer.daemon = True
            self._timer.start()

    def on_end(self, event: event.Event) -> None:
        """Wait no longer; what it took counts."""
        self._depth -= 1
        if self._depth == 0 and self._timer is not None:
            self._timer.cancel()
            self._timer = None
            self._left -= time.monotonic() - self._begin

    def _say(self) -> None:
        self._told = True
        self.tell(TEXT)


def _on_stderr(text: str) -> None:
    print(f"replay: {text}", file=sys.stderr, flush=True)


_announcement = Announcement(_on_stderr)


def install() -> None:
    """Let the compiling of kernels be announced in this process, on stderr."""
    event.register("numba:compile", _announcement)  # type: ignore[no-untyped-call]


def announce_by(tell: Callable[[str], None]) -> None:
    """Let `tell` announce it instead, as in a process whose stderr nobody reads."""
    _announcement.tell = tell
