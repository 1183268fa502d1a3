"""Many scenarios into a run folder: recordings, result.json and log.txt for each, run.json for all.

Every scenario runs in a worker process; see `batch.pool`. Results do not depend on how many there are.
"""

from __future__ import annotations

import contextlib
import dataclasses
import datetime
import json
import os
import platform
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import psutil

import replay
from replay.batch.case import CaseOrder, CaseResult, Status, describe, run_case
from replay.batch.cost import expected_cost
from replay.batch.pool import Ended, Ending, Pool, Task
from replay.batch.prepare import PrepareKernels, needs_of
from replay.batch.resume import RESULT, earlier_result
from replay.errors import RecordingExistsError, WriteError
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
    """

    workers: int | None = None
    timeout: float | None = None
    memory: int | None = None
    dask: str | None = None


class Watch(Protocol):
    """Who follows a run."""

    def plan(self, costs: dict[str, float]) -> None:
        """Take what is going to run: names with expected costs."""

    def follow(self, name: str, done: int, total: int) -> None:
        """Take how many frames of a scenario are done; (name, 0, 0) when it begins."""

    def done(self, result: CaseResult) -> None:
        """Take what became of a scenario."""

    def tell(self, text: str) -> None:
        """Take a remark."""


class Unwatched:
    """Nobody follows."""

    def plan(self, costs: dict[str, float]) -> None:
        """Do nothing."""

    def follow(self, name: str, done: int, total: int) -> None:
        """Do nothing."""

    def done(self, result: CaseResult) -> None:
        """Do nothing."""

    def tell(self, text: str) -> None:
        """Do nothing."""


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
    execution: Execution | None = None,
    watch: Watch | None = None,
) -> Run:
    """Run scenarios, each into DIRECTORY/NAME/, and write DIRECTORY/run.json.

    A scenario that fails, crashes, hangs or eats memory does not stop the others; its result says so. An interrupt
    (Ctrl-C) ends all processes and is told by `interrupted`; what was finished is kept.

    Args:
        scenarios: what to run.
        directory: the run folder; made when it is not there.
        model: replaces the scenarios' own models.
        rrd: whether to make rerun recordings too.
        savings: see `simulation.simulate`.
        overwrite: replace recordings that exist; one whose scenario now fails is removed.
        resume: keep the results of an earlier run that are still valid, and replace the others.
        execution: where, and within which limits.
        watch: follows the run.

    Raises:
        RecordingExistsError: a recording exists and may not be overwritten; nothing is run then.
        WriteError: the run folder cannot be written.
        WorkerError: worker processes cannot be started.
    """
    execution, watch, directory = execution or Execution(), watch or Unwatched(), Path(directory)
    started = datetime.datetime.now(datetime.UTC)
    results: dict[str, CaseResult] = {}
    if resume:
        results = _reused(scenarios, directory, model=model, rrd=rrd, savings=savings, watch=watch)
    elif not overwrite:
        for scenario in scenarios:
            for recording in (directory / scenario.name / f"{scenario.name}{kind}" for kind in (".mcap", ".rrd")):
                if recording.exists():
                    raise RecordingExistsError(str(recording))
    left = [scenario for scenario in scenarios if scenario.name not in results]
    costs = {scenario.name: expected_cost(scenario) for scenario in left}
    watch.plan(costs)
    tasks = []
    for scenario in left:
        folder = directory / scenario.name
        write(folder / "log.txt", "")
        order = CaseOrder(scenario, folder, model, rrd, savings)
        tasks.append(Task(scenario.name, order, costs[scenario.name], folder / "log.txt"))
    interrupted = False
    workers = min(execution.workers or os.cpu_count() or 1, max(len(tasks), 1))
    try:
        with contextlib.closing(_endings(tasks, workers, execution, watch)) as endings:
            for ended in endings:
                result = _result(ended)
                _finish(result, ended.task.payload.folder)
                results[result.name] = result
                watch.done(result)
    except KeyboardInterrupt:
        interrupted = True
    for scenario in scenarios if interrupted else ():
        if scenario.name not in results:
            _remove_unfinished(directory / scenario.name)
        lost = CaseResult(scenario.name, Status.INTERRUPTED, error="the run was ended before this scenario was")
        results.setdefault(scenario.name, lost)
    seconds = (datetime.datetime.now(datetime.UTC) - started).total_seconds()
    ordered = tuple(results[scenario.name] for scenario in scenarios)
    run = Run(directory, ordered, interrupted, started, seconds, workers)
    write(directory / "run.json", json.dumps(as_json(run), indent=1) + "\n")
    return run


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
    }
    if execution.dask is not None:
        from replay.batch.cluster import Cluster

        yield from Cluster(execution.dask, run_case, **limits).run(tasks)
    else:
        yield from Pool(run_case, workers=workers, tell=watch.tell, **limits).run(tasks)


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


def _finish(result: CaseResult, folder: Path) -> None:
    """Leave the folder as the result says: no recording of an earlier run beside the failure of this one."""
    if not result.status.recorded:
        for kind in (".mcap", ".rrd"):
            with contextlib.suppress(OSError):
                (folder / f"{result.name}{kind}").unlink(missing_ok=True)
    write(folder / RESULT, json.dumps(result.as_json(), indent=1) + "\n")
    try:
        with (folder / "log.txt").open("a", encoding="utf-8") as log:
            log.writelines(f"{line}\n" for line in describe(result))
    except OSError as error:
        raise WriteError(str(folder / "log.txt"), error.strerror or str(error)) from None


def _remove_unfinished(folder: Path) -> None:
    """Remove what a scenario that was ended has written; what an earlier run left stays."""
    for file in (*folder.glob("*.part"), folder / "log.txt"):
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


def write(path: Path, text: str) -> None:
    """Write a text file and the folders that it needs; WriteError when that is not possible."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise WriteError(str(path), error.strerror or str(error)) from None
