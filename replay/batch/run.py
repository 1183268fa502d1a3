"""Many scenarios into a run folder: recordings, result.json and log.txt for each, run.json for all.

Every scenario runs in a worker process; see `batch.pool`. Results do not depend on how many there are.
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import errno
import json
import os
import platform
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import psutil

import replay
from replay.batch.case import CaseOrder, CaseResult, Status, describe, run_case
from replay.batch.cost import expected_cost
from replay.batch.pool import Ended, Ending, Pool, Task
from replay.batch.prepare import PrepareKernels, needs_of
from replay.batch.resume import earlier_result
from replay.batch.tls import Certificates
from replay.batch.watch import Unwatched, Watch
from replay.batch.written import RESULT
from replay.errors import NoSpaceError, RecordingExistsError, WriteError, printable
from replay.logs.part_file import append_lines, refuse_link, write_file
from replay.scenario.methods import Model
from replay.scenario.model import Scenario

_STATUS = {Ending.CRASHED: Status.CRASHED, Ending.TIMEOUT: Status.TIMEOUT, Ending.MEMORY: Status.MEMORY}


@dataclass(frozen=True)
class Execution:
    """How scenarios are run; nothing of this changes a result.

    Attributes:
        workers: processes; None for as many as there are cores, and never more than scenarios.
        timeout: longest time of one scenario [s]; None for none.
        memory: most resident memory of one scenario [bytes]; None for any.
        dask: address of a Dask scheduler that runs them instead of this machine.
        certificates: for TLS with that scheduler; `distributed`'s own configuration if None.
    """

    workers: int | None = None
    timeout: float | None = None
    memory: int | None = None
    dask: str | None = None
    certificates: Certificates | None = None


@dataclass(frozen=True)
class Run:
    """What became of a run.

    Attributes:
        directory: the run folder.
        results: of each scenario, in the order in which they were given.
        interrupted: it was ended before all scenarios were.
        started: when.
        seconds: wall time.
        workers: number of processes.
    """

    directory: Path
    results: tuple[CaseResult, ...]
    interrupted: bool
    started: datetime.datetime
    seconds: float
    workers: int

    @property
    def passed(self) -> bool:
        """Whether every scenario was recorded and kept its expectations."""
        return all(result.status is Status.PASSED for result in self.results)


def run_all(
    scenarios: Sequence[Scenario],
    directory: str | Path,
    *,
    model: Model | None = None,
    rrd: bool = True,
    savings: bool = True,
    overwrite: bool = False,
    resume: bool = False,
    failed: Sequence[CaseResult] = (),
    execution: Execution | None = None,
    watch: Watch | None = None,
) -> Run:
    """Run scenarios, each into DIRECTORY/NAME/, and write DIRECTORY/run.json.

    A scenario that fails, crashes, hangs, eats memory or has a folder that cannot be written does not stop the others;
    its result says so. An interrupt (Ctrl-C) ends all processes and is told by `interrupted`; what was finished stays.
    Until it is over the run folder says that it was interrupted, so that one that was killed is never taken for whole.

    Args:
        scenarios: what to run.
        directory: the run folder; made when it is not there.
        model: replaces the scenarios' own models.
        rrd: whether to make rerun recordings too.
        savings: see `simulation.simulate`.
        overwrite: replace recordings that exist; one whose scenario now fails is removed.
        resume: keep the results of an earlier run that are still valid, and replace the others.
        failed: results of scenarios that failed before they could be run; they come last.
        execution: where, and within which limits.
        watch: follows the run.

    Raises:
        RecordingExistsError: a recording exists and may not be overwritten; nothing is run then.
        WriteError: the run folder cannot be written; NoSpaceError when the disk becomes full.
        InvalidValue: the address of a Dask scheduler is none; nothing is written then.
        MissingPackageError: a Dask cluster is asked for, and `distributed` is not installed; nothing is written then.
        WorkerError: worker processes cannot be started.
    """
    execution, watch, directory = execution or Execution(), watch or Unwatched(), Path(directory)
    if execution.dask is not None:  # before anything is written
        from replay.batch.cluster import check_address

        check_address(execution.dask, execution.certificates)
    started = datetime.datetime.now(datetime.UTC)
    results: dict[str, CaseResult] = {}
    if resume:
        results = _reused(scenarios, directory, model=model, rrd=rrd, savings=savings, watch=watch)
    elif not overwrite:
        for name in (*(scenario.name for scenario in scenarios), *(result.name for result in failed)):
            for recording in (directory / name / f"{name}{kind}" for kind in (".mcap", ".rrd")):
                if recording.exists():
                    raise RecordingExistsError(str(recording), resumable=True)
    left = [scenario for scenario in scenarios if scenario.name not in results]
    costs = {scenario.name: expected_cost(scenario) for scenario in left}
    workers = min(execution.workers or os.cpu_count() or 1, max(len(left), 1))
    interrupted = True

    def write_summary() -> Run:
        lost = "the run was ended before this scenario was"
        ended = [results.get(s.name, CaseResult(s.name, Status.INTERRUPTED, error=lost)) for s in scenarios]
        ended += failed
        seconds = (datetime.datetime.now(datetime.UTC) - started).total_seconds()
        run = Run(directory, tuple(ended), interrupted, started, seconds, workers)
        write_file(directory / "run.json", json.dumps(as_json(run), indent=1) + "\n")
        return run

    write_summary()
    for result in failed:
        _remove_unfinished(directory / result.name)  # with what an earlier run said
        _finish(result, directory / result.name)
    try:
        watch.plan(costs)
        tasks = []
        for scenario in left:
            log = directory / scenario.name / "log.txt"
            try:
                refuse_link(log.parent)
                write_file(log, "")
            except WriteError as error:
                results[scenario.name] = _unwritable(scenario.name, error)
                watch.done(results[scenario.name])
                continue
            order = CaseOrder(scenario, log.parent, model, rrd, savings)
            tasks.append(Task(scenario.name, order, costs[scenario.name], log))
        with contextlib.closing(_endings(tasks, workers, execution, watch)) as endings:
            for ended in endings:
                result = _finish(_result(ended), ended.task.payload.folder)
                results[result.name] = result
                watch.done(result)
                if result.no_space:
                    raise NoSpaceError(str(directory), os.strerror(errno.ENOSPC))
        interrupted = False
    except KeyboardInterrupt:
        for scenario in left:
            if scenario.name not in results:
                _remove_unfinished(directory / scenario.name)
    return write_summary()


def _endings(tasks: Sequence[Task], workers: int, execution: Execution, watch: Watch) -> Generator[Ended]:
    orders = [task.payload for task in tasks]
    needs = {need: None for order in orders for need in needs_of([order.scenario], order.model)}
    limits: dict[str, Any] = {
        "timeout": execution.timeout,
        "memory": execution.memory,
        "prepare": PrepareKernels(
            tuple(needs),
            rrd=any(order.rrd for order in orders),
            savings=all(order.savings for order in orders),
        ),
        "follow": watch.follow,
        "check": watch.check,
    }
    cores = execution.workers or os.cpu_count() or 1
    if execution.dask is not None:
        from replay.batch.cluster import Cluster

        cluster = Cluster(execution.dask, run_case, certificates=execution.certificates, tell=watch.tell, **limits)
        yield from cluster.run(tasks)
    else:
        pool = Pool(run_case, workers=workers, helpers=cores, tell=watch.tell, preparing=watch.prepare, **limits)
        yield from pool.run(tasks)


def _reused(
    scenarios: Sequence[Scenario], directory: Path, *, model: Model | None, rrd: bool, savings: bool, watch: Watch
) -> dict[str, CaseResult]:
    results = {}
    for scenario in scenarios:
        found = earlier_result(scenario, directory / scenario.name, model=model, rrd=rrd, savings=savings)
        if isinstance(found, CaseResult):
            results[scenario.name] = found
            watch.tell(f"{scenario.name}: reused")
        else:
            watch.tell(f"{scenario.name}: runs again: {found}")
    return results


def _result(ended: Ended) -> CaseResult:
    if ended.ending is Ending.DONE:
        result: CaseResult = dataclasses.replace(ended.value, memory=ended.memory)
        return result
    return CaseResult(
        ended.task.name, _STATUS[ended.ending], error=ended.reason, seconds=ended.seconds, memory=ended.memory
    )


def _finish(result: CaseResult, folder: Path) -> CaseResult:
    """Leave the folder as the result says: no recording of an earlier run beside the failure of this one.

    Returns:
        The result, or that the folder cannot be written.
    """
    try:
        refuse_link(folder)
        for kind in () if result.status.recorded else (".mcap", ".rrd"):
            with contextlib.suppress(OSError):
                (folder / f"{result.name}{kind}").unlink(missing_ok=True)
        write_file(folder / RESULT, json.dumps(result.as_json(), indent=1) + "\n")
        append_lines(folder / "log.txt", map(printable, describe(result)))
    except WriteError as error:
        return dataclasses.replace(_unwritable(result.name, error), seconds=result.seconds, memory=result.memory)
    return result


def _unwritable(name: str, error: WriteError) -> CaseResult:
    """Return the result of a scenario whose folder cannot be written; a full disk ends the run."""
    if isinstance(error, NoSpaceError):
        raise error
    return CaseResult(name, Status.FAILED, error=str(error))


def _remove_unfinished(folder: Path) -> None:
    """Remove what a scenario that was ended has written; what an earlier run left stays."""
    for file in (*folder.glob("*.part"), folder / "log.txt") if not folder.is_symlink() else ():
        with contextlib.suppress(OSError):
            file.unlink(missing_ok=True)


def as_json(run: Run) -> dict[str, object]:
    """Return what run.json holds: what belongs to this machine and this moment, which recordings do not know."""
    return {
        "replay": replay.__version__,
        "host": platform.node(),
        "platform": platform.platform(),
        "python": platform.python_version(),
        "cores": os.cpu_count(),
        "memory": psutil.virtual_memory().total,
        "workers": run.workers,
        "started": run.started.isoformat(timespec="seconds"),
        "seconds": round(run.seconds, 3),
        "interrupted": run.interrupted,
        "planned": len(run.results),
        "scenarios": {
            result.name: {
                "status": result.status.value,
                "seconds": round(result.seconds, 3),
                "memory": result.memory,
                **({"error": result.error} if result.error else {}),
                **({"reused": True} if result.reused else {}),
            }
            for result in run.results
        },
    }
