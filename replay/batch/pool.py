"""Worker processes that survive their tasks: a task may crash, hang or eat memory, and the others go on.

Workers are fresh interpreters, not forks, so that no state of this process reaches a result. They live long: kernels
are loaded once a worker and not once a task. The first one prepares itself alone, unless it says that others can share
the work of it; no time limit counts before a worker is ready.
"""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import signal
import subprocess
import threading
import time
from collections import deque
from collections.abc import Callable, Generator, Sequence
from contextlib import AbstractContextManager
from typing import Any, TypeVar

import psutil

from replay.batch.interpreter import Ahead, begin
from replay.batch.memory import Peak
from replay.batch.task import Ended, Ending, Task
from replay.batch.worker import (
    Advanced,
    Divisible,
    Finished,
    Order,
    Prepare,
    Preparing,
    Raised,
    Ready,
    Remark,
    Start,
    Work,
)
from replay.errors import InvalidValue, WorkerError

T = TypeVar("T")

_SECONDS_BETWEEN_CHECKS = 0.1
_SECONDS_TO_PREPARE = 1800.0  # compiling everything takes minutes on a slow machine; beyond this it hangs
_FAILED_STARTS = 3


class Pool:
    """Runs tasks in worker processes.

    Args:
        work: importable by name; called with a task's payload and what follows its progress.
        workers: number of processes.
        timeout: longest time of one task [s]; None for none.
        memory: most resident memory of one task with its child processes [bytes]; None for any.
        prepare: called in each worker before its first task.
        helpers: most workers that prepare themselves at the same time; as many as `workers` if None.
        follow: called with the name of a task, what is done of it and all of it; (name, 0, 0) when it begins.
        tell: called with remarks for the user.
        preparing: called with how far the preparation of workers is.
        check: called all the time, at least about ten times a second; what it raises ends the run and all processes.
        undisturbed: returns a context in which a request to end the run waits for `check`, so that no result is lost.
        inherit: descriptors that the workers keep open as long as they live.
        ahead: an interpreter that has been begun already, for the first worker; it has inherited them.

    Raises:
        InvalidValue: a limit or the number of workers is not positive.
    """

    def __init__(
        self,
        work: Work,
        *,
        workers: int,
        timeout: float | None = None,
        memory: int | None = None,
        prepare: Prepare | None = None,
        helpers: int | None = None,
        follow: Callable[[str, int, int], None] = lambda name, done, total: None,
        tell: Callable[[str], None] = lambda text: None,
        preparing: Callable[[Any], None] = lambda state: None,
        check: Callable[[], None] = lambda: None,
        undisturbed: Callable[[], AbstractContextManager[None]] = contextlib.nullcontext,
        inherit: Sequence[int] = (),
        ahead: Ahead | None = None,
    ) -> None:
        for name, value in (("workers", workers), ("timeout", timeout), ("memory", memory)):
            if value is not None and value <= 0:
                raise InvalidValue(name, value, "must be above 0")
        self._start = Start(work, prepare)
        self._count = workers
        self._helpers = helpers or workers
        self._timeout = timeout
        self._memory = memory
        self._follow = follow
        self._tell = tell
        self._preparing = preparing
        self._check = check
        self._undisturbed = undisturbed
        self._inherit = inherit
        self._ahead = ahead

    def run(self, tasks: Sequence[Task]) -> Generator[Ended]:
        """Yield what became of each task, in the order in which they end; close the iterator to stop early.

        Raises:
            WorkerError: workers die before they are ready.
        """
        with self._undisturbed():
            yield from self._run(deque(sorted(tasks, key=lambda task: (-task.cost, task.name))))

    def _run(self, waiting: deque[Task]) -> Generator[Ended]:
        inbox: queue.SimpleQueue[tuple[_Worker, Any]] = queue.SimpleQueue()
        workers: list[_Worker] = []
        prepared = False
        preparing = 1
        failed_starts = 0
        told: set[str] = set()
        next_check = 0.0
        try:
            while waiting or any(worker.task for worker in workers):
                self._check()
                wanted = min(self._count, len(waiting) + sum(worker.task is not None for worker in workers))
                while len(workers) < (wanted if prepared else preparing):
                    workers.append(_Worker(self._start, inbox, self._interpreter()))
                spare = [worker for worker in workers if worker.task is None] if prepared else []
                for worker in sorted(spare, key=lambda worker: worker.ready)[: max(0, len(workers) - wanted)]:
                    workers.remove(worker)
                    worker.stop()
                for worker in workers:
                    if worker.ready and worker.task is None and waiting:
                        self._follow(waiting[0].name, 0, 0)
                        worker.give(waiting.popleft())
                with contextlib.suppress(queue.Empty):
                    worker, message = inbox.get(timeout=_SECONDS_BETWEEN_CHECKS)
                    if worker not in workers:
                        continue  # it has been stopped; this was still on its way
                    match message:
                        case Remark(text):
                            if text not in told:  # by another worker
                                told.add(text)
                                self._tell(text)
                        case Preparing(state):
                            self._preparing(state)
                        case Divisible():
                            preparing = self._helpers
                        case Ready():
                            worker.ready = prepared = True
                            failed_starts = 0
                        case Advanced(done, total):
                            self._follow(_known(worker.task).name, done, total)
                        case Finished(_, peak) | Raised(_, peak):
                            excess = worker.excess(peak, self._memory)
                            if excess == "":
                                name = _known(worker.task).name
                                self._tell(f"{name}: it was over before its memory could be watched")
                            if excess:
                                workers.remove(worker)
                                worker.stop()
                                yield worker.ended(Ending.MEMORY, excess)
                            elif isinstance(message, Raised):
                                yield worker.ended(Ending.CRASHED, message.text)
                            else:
                                yield worker.ended(Ending.DONE, value=message.value)
                        case None:
                            workers.remove(worker)
                            worker.stop()
                            if worker.task is not None:
                                yield worker.ended(Ending.CRASHED, worker.cause_of_death())
                            else:
                                failed_starts += 1
                                if failed_starts == _FAILED_STARTS:
                                    raise WorkerError(worker.cause_of_death())
                if time.monotonic() >= next_check:
                    for worker in list(workers):
                        found = worker.broken_limit(self._timeout, self._memory)
                        if found is None:
                            continue
                        workers.remove(worker)
                        worker.stop()
                        if worker.task is not None:
                            yield worker.ended(*found)
                    next_check = time.monotonic() + _SECONDS_BETWEEN_CHECKS
        finally:
            for worker in workers:
                worker.stop()

    def _interpreter(self) -> subprocess.Popen[bytes]:
        begun = self._ahead.take() if self._ahead is not None else None
        return begun or begin(self._start.work.__module__, self._inherit)


