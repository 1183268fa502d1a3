"""Scenarios on a Dask cluster: inputs travel with the task, files come back with the result.

Each scenario runs in a worker process of its own on the machine that takes it, so that a crash, a hang or a lack of
memory ends that process and not the cluster's. A task whose machine goes away is given to another one by Dask. When
nobody waits for a task any more, because its run was ended, its process is ended too.
"""

from __future__ import annotations

import contextlib
import dataclasses
import tempfile
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, CancelledError, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.batch.case import CaseOrder, CaseResult
from replay.batch.pool import Ended, Ending, Pool, Task
from replay.batch.worker import Prepare, Work
from replay.errors import InvalidValue, MissingPackageError, NoSpaceError, WorkerError, WriteError
from replay.logs.part_file import write_file

_SECONDS_TO_CONNECT = 30
_SECONDS_BETWEEN_CHECKS = 0.1


@dataclass(frozen=True)
class Parcel:
    """What comes back from the cluster: how the scenario ended, and its files by name."""

    ended: Ended
    files: dict[str, bytes]


def check_address(address: str) -> None:
    """Refuse what is no address of a scheduler; the library takes a minute and a traceback to say so.

    Raises:
        MissingPackageError: `distributed` is not installed.
        InvalidValue: the address is none.
    """
    try:
        from distributed.comm.addressing import parse_address, parse_host_port
    except ImportError:
        raise MissingPackageError("distributed", "--dask", "pip install 'replay[dask]'") from None
    try:
        parse_host_port(parse_address(address)[1])
    except ValueError:
        rule = "must be the scheduler's address and port, such as tcp://host:8786"
        raise InvalidValue("dask", address, rule) from None


class Cluster:
    """Runs tasks as `Pool` does, on the workers of a Dask scheduler.

    Args:
        address: of the scheduler, such as tcp://host:8786; see `check_address`.
        work: importable by name on every machine; called with a `CaseOrder`.
        timeout, memory: limits of one task, as of `Pool`.
        prepare: called before the task, in the process that runs it.
        follow: called with (name, 0, 0) when a task is handed over.
        check: called about ten times a second; what it raises ends the run.
        undisturbed: as of `Pool`.
    """

    def __init__(
        self,
        address: str,
        work: Work,
        *,
        timeout: float | None = None,
        memory: int | None = None,
        prepare: Prepare | None = None,
        follow: Callable[[str, int, int], None] = lambda name, done, total: None,
        check: Callable[[], None] = lambda: None,
        undisturbed: Callable[[], contextlib.AbstractContextManager[None]] = contextlib.nullcontext,
    ) -> None:
        self._address = address
        self._settings: dict[str, Any] = {"work": work, "timeout": timeout, "memory": memory, "prepare": prepare}
        self._follow = follow
        self._check = check
        self._undisturbed = undisturbed

    def run(self, tasks: Sequence[Task]) -> Generator[Ended]:
        """Yield what became of each task, in the order in which they end; close the iterator to stop early.

        Raises:
            WorkerError: the scheduler does not answer.
            NoSpaceError: the disk is too full for a file that came back.
        """
        from distributed import Client

        try:
            client: Any = Client(self._address, timeout=_SECONDS_TO_CONNECT, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise WorkerError(f"the Dask scheduler {self._address} does not answer ({error})") from None
        with contextlib.closing(client), self._undisturbed():
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
            finally:
                executor.shutdown(wait=False)  # cancels what is not done; to wait for it would be to wait for a hang


def run_remotely(task: Task, settings: dict[str, Any]) -> Parcel:
    """Run one task in a process of its own on this machine, in a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="replay-") as name:
        folder = Path(name)
        order: CaseOrder = dataclasses.replace(task.payload, folder=folder)
        pool = Pool(workers=1, check=_until_unwanted(), **settings)
        (ended,) = pool.run([dataclasses.replace(task, payload=order, log=folder / "log.txt")])
        files = {file.name: file.read_bytes() for file in folder.iterdir() if not file.name.endswith(".part")}
    return Parcel(dataclasses.replace(ended, task=dataclasses.replace(task, payload=None)), files)


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
    except Exception as error:  # the machine that ran it is gone too often, or replay is not installed there
        return Ended(task, Ending.CRASHED, None, f"on the cluster: {error}", 0.0, 0)
    folder = task.payload.folder
    try:
        (folder / f"{task.name}.rrd").unlink(missing_ok=True)  # so that at no moment it stands beside another's log
        for name, data in sorted(parcel.files.items()):
            write_file(folder / name, data)
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
