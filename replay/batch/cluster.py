"""Scenarios on a Dask cluster: inputs travel with the task, files come back with the result.

Each scenario runs in a worker process of its own on the machine that takes it, so that a crash, a hang or a lack of
memory ends that process and not the cluster's. A task whose machine goes away is given to another one by Dask.
"""

from __future__ import annotations

import contextlib
import dataclasses
import tempfile
from collections.abc import Callable, Generator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.batch.case import CaseOrder, CaseResult
from replay.batch.pool import Ended, Ending, Pool, Task
from replay.batch.worker import Prepare, Work
from replay.errors import MissingPackageError, WorkerError
from replay.logs.part_file import write_file

_SECONDS_TO_CONNECT = 30


@dataclass(frozen=True)
class Parcel:
    """What comes back from the cluster: how the scenario ended, and its files by name."""

    ended: Ended
    files: dict[str, bytes]


class Cluster:
    """Runs tasks as `Pool` does, on the workers of a Dask scheduler.

    Args:
        address: of the scheduler, such as tcp://host:8786.
        work: importable by name on every machine; called with a `CaseOrder`.
        timeout, memory: limits of one task, as of `Pool`.
        prepare: called before the task, in the process that runs it.
        follow: called with (name, 0, 0) when a task is handed over.
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
    ) -> None:
        self._address = address
        self._settings: dict[str, Any] = {"work": work, "timeout": timeout, "memory": memory, "prepare": prepare}
        self._follow = follow

    def run(self, tasks: Sequence[Task]) -> Generator[Ended]:
        """Yield what became of each task, in the order in which they end; close the iterator to stop early.

        Raises:
            MissingPackageError: `distributed` is not installed.
            WorkerError: the scheduler does not answer.
            WriteError: a file that came back cannot be written.
        """
        try:
            from distributed import Client
        except ImportError:
            raise MissingPackageError("distributed", "--dask", "pip install 'replay[dask]'") from None
        try:
            client: Any = Client(self._address, timeout=_SECONDS_TO_CONNECT, set_as_default=False)  # type: ignore[no-untyped-call]
        except (OSError, ValueError) as error:
            raise WorkerError(f"the Dask scheduler {self._address} does not answer ({error})") from None
        with contextlib.closing(client), client.get_executor(pure=False) as executor:
            ordered = sorted(tasks, key=lambda task: (-task.cost, task.name))
            futures = {executor.submit(run_remotely, task, self._settings): task for task in ordered}
            for task in ordered:
                self._follow(task.name, 0, 0)
            try:
                for future in as_completed(futures):
                    yield _unpacked(futures[future], future)
            finally:
                for future in futures:
                    future.cancel()


def run_remotely(task: Task, settings: dict[str, Any]) -> Parcel:
    """Run one task in a process of its own on this machine, in a folder that is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="replay-") as name:
        folder = Path(name)
        order: CaseOrder = dataclasses.replace(task.payload, folder=folder)
        (ended,) = Pool(workers=1, **settings).run([dataclasses.replace(task, payload=order, log=folder / "log.txt")])
        files = {file.name: file.read_bytes() for file in folder.iterdir() if not file.name.endswith(".part")}
    return Parcel(dataclasses.replace(ended, task=dataclasses.replace(task, payload=None)), files)


def _unpacked(task: Task, future: Any) -> Ended:
    """Write the files that came back where a local run would have left them."""
    try:
        parcel: Parcel = future.result()
    except Exception as error:  # the machine that ran it is gone too often, or replay is not installed there
        return Ended(task, Ending.CRASHED, None, f"crashed: on the cluster: {error}", 0.0, 0)
    folder = task.payload.folder
    for name, data in parcel.files.items():
        write_file(folder / name, data)
    value = parcel.ended.value
    if isinstance(value, CaseResult) and value.recordings is not None:
        found = value.recordings
        moved = dataclasses.replace(found, mcap=folder / found.mcap.name, rrd=found.rrd and folder / found.rrd.name)
        value = dataclasses.replace(value, recordings=moved)
    return dataclasses.replace(parcel.ended, task=task, value=value)
