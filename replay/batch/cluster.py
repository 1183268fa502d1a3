"""Scenarios on a Dask cluster: inputs travel with the task, files come back with the result.

Each scenario runs in a worker process of its own on the machine that takes it, so that a crash, a hang or a lack of
memory ends that process and not the cluster's. A task whose machine goes away is given to another one by Dask. When
nobody waits for a task any more, because its run was ended, its process is ended too.

Whoever can reach the scheduler runs code on its workers, and what comes back is unpickled here: a scheduler is trusted.
"""

from __future__ import annotations

import contextlib
import dataclasses
import logging
import tempfile
import time
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.batch.case import CaseOrder, CaseResult
from replay.batch.pool import Pool
from replay.batch.task import Ended, Ending, Task
from replay.batch.tls import Certificates, security_for
from replay.batch.worker import Prepare, Work
from replay.errors import InvalidValue, MissingPackageError, NoSpaceError, WorkerError, WriteError
from replay.logs.part_file import write_file

_SECONDS_TO_CONNECT = 30
_SECONDS_BETWEEN_CHECKS = 0.1
_SECONDS_BETWEEN_LOOKS = 1.0
_SECONDS_TO_TELL = 3.0  # without workers; those that have just begun may not have told the scheduler yet
_SECONDS_TO_WAIT = 600.0  # for workers: a cluster that grows with its load begins without any


@dataclass(frozen=True)
class Parcel:
    """What comes back from the cluster: how the scenario ended, and its files by name."""

    ended: Ended
    files: dict[str, bytes]


def check_address(address: str, certificates: Certificates | None = None) -> None:
    """Refuse what is no address of a scheduler; the library takes a minute and a traceback to say so.

    Raises:
        MissingPackageError: `distributed` is not installed.
        InvalidValue: the address is none, or the certificates cannot be used for it.
    """
    try:
        from distributed.comm.addressing import parse_address, parse_host_port
    except ImportError:
        raise MissingPackageError("distributed", "--dask", "pip install distributed") from None
    try:
        parse_host_port(parse_address(address)[1])
    except ValueError:
        rule = "must be the scheduler's address and port, such as tcp://host:8786"
        raise InvalidValue("dask", address, rule) from None
    security_for(address, certificates)


class Cluster:
    """Runs tasks as `Pool` does, on the workers of a Dask scheduler.

    Args:
        address: of the scheduler, such as tcp://host:8786; see `check_address`.
        work: importable by name on every machine; called with a `CaseOrder`.
        certificates: for TLS; `distributed` is asked for its own if None.
        timeout, memory: limits of one task, as of `Pool`.
        prepare: called before the task, in the process that runs it.
        follow: called with (name, 0, 0) when a task is handed over.
        tell: called with remarks for the user.
        check: called about ten times a second; what it raises ends the run.
        undisturbed: as of `Pool`.
    """

    def __init__(
        self,
        address: str,
        work: Work,
        *,
        certificates: Certificates | None = None,
        timeout: float | None = None,
        memory: int | None = None,
        prepare: Prepare | None = None,
        follow: Callable[[str, int, int], None] = lambda name, done, total: None,
        tell: Callable[[str], None] = lambda text: None,
        check: Callable[[], None] = lambda: None,
        undisturbed: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext,
    ) -> None:
        self._address = address
        self._certificates = certificates
        self._settings: dict[str, Any] = {"work": work, "timeout": timeout, "memory": memory, "prepare": prepare}
        self._follow = follow
        self._tell = tell
        self._check = check
        self._undisturbed = undisturbed

    def run(self, tasks: Sequence[Task]) -> Generator[Ended]:
        """Yield what became of each task, in the order in which they end; close the iterator to stop early.

        Raises:
            WorkerError: the scheduler does not answer.
            NoSpaceError: the disk is too full for a file that came back.
        """
        with (
            _librarys_log_silent(),
            contextlib.closing(self._connect()) as client,
            self._undisturbed(),
        ):
            crew = _Crew(client, self._tell)
            executor = client.get_executor(pure=False)
            ordered = sorted(tasks, key=lambda task: (-task.cost, task.name))
            try:
                futures = {executor.submit(run_remotely, task, self._settings): task for task in ordered}
                for task in ordered:
                    self._follow(task.name, 0, 0)
                waiting = set(futures)
                while waiting:
                    self._check()
                    done, waiting = wait(waiting, _SECONDS_BETWEEN_CHECKS, FIRST_COMPLETED)
                    for future in done:
                        yield _unpacked(futures[future], future)
                    if crew.missing():
                        reason = f"on the cluster: there has been no worker for {_SECONDS_TO_WAIT / 60:.0f} min"
                        for future in waiting:
                            yield Ended(futures[future], Ending.CRASHED, None, reason, 0.0, 0)
                        return
            finally:
                executor.shutdown(wait=False)  # cancels what is not done; to wait for it would be to wait for a hang

    def _connect(self) -> Any:
        from distributed import Client

        security = security_for(self._address, self._certificates)
        settings: dict[str, Any] = {"timeout": _SECONDS_TO_CONNECT, "set_as_default": False, "security": security}
        try:
            return Client(self._address, **settings)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            cause = f"{error}: {error.__cause__}" if error.__cause__ else error
            raise WorkerError(f"the Dask scheduler {self._address} does not answer ({cause})") from None