class _Worker:
    """A worker process as the pool sees it."""

    def __init__(
        self, start: Start, inbox: queue.SimpleQueue[tuple[_Worker, Any]], process: subprocess.Popen[bytes]
    ) -> None:
        self.task: Task | None = None
        self.ready = False
        self._memory = 0
        self._began = time.monotonic()
        self._process = process
        self._watched = psutil.Process(self._process.pid)
        threading.Thread(target=self._listen, args=(inbox,), name="replay-pool", daemon=True).start()
        self._send(start)

    def give(self, task: Task) -> None:
        """Begin a task."""
        self.task = task
        self._began = time.monotonic()
        self._memory = 0
        self._send(Order(task.payload, task.log))

    def ended(self, ending: Ending, reason: str = "", *, value: Any = None) -> Ended:
        """Return what became of the task; the worker is free then."""
        task, self.task = _known(self.task), None
        return Ended(task, ending, value, reason, time.monotonic() - self._began, self._memory)

    def broken_limit(self, timeout: float | None, memory: int | None) -> tuple[Ending, str] | None:
        """Return which limit the worker is beyond, and how to say it; a free worker that is too large counts too."""
        seconds = time.monotonic() - self._began
        if not self.ready:
            return (Ending.TIMEOUT, "") if seconds > _SECONDS_TO_PREPARE else None
        used = self._resident()
        self._memory = max(self._memory, used)
        if memory is not None and used > (memory if self.task else memory / 2):
            return Ending.MEMORY, _above(used, memory)
        if self.task and timeout is not None and seconds > timeout:
            return Ending.TIMEOUT, f"stopped: still running after the time limit of {timeout:g} s"
        return None

    def excess(self, peak: Peak, memory: int | None) -> str | None:
        """Return how a task that is over was beyond the limit; None when it was not, "" when nobody can know."""
        if peak.sure:
            self._memory = max(self._memory, peak.bytes)
        if memory is None or peak.bytes <= memory:
            return None
        if peak.sure:
            return _above(peak.bytes, memory)
        return None if self._memory else ""

    def stop(self) -> None:
        """End the process and all that it started, and wait until they are gone."""
        family = []
        with contextlib.suppress(psutil.Error):
            family = self._watched.children(recursive=True)
        if os.name == "posix":  # its session also holds the children that it has left behind by dying
            with contextlib.suppress(ProcessLookupError, PermissionError):
                os.killpg(self._process.pid, signal.SIGKILL)
        for process in family:
            with contextlib.suppress(psutil.Error):
                process.kill()
        self._process.kill()
        self._process.wait()
        with contextlib.suppress(OSError):
            _known(self._process.stdin).close()

    def cause_of_death(self) -> str:
        """Return how the process ended, which it did by itself."""
        code = self._process.wait()
        if code >= 0:
            return f"the process ended itself with exit code {code}"
        name = signal.Signals(-code).name if -code in set(signal.Signals) else f"signal {-code}"
        hint = "; the system may have run out of memory" if name == "SIGKILL" else ""
        return f"the process was ended by {name}{hint}"

    def _resident(self) -> int:
        try:
            family = [self._watched, *self._watched.children(recursive=True)]
        except psutil.Error:
            return 0
        used = 0
        for process in family:
            with contextlib.suppress(psutil.Error):
                used += process.memory_info().rss
        return used

    def _send(self, message: object) -> None:
        stream = _known(self._process.stdin)
        with contextlib.suppress(OSError):  # its death is noticed by `_listen`
            stream.write(pickle.dumps(message))
            stream.flush()

    def _listen(self, inbox: queue.SimpleQueue[tuple[_Worker, Any]]) -> None:
        stream = _known(self._process.stdout)
        with contextlib.suppress(Exception), stream:  # its end, or what cannot be unpickled: it is of no use then
            while True:
                inbox.put((self, pickle.load(stream)))
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=5.0)  # so that its exit code is its own and not that of `stop`
        inbox.put((self, None))


def _above(used: int, memory: int) -> str:
    return f"stopped: {used / 2**20:.0f} MiB of memory are above the limit {memory / 2**20:.0f} MiB"


def _known(value: T | None) -> T:
    assert value is not None
    return value
