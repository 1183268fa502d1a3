"""Writing beside computing: blocks are written in a thread of their own while the next ones are computed.

Kernels release the interpreter and so does compression, so that on two cores most of the writing costs no time.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Sequence
from types import TracebackType
from typing import Protocol, Self

from replay.simulation import FrameBlock

_BLOCKS_BEHIND = 2
"""Blocks that may wait to be written; beyond, computing waits, so that memory stays bounded."""


class Writer(Protocol):
    """What takes blocks and becomes a file."""

    def prepare(self) -> None:
        """Do what needs no block; called once, before the first one."""

    def write(self, block: FrameBlock) -> None:
        """Append a block."""

    def close(self) -> None:
        """Finish the file."""

    def discard(self) -> None:
        """Give the file up."""


class WriteBehind:
    """Feeds the same blocks to several writers, in order, from a thread.

    As a context: at its end the writers are closed, in order, or all discarded when an error is on its way; an error
    in the thread is raised by the next `put` or at the end.
    """

    def __init__(self, writers: Sequence[Writer]) -> None:
        self._writers = tuple(writers)
        self._queue: queue.Queue[FrameBlock | None] = queue.Queue(maxsize=_BLOCKS_BEHIND)
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="replay-writer", daemon=True)

    def put(self, block: FrameBlock) -> None:
        """Hand a block over; waits while too many are not yet written."""
        self._raise()
        self._queue.put(block)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._queue.put(None)
        self._thread.join()
        closed = 0
        try:
            if error is None:
                self._raise()
                for writer in self._writers:
                    writer.close()
                    closed += 1
        finally:
            for writer in self._writers[closed:]:
                writer.discard()

    def _work(self) -> None:
        self._guard(self._prepare)  # while the first block is computed
        while (block := self._queue.get()) is not None:
            self._guard(self._write, block)

    def _prepare(self) -> None:
        for writer in self._writers:
            writer.prepare()

    def _write(self, block: FrameBlock) -> None:
        for writer in self._writers:
            writer.write(block)

    def _guard(self, task: Callable[..., None], *arguments: FrameBlock) -> None:
        """Run a task and keep its error; after one, blocks are only taken, so that `put` cannot wait for ever."""
        if self._error is None:
            try:
                task(*arguments)
            except BaseException as error:
                self._error = error

    def _raise(self) -> None:
        if self._error is not None:
            raise self._error
