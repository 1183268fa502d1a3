"""A local Dask cluster: the same verdicts and the same bytes as without, also when one of its workers is killed."""

import io
import logging
import signal
import threading
import time

import psutil
import pytest
from distributed import Client

from replay.batch.case import CaseStatus
from replay.batch.run import Execution, Unwatched, run_all
from replay.cli.exit_codes import ExitCode
from replay.errors import InvalidValue, WorkerError
from tests.batch import clusters, scenes
from tests.batch.test_run import Remarks, files_of
from tests.cli.nights import check_verdicts, night, prepare


@pytest.fixture
def cluster(tmp_path):
    """Yield the scheduler's address and two workers."""
    with clusters.cluster(tmp_path) as found:
        with Client(found.address, timeout=60, set_as_default=False) as client:
            client.wait_for_workers(2, timeout=60)  # or the first to come gets every task
        yield found


def test_a_cluster_gives_the_same_even_when_a_worker_is_killed(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    address, workers = cluster.address, cluster.workers
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
    assert statuses.pop("crash") is CaseStatus.CRASHED
    assert statuses.pop("hang") is CaseStatus.TIMEOUT
    assert set(statuses.values()) == {CaseStatus.PASSED}
    assert workers[0].wait() == -signal.SIGKILL
    assert "about to crash" in (there / "crash" / "log.txt").read_text()
    here = tmp_path / "here"
    run_all(scenarios, here, rrd=False, execution=Execution(workers=2, **limits))
    assert files_of(there) == files_of(here)
    assert all(result.recordings is None or result.recordings.mcap.is_file() for result in run.results)


@pytest.mark.soak
def test_a_night_of_two_hundred_on_a_cluster_that_loses_a_worker(cluster, tmp_path, monkeypatch):
    address, workers = cluster.address, cluster.workers
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
    assert night(tmp_path, out, "--dask", address, "--rrd", "none", "--timeout", "6s") is ExitCode.FAILED
    assert workers[0].wait() == -signal.SIGKILL
    check_verdicts(out, **counts)
    assert {process.pid for process in psutil.Process(workers[1].pid).children(recursive=True)} == before
    there = files_of(out)
    same = [name for name in local if name.parts[0].startswith("plain")]
    assert len(same) == 2 * counts["plain"]
    assert all(there[name] == local[name] for name in same)


def test_an_interrupted_run_ends_its_processes_on_the_cluster(cluster, tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    address, workers = cluster.address, cluster.workers

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
    assert statuses.pop("hang") is CaseStatus.INTERRUPTED
    assert sorted(statuses.items()) in (  # which of two equally long ones comes first is the scheduler's choice
        [("good", CaseStatus.PASSED), ("good_1", CaseStatus.INTERRUPTED)],
        [("good", CaseStatus.INTERRUPTED), ("good_1", CaseStatus.PASSED)],
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


def test_a_scheduler_without_workers_is_told_and_given_up_in_the_end(tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.cluster._SECONDS_TO_WAIT", 6.0)
    remarks = Remarks()
    with clusters.cluster(tmp_path, workers=0) as found:
        execution = Execution(dask=found.address)
        run = run_all([scenes.scene("a"), scenes.scene("b")], tmp_path / "out", execution=execution, watch=remarks)
    waiting = "has no workers; waiting for one"
    assert [waiting in remark and found.address in remark for remark in remarks.said] == [True]
    assert [result.error for result in run.results] == ["on the cluster: there has been no worker for 0 min"] * 2
    assert not run.interrupted


def test_a_scheduler_that_dies_is_one_line_a_scenario(cluster, tmp_path, monkeypatch, capfd):
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    monkeypatch.setattr("replay.batch.cluster._SECONDS_TO_CONNECT", 5)

    class Killer(Unwatched):
        def done(self, result):
            if result.name == "good":
                cluster.scheduler.send_signal(signal.SIGKILL)

    scenarios = [scenes.scene("good", duration=3), *(scenes.scene(f"hang_{k}") for k in range(3))]
    logged = io.StringIO()
    handler = logging.StreamHandler(logged)
    for name in ("distributed", "distributed.client"):
        monkeypatch.setattr(logging.getLogger(name), "handlers", [handler])
    out = tmp_path / "out"
    run = run_all(scenarios, out, rrd=False, execution=Execution(dask=cluster.address), watch=Killer())
    lost = "on the cluster: the connection to the scheduler was lost before this scenario was done"
    assert {result.name: result.error for result in run.results} == {
        "good": "",
        **{f"hang_{k}": lost for k in range(3)},
    }
    assert not run.interrupted
    assert (logged.getvalue(), capfd.readouterr().err) == ("", "")
