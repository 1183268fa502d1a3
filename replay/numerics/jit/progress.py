"""What the user is told while kernels are compiled: how many of how many and for how long, and one line at the end.

Nothing is said of what takes moments, and nothing where nothing is compiled.
"""

from __future__ import annotations

import contextlib
import sys
import threading
import time
from collections.abc import Callable
from functools import lru_cache

from numba.core import event

from replay.numerics.compiling import Compiling
from replay.numerics.remarks import remark

_PATIENCE = 1.5  # seconds without a word; a single small kernel takes less
_PAUSE = 0.25  # seconds between two looks on a terminal
_LINES = 5.0  # seconds between two lines elsewhere, such as in a nightly's log


class Progress(event.Listener):  # type: ignore[misc]
    """Counts kernels as numba compiles them, and tells how far it is, from a thread of its own.

    numba begins and ends an event around each function that it compiles; those of callees lie within those of callers.

    Args:
        tell: called with a `Compiling`, every quarter of a second and at the end.
        patience: time [s] of compiling before the first word; batches that take less are not mentioned.
    """

    def __init__(self, tell: Callable[[Compiling], None], *, patience: float = _PATIENCE) -> None:
        self.tell = tell
        self._elsewhere: Callable[[], int] = int
        self._patience = patience
        self._done = self._total = self._depth = 0
        self._begin = 0.0
        self._told = threading.Event()
        self._ended = threading.Event()

    def begin(self, kernels: int, elsewhere: Callable[[], int] = int) -> None:
        """Begin a batch; batches may lie within each other, and the outermost is told.

        Args:
            kernels: how many are wanted.
            elsewhere: returns how many of them other processes have compiled since.
        """
        self._depth += 1
        if self._depth > 1:
            return
        self._done, self._total, self._begin, self._elsewhere = 0, kernels, time.monotonic(), elsewhere
        self._told, self._ended = threading.Event(), threading.Event()
        threading.Thread(target=self._watch, args=(self._told, self._ended), name="replay-kernels", daemon=True).start()

    def end(self) -> None:
        """End a batch."""
        self._depth -= 1
        if self._depth == 0:
            self._ended.set()
            if self._told.is_set():
                self.tell(self._now(ended=True))

    def on_start(self, event: event.Event) -> None:
        """Do nothing: a kernel counts when it is done."""

    def on_end(self, event: event.Event) -> None:
        """Count a kernel; what numba compiles of its own does not count."""
        if event.data is None or not event.data["dispatcher"].py_func.__module__.startswith("numba."):
            self._done += 1

    def _now(self, *, ended: bool = False) -> Compiling:
        done = self._done + self._elsewhere()
        seconds = time.monotonic() - self._begin
        return Compiling(done if ended else min(done, self._total), self._total, seconds, ended, not _unkept.is_set())

    def _watch(self, told: threading.Event, ended: threading.Event) -> None:
        if ended.wait(self._patience):
            return
        told.set()
        while not ended.is_set():
            self.tell(self._now())
            ended.wait(_PAUSE)


class OnStderr:
    """Shows it on stderr: a line that is written over on a terminal, a line now and then elsewhere."""

    def __init__(self) -> None:
        self._next = 0.0

    def __call__(self, state: Compiling) -> None:
        """Show how far it is."""
        now = time.monotonic()
        with contextlib.suppress(OSError, ValueError, AttributeError):  # closed meanwhile, or none at all
            if sys.stderr.isatty():
                terminal = getattr(sys.stderr, "beneath", sys.stderr)  # the command writes escapes as text; see cli
                print(f"\r\x1b[Kreplay: {state}", end="\n" if state.ended else "", file=terminal, flush=True)
            elif state.ended or now >= self._next:
                self._next = now + _LINES
                print(f"replay: {state}", file=sys.stderr, flush=True)


_unkept = threading.Event()


@lru_cache(maxsize=1)
def counted() -> Progress:
    """Return what counts the kernels that this process compiles, and tells it on stderr."""
    progress = Progress(OnStderr())
    event.register("numba:compile", progress)
    return progress


def tell_by(tell: Callable[[Compiling], None]) -> None:
    """Let others tell it instead, as in a process whose stderr nobody reads."""
    counted().tell = tell


def unkept(reason: str) -> None:
    """Say that kernels are compiled and cannot be kept."""
    _unkept.set()
    remark(f"compiled kernels cannot be kept: {reason}; the next run compiles them again")
