"""A local Dask cluster: the same verdicts and the same bytes as without, also when one of its workers is killed."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import psutil
import pytest
from distributed import Client

from replay.batch.case import Status
from replay.batch.run import Execution, Unwatched, run_all
from replay.cli.exit_codes import ExitCode
from replay.errors import InvalidValue, WorkerError
from tests.batch import scenes
from tests.batch.test_run import files_of
from tests.cli.test_regress import check_verdicts, night, prepare

ROOT = Path(__file__).parents[2]


@pytest.fixture
def cluster(tmp_path):
    """Yield the scheduler's address and the pids of two workers."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DASK_DISTRIBUTED__SCHEDULER__WORK_STEALING": "False"}
    address = tmp_path / "scheduler.json"
    options = {"cwd": tmp_path, "env": environment, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}

    def dask(name, *more):
        command = [sys.executable, "-m", f"distributed.cli.dask_{name}", "--scheduler-file", str(address), *more]
        return subprocess.Popen(command, **options)

    scheduler = dask("scheduler", "--port", "0", "--no-dashboard")
    common = ("--nthreads", "1", "--no-nanny", "--no-dashboard", "--local-directory", str(tmp_path))
    workers = [dask("worker", *common) for _ in range(2)]
    try:
        while not address.is_file():
            time.sleep(0.1)
            assert scheduler.poll() is None
        listening = json.loads(address.read_text())["address"]
        with Client(listening, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(len(workers), timeout=60)  # or the first to come gets every task
        yield listening, workers
    finally:
        for process in (*workers, scheduler):
            family = psutil.Process(process.pid).children(recursive=True) if process.poll() is None else []
            process.kill()
            process.wait()
            for member in family:
                member.kill()


def test_a_cluster_gives_the_same_even_when_a_worker_is_killed(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    address, workers = cluster
    names = ["crash", "hang", *(f"good_{k}" for k in range(3))]
    scenarios = [scenes.scene(name) for name in names]

    class Killer(Unwatched):
        def done(self, result):
            if result.name.startswith("good") and workers[0].poll() is None:
                workers[0].send_signal(signal.SIGKILL)

    limits = {"timeout": 6.0, "memory": 2 << 30}
    there = tmp_path / "there"
    run = run_all(scenarios, there, rrd=False, execution=Execution(dask=address, **limits), watch=Killer())
    statuses = {result.name: result.status for result in run.results}
    assert statuses.pop("crash") is Status.CRASHED
    assert statuses.pop("hang") is Status.TIMEOUT
    assert set(statuses.values()) == {Status.PASSED}
    assert workers[0].wait() == -signal.SIGKILL
    assert "about to crash" in (there / "crash" / "log.txt").read_text()
    here = tmp_path / "here"
    run_all(scenarios, here, rrd=False, execution=Execution(workers=2, **limits))
    assert files_of(there) == files_of(here)
    assert all(result.recordings is None or result.recordings.mcap.is_file() for result in run.results)


@pytest.mark.soak
def test_a_night_of_two_hundred_on_a_cluster_that_loses_a_worker(cluster, tmp_path, monkeypatch):
    address, workers = cluster
    counts = {"plain": 175, "bad": 5, "differing": 10}
    prepare(tmp_path, **counts)
    local = files_of(tmp_path / "first")
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    out = tmp_path / "night"

    def kill():
        while len(list(out.glob("*/result.json"))) < 60:
            time.sleep(0.1)
        workers[0].send_signal(signal.SIGKILL)

    threading.Thread(target=kill, daemon=True).start()
    before = {process.pid for process in psutil.Process(workers[1].pid).children(recursive=True)}
    assert night(tmp_path, out, "--dask", address, "--rrd", "none") is ExitCode.FAILED
    assert workers[0].wait() == -signal.SIGKILL
    check_verdicts(out, **counts)
    assert {process.pid for process in psutil.Process(workers[1].pid).children(recursive=True)} == before
    there = files_of(out)
    same = [name for name in local if name.parts[0].startswith("plain")]
    assert len(same) == 2 * counts["plain"]
    assert all(there[name] == local[name] for name in same)


def test_an_interrupted_run_ends_its_processes_on_the_cluster(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    address, workers = cluster

    def computing():
        return [child for worker in workers for child in psutil.Process(worker.pid).children(recursive=True)]

    class Impatient(Unwatched):
        """Asks to stop as soon as one scenario is done, while another hangs."""

        def done(self, result):
            raise KeyboardInterrupt

    before = computing()
    scenarios = [scenes.scene("good"), scenes.scene("hang", duration=2), scenes.scene("good_1")]
    run = run_all(scenarios, tmp_path / "out", rrd=False, execution=Execution(dask=address), watch=Impatient())
    assert run.interrupted
    statuses = {result.name: result.status for result in run.results}
    assert statuses.pop("hang") is Status.INTERRUPTED
    assert sorted(statuses.items()) in (  # which of two equally long ones comes first is the scheduler's choice
        [("good", Status.PASSED), ("good_1", Status.INTERRUPTED)],
        [("good", Status.INTERRUPTED), ("good_1", Status.PASSED)],
    )
    end = time.monotonic() + 10.0
    while computing() != before and time.monotonic() < end:
        time.sleep(0.05)
    assert computing() == before


@pytest.mark.parametrize("address", ["foo", "", "tcp://host", "tcp://host:port"])
def test_an_address_without_a_port_is_refused_at_once(tmp_path, address):
    with pytest.raises(InvalidValue, match="tcp://host:8786"):
        run_all([scenes.scene("a")], tmp_path, execution=Execution(dask=address))
    assert list(tmp_path.iterdir()) == []


def test_a_scheduler_that_does_not_answer_is_an_error(tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.cluster._SECONDS_TO_CONNECT", 1)
    with pytest.raises(WorkerError, match="does not answer"):
        run_all([scenes.scene("a")], tmp_path, execution=Execution(dask="tcp://127.0.0.1:9"))
