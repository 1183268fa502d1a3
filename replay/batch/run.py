"""Many scenarios into a run folder: recordings, result.json and log.txt for each, run.json for all.

Every scenario runs in a worker process; see `batch.pool`. Results do not depend on how many there are.
"""

from __future__ import annotations

import contextlib
import dataclasses
import errno
import os
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.batch.case import CaseOrder, CaseResult, CaseStatus, run_case
from replay.batch.case_folder import KINDS, LOG, begin, finish, remove_unfinished, unwritable
from replay.batch.claim import Claim, claim
from replay.batch.cost import expected_cost
from replay.batch.interpreter import Ahead
from replay.batch.pool import Pool
from replay.batch.prepare import PrepareKernels, needs_of
from replay.batch.resume import earlier_result
from replay.batch.run_file import Run, RunFile
from replay.batch.task import Ended, Ending, Task
from replay.batch.tls import Certificates
from replay.batch.watch import Unwatched, Watch
from replay.errors import NoSpaceError, RecordingExistsError, WriteError
from replay.logs.part_file import refuse_link, write_file
from replay.scenario.methods import Model
from replay.scenario.model import Scenario

_STATUS = {Ending.CRASHED: CaseStatus.CRASHED, Ending.TIMEOUT: CaseStatus.TIMEOUT, Ending.MEMORY: CaseStatus.MEMORY}


@dataclass(frozen=True)
class Execution:
    """How scenarios are run; nothing of this changes a result.

    Attributes:
        workers: processes; None for as many as there are cores, and never more than scenarios.
        timeout: longest time of one scenario [s]; None for none.
        memory: most resident memory of one scenario [bytes]; None for any.
        dask: address of a Dask scheduler that runs them instead of this machine.
        certificates: for TLS with that scheduler; `distributed`'s own configuration if None.
        ahead: what the first worker process on this machine begins as, if it has been begun already.
    """

    workers: int | None = None
    timeout: float | None = None
    memory: int | None = None
    dask: str | None = None
    certificates: Certificates | None = None
    ahead: Ahead | None = None


def run_all(
    scenarios: Sequence[Scenario],
    directory: str | Path,
    *,
    model: Model | None = None,
    rrd: bool = True,
    savings: bool = True,
    overwrite: bool = False,
    resume: bool = False,
    whole: bool = True,
    failed: Sequence[CaseResult] = (),
    execution: Execution | None = None,
    watch: Watch | None = None,
) -> Run:
    """Run scenarios, each into DIRECTORY/NAME/, and write DIRECTORY/run.json.

    A scenario that fails, crashes, hangs, eats memory or has a folder that cannot be written does not stop the others;
    its result says so. An interrupt (Ctrl-C) ends all processes and is told by `interrupted`; what was finished stays.
    The run folder is ours alone meanwhile, and until it is over run.json says that it was interrupted, so that one that
    was killed is never taken for whole.

    Args:
        scenarios: what to run.
        directory: the run folder; made when it is not there.
        model: replaces the scenarios' own models.
        rrd: whether to make rerun recordings too.
        savings: see `simulation.simulate`.
        overwrite: replace recordings that exist; one whose scenario now fails is removed.
        resume: keep the results of an earlier run that are still valid, and replace the others.
        whole: nothing is left to be done in the run folder afterwards; otherwise run.json goes on saying "interrupted".
        failed: results of scenarios that failed before they could be run; they come last.
        execution: where, and within which limits.
        watch: follows the run.

    Raises:
        BusyError: another process writes the run folder.
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
    names = [*(scenario.name for scenario in scenarios), *(result.name for result in failed)]
    how: dict[str, Any] = {"model": model, "rrd": rrd, "savings": savings}
    with claim(directory) as claimed:
        known: dict[str, CaseResult] = {}
        if resume:
            known = _reused(scenarios, directory, watch=watch, **how)
        elif not overwrite:
            _refuse_existing(directory, names)
        left = [scenario for scenario in scenarios if scenario.name not in known]
        workers = min(execution.workers or os.cpu_count() or 1, max(len(left), 1))
        file = RunFile(directory, names, workers=workers)
        file.begin([*known.values(), *failed])
        orders = [CaseOrder(scenario, directory / scenario.name, **how) for scenario in left]
        interrupted = True
        try:
            for result in failed:
                remove_unfinished(directory / result.name)  # with what an earlier run said
                _settle(finish(result, directory / result.name), file, directory)
            _run_orders(orders, file, directory, workers, execution, watch, claimed)
            interrupted = False
        except (KeyboardInterrupt, NoSpaceError) as error:
            for order in orders:
                if order.scenario.name not in file:
                    remove_unfinished(order.folder)
            if isinstance(error, NoSpaceError):
                with contextlib.suppress(WriteError):
                    file.end(interrupted=True)
                raise
        with watch.undisturbed():
            return file.end(interrupted=interrupted, whole=whole)


def _run_orders(
    orders: Sequence[CaseOrder],
    file: RunFile,
    directory: Path,
    workers: int,
    execution: Execution,
    watch: Watch,
    claimed: Claim,
) -> None:
    """Run what is left, and take down what becomes of it.

    Raises:
        KeyboardInterrupt: it was ended.
        NoSpaceError: the disk is full.
    """
    costs = {order.scenario.name: expected_cost(order.scenario) for order in orders}
    watch.plan(costs)
    tasks = []
    for order in orders:
        name, log = order.scenario.name, order.folder / LOG
        try:
            refuse_link(order.folder)
            write_file(log, "", lasting=False)  # a thousand that wait for the disk take seconds
        except WriteError as error:
            result = unwritable(CaseResult(name), error)
            _settle(result, file, directory)
            watch.done(result)
            continue
        tasks.append(Task(name, order, costs[name], log))
    with contextlib.closing(_endings(tasks, workers, execution, watch, claimed)) as endings:
        for ended in endings:
            result = _result(ended)
            if result.status.recorded:  # that is true whatever comes next
                file.add(result)
            result = finish(result, ended.task.payload.folder)
            _settle(result, file, directory)
            watch.done(result)


def _settle(result: CaseResult, file: RunFile, directory: Path) -> None:
    """Take down what became of a scenario after all; a full disk ends the run."""
    if result.no_space:
        file.add(result)
        raise NoSpaceError(str(directory), os.strerror(errno.ENOSPC))
    if not result.status.recorded:
        file.add(result)


def _refuse_existing(directory: Path, names: Sequence[str]) -> None:
    for name in names:
        for recording in (directory / name / f"{name}{kind}" for kind in KINDS):
            with contextlib.suppress(OSError):  # where it cannot be looked for, the scenario cannot be written either
                if recording.exists():
                    raise RecordingExistsError(str(recording), resumable=True)


def _endings(
    tasks: Sequence[Task], workers: int, execution: Execution, watch: Watch, claimed: Claim
) -> Generator[Ended]:
    folders = {task.name: task.payload.folder for task in tasks}

    def follow(name: str, done: int, total: int) -> None:
        if not total:
            begin(folders[name])
        watch.follow(name, done, total)

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
        "follow": follow,
        "check": watch.check,
        "undisturbed": watch.undisturbed,
    }
    cores = execution.workers or os.cpu_count() or 1
    if execution.dask is not None:
        from replay.batch.cluster import Cluster

        cluster = Cluster(execution.dask, run_case, certificates=execution.certificates, tell=watch.tell, **limits)
        yield from cluster.run(tasks)
    else:
        limits |= {"tell": watch.tell, "preparing": watch.prepare, "inherit": claimed.handles, "ahead": execution.ahead}
        pool = Pool(run_case, workers=workers, helpers=cores, **limits)
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
