"""Writing beside computing: blocks are written in a thread of their own while the next ones are computed.

Kernels release the interpreter and so does compression, so that on two cores most of the writing costs no time. One
thread writes all files: several would take the interpreter from each other, which costs more than it gains. For the
same reason a run of one block has no thread: nothing is left to be computed when its block is there.
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
        """Do what needs no block; called once, before the first one, or left to `write` when that is there already."""

    def write(self, block: FrameBlock) -> None:
        """Append a block."""

    def finish(self) -> None:
        """Write all that is left, or begin to; called once, after the last block."""

    def commit(self) -> None:
        """Wait until all is written, and give the file its name."""

    def discard(self) -> None:
        """Give the file up."""


class WriteBehind:
    """Feeds the same blocks to several writers, in order, from a thread.

    The first writer takes all blocks that wait before the next one has its turn, so that at the end of a run it closes
    its file while the others still write.

    Without `threaded` the blocks are kept, and written at the end by whoever put them.

    As a context: at its end the writers are finished, then committed in order, or all discarded when there was an
    error; an error in the thread is raised by the next `put` or at the end.
    """

    def __init__(self, writers: Sequence[Writer], *, threaded: bool = True) -> None:
        self._writers = tuple(writers)
        self._queue: queue.Queue[FrameBlock | None] = queue.Queue(maxsize=_BLOCKS_BEHIND if threaded else 0)
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._work, name="replay-writer", daemon=True) if threaded else None

    def put(self, block: FrameBlock) -> None:
        """Hand a block over; waits while too many are not yet written."""
        self._raise()
        self._queue.put(block)

    def __enter__(self) -> Self:
        if self._thread is not None:
            self._thread.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self._error = self._error or error  # then nothing more is written
        self._queue.put(None)
        if self._thread is not None:
            self._thread.join()
        else:
            self._work()
        committed = 0
        try:
            if error is None:
                self._raise()
                for writer in self._writers:
                    writer.commit()
                    committed += 1
        finally:
            for writer in self._writers[committed:]:
                writer.discard()

    def _work(self) -> None:
        for writer in self._writers if self._thread is not None else ():
            self._guard(writer.prepare)  # while the first block is computed
        first, *others = self._writers
        ended = False
        while not ended:
            taken: list[FrameBlock | None] = []
            while not ended and (not taken or (len(taken) <= _BLOCKS_BEHIND and not self._queue.empty())):
                item = self._queue.get()
                ended = item is None
                self._serve(first, item)
                taken.append(item)
            for writer in others:
                for item in taken:
                    self._serve(writer, item)

    def _serve(self, writer: Writer, item: FrameBlock | None) -> None:
        """Let a writer append a block, or finish after the last one."""
        if item is None:
            self._guard(writer.finish)
        else:
            self._guard(writer.write, item)

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