@contextlib.contextmanager
def _librarys_log_silent() -> Iterator[None]:
    """Keep the library's tracebacks from the terminal: what they are about is told by each task in one line."""
    import distributed  # noqa: F401 - it sets the levels

    loggers = [logging.getLogger(name) for name in ("distributed", "distributed.client")]
    levels = [logger.level for logger in loggers]
    try:
        for logger in loggers:
            logger.setLevel(logging.CRITICAL)
        yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.setLevel(level)


class _Crew:
    """Notices that a cluster has no workers."""

    def __init__(self, client: Any, tell: Callable[[str], None]) -> None:
        self._client = client
        self._tell = tell
        self._told = False
        self._seen = self._next = time.monotonic()

    def missing(self) -> bool:
        """Tell when there are no workers; return whether they have been waited for long enough."""
        now = time.monotonic()
        if now < self._next or self._client.status != "running":  # a connection that is lost is told by each task
            return False
        self._next = now + _SECONDS_BETWEEN_LOOKS
        try:
            workers = self._client.nthreads()
        except Exception:  # whatever the library raises where the connection is lost just now
            return False
        if workers:
            self._told, self._seen = False, now
        elif not self._told and now - self._seen >= _SECONDS_TO_TELL:
            self._told = True
            address = self._client.scheduler.address
            self._tell(f"the Dask scheduler {address} has no workers; waiting for one (dask worker {address})")
        return now - self._seen >= _SECONDS_TO_WAIT


def run_remotely(task: Task, settings: dict[str, Any]) -> Parcel:
    """Run one task in a process of its own on this machine, in a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="replay-", dir=_own_place()) as name:
        folder = Path(name)
        order: CaseOrder = dataclasses.replace(task.payload, folder=folder)
        pool = Pool(workers=1, check=_until_unwanted(), **settings)
        (ended,) = pool.run([dataclasses.replace(task, payload=order, log=folder / "log.txt")])
        files = {file.name: file.read_bytes() for file in folder.iterdir() if not file.name.endswith(".part")}
    return Parcel(dataclasses.replace(ended, task=dataclasses.replace(task, payload=None)), files)


def _own_place() -> str:
    """Return the folder of this Dask worker, which the next one removes when this one is killed."""
    from distributed import get_worker

    return str(get_worker().local_directory)


def _until_unwanted() -> Callable[[], None]:
    """Return what raises CancelledError once the scheduler has released the Dask task that this is called in.

    Dask does not stop a task that runs; its worker only notes that the result will not be used.
    """
    from distributed import get_worker

    worker: Any = get_worker()
    key = worker.get_current_task()

    def check() -> None:
        task = worker.state.tasks.get(key)
        if task is None or task.state == "cancelled":
            raise CancelledError

    return check


def _unpacked(task: Task, future: Any) -> Ended:
    """Write the files that came back where a local run would have left them."""
    try:
        parcel: Parcel = future.result()
    except CancelledError:
        reason = "on the cluster: the connection to the scheduler was lost before this scenario was done"
        return Ended(task, Ending.CRASHED, None, reason, 0.0, 0)
    except Exception as error:  # the machine that ran it is gone too often, or replay is not installed there
        reason = " ".join(str(error).split()) or type(error).__name__
        return Ended(task, Ending.CRASHED, None, f"on the cluster: {reason}", 0.0, 0)
    folder = task.payload.folder
    try:
        (folder / f"{task.name}.rrd").unlink(missing_ok=True)  # so that at no moment it stands beside another's log
        for name, data in sorted(parcel.files.items()):
            write_file(folder / Path(name).name, data)
    except NoSpaceError:
        raise
    except (WriteError, OSError) as error:
        return Ended(task, Ending.CRASHED, None, str(error), parcel.ended.seconds, parcel.ended.memory)
    value = parcel.ended.value
    if isinstance(value, CaseResult):
        value = dataclasses.replace(value, no_space=False)  # the full disk is another machine's
    if isinstance(value, CaseResult) and value.recordings is not None:
        found = value.recordings
        moved = dataclasses.replace(found, mcap=folder / found.mcap.name, rrd=found.rrd and folder / found.rrd.name)
        value = dataclasses.replace(value, recordings=moved)
    return dataclasses.replace(parcel.ended, task=task, value=value)
