"""The worker's side of the pool: a process of its own that prepares itself once and then does one task after another.

It talks to the pool over its standard input and output, which it puts out of everybody's reach first: whatever a task
prints, in Python or in native code, goes to the task's log, and so does the trace of a crash.
"""

from __future__ import annotations

import contextlib
import faulthandler
import gc
import importlib
import os
import pickle
import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from replay.batch.memory import Peak, PeakMeter
from replay.batch.raised import told

Follow = Callable[[int, int], None]
"""Called with what is done of a task and all of it."""
Work = Callable[[Any, Follow], Any]
"""What a worker does with the payload of a task."""
Prepare = Callable[["Messages"], None]
"""What a worker does before its first task; called with what tells the pool something."""

_SECONDS_BETWEEN_MESSAGES = 0.2


@dataclass(frozen=True)
class Start:
    """The pool's first message: what this worker is for."""

    work: Work
    prepare: Prepare | None


@dataclass(frozen=True)
class Order:
    """A task: its payload, and the file for what it prints."""

    payload: Any
    log: Path | None


@dataclass(frozen=True)
class Remark:
    """A remark for the user while the worker prepares itself."""

    text: str


@dataclass(frozen=True)
class Preparing:
    """How far the preparation is."""

    state: Any


@dataclass(frozen=True)
class Divisible:
    """The preparation takes a while, and is done sooner where several workers prepare themselves at once."""


@dataclass(frozen=True)
class Ready:
    """The worker is prepared."""


@dataclass(frozen=True)
class Advanced:
    """How far the task is."""

    done: int
    total: int


@dataclass(frozen=True)
class Finished:
    """What the task returned, and the most memory that it took."""

    value: Any
    peak: Peak


@dataclass(frozen=True)
class Raised:
    """The task ended in an exception: its one line; the log has all of it. And the most memory that it took."""

    text: str
    peak: Peak


class Messages:
    """What a worker can tell the pool while it prepares itself."""

    def __init__(self, answer: Callable[[object], None]) -> None:
        self._answer = answer

    def tell(self, text: str) -> None:
        """Tell the user something."""
        self._answer(Remark(text))

    def progress(self, state: object) -> None:
        """Tell how far it is."""
        self._answer(Preparing(state))

    def share(self) -> None:
        """Ask for other workers that prepare themselves at the same time."""
        self._answer(Divisible())


def main(ahead: Sequence[str]) -> None:
    """Work until the pool closes the connection; it does so too when it dies.

    Args:
        ahead: modules to load before the pool says what this worker is for.
    """
    often, *others = gc.get_threshold()
    gc.set_threshold(100 * often, *others)  # what is loaded here stays: looking for garbage among it finds none
    orders, answers = _channels()
    faulthandler.enable()
    inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
    threading.Thread(target=_receive, args=(orders, inbox), name="replay-orders", daemon=True).start()

    writing = threading.Lock()  # the progress of the preparation comes from a thread of its own

    def answer(message: object) -> None:
        with writing:
            answers.write(pickle.dumps(message))
            answers.flush()

    for module in ahead:
        with contextlib.suppress(Exception):  # a task that needs it will have the same trouble, and say so
            importlib.import_module(module)
    start: Start = inbox.get()
    if start.prepare is not None:
        try:
            start.prepare(Messages(answer))
        except Exception as error:  # a task that has the same trouble will say so itself
            answer(Remark(f"a worker could not prepare itself: {error!r}"))
    gc.freeze()
    gc.set_threshold(often, *others)
    answer(Ready())
    while True:
        order: Order = inbox.get()
        with _printing_to(order.log):
            meter = PeakMeter()
            try:
                value = start.work(order.payload, _throttled(answer))
                message: object = Finished(value, meter.read())
            except Exception as error:
                traceback.print_exc()
                message = Raised(told(error), meter.read())
        answer(message)


def _channels() -> tuple[BinaryIO, BinaryIO]:
    """Keep the connection to the pool as private descriptors; nothing else can read or write it from here on."""
    orders, answers = os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb")
    nothing = os.open(os.devnull, os.O_RDWR)
    for standard in (0, 1, 2):
        os.dup2(nothing, standard)
    os.close(nothing)
    return orders, answers


def _receive(orders: BinaryIO, inbox: queue.SimpleQueue[Any]) -> None:
    """Take orders in a thread, so that the pool's death ends this process in the middle of a task too."""
    try:
        while True:
            inbox.put(pickle.load(orders))
    except BaseException:
        os._exit(0)


def _throttled(answer: Callable[[object], None]) -> Follow:
    last = 0.0

    def follow(done: int, total: int) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _SECONDS_BETWEEN_MESSAGES:
            last = now
            answer(Advanced(done, total))

    return follow


@contextlib.contextmanager
def _printing_to(log: Path | None) -> Iterator[None]:
    """Let everything that is printed go to a file, and to nowhere afterwards."""
    _flush()
    flags = os.O_WRONLY | os.O_CREAT | os.O_APPEND | getattr(os, "O_NOFOLLOW", 0)  # never through a link
    target = os.open(os.devnull if log is None else log, flags, 0o666)
    for standard in (1, 2):
        os.dup2(target, standard)
    os.close(target)
    try:
        yield
    finally:
        _flush()
        nothing = os.open(os.devnull, os.O_WRONLY)
        for standard in (1, 2):
            os.dup2(nothing, standard)
        os.close(nothing)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
