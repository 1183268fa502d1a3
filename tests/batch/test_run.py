"""Runs of many scenarios: verdicts, files, resuming, shards."""

import json

import psutil
import pytest

from replay.batch.case import CaseStatus
from replay.batch.cost import expected_cost
from replay.batch.run import Execution, Unwatched, run_all
from replay.batch.shard import Shard
from replay.errors import InvalidValue, RecordingExistsError
from replay.scenario.methods import BUILTIN_MODELS
from tests.batch import scenes
from tests.batch.scenes import TWO


def files_of(folder):
    names = ("*.mcap", "result.json")
    return {file.relative_to(folder): file.read_bytes() for name in names for file in sorted(folder.rglob(name))}


class Remarks(Unwatched):
    def __init__(self):
        self.said = []

    def tell(self, text):
        if not text.startswith("compiling"):  # whether kernels are in the cache is not what is tested here
            self.said.append(text)


@pytest.fixture(scope="module")
def ran(tmp_path_factory):
    folder = tmp_path_factory.mktemp("ran")
    run_all([scenes.scene(f"good{k}", duration=k + 1) for k in range(3)], folder, rrd=False, execution=TWO)
    return folder


def test_files_are_the_same_bytes_whatever_the_number_of_workers(ran, tmp_path):
    scenarios = [scenes.scene(f"good{k}", duration=k + 1) for k in range(3)]
    run_all(scenarios, tmp_path, rrd=False, execution=Execution(workers=1))
    assert files_of(tmp_path) == files_of(ran)
    assert len(files_of(ran)) == 6


def test_failures_are_told_apart_and_the_others_are_recorded(tmp_path, monkeypatch):
    monkeypatch.setattr("replay.batch.run.run_case", scenes.misbehave)
    before = {process.pid for process in psutil.Process().children(recursive=True)}
    scenarios = [scenes.scene(name) for name in ("good", "crash", "hang", "eat")]
    scenarios.append(scenes.scene("broken", contact="always"))
    (tmp_path / "crash").mkdir()
    (tmp_path / "crash" / "crash.mcap").write_bytes(b"of last night")
    limits = Execution(workers=2, timeout=10.0, memory=600 << 20)
    run = run_all(scenarios, tmp_path, rrd=False, overwrite=True, execution=limits)
    assert {result.name: result.status for result in run.results} == {
        "good": CaseStatus.PASSED,
        "crash": CaseStatus.CRASHED,
        "hang": CaseStatus.TIMEOUT,
        "eat": CaseStatus.MEMORY,
        "broken": CaseStatus.BROKEN,
    }
    assert not run.passed
    assert (tmp_path / "crash" / "log.txt").read_text().splitlines()[:2] == ["about to crash", "crash: crashed"]
    assert not (tmp_path / "crash" / "crash.mcap").exists()
    summary = json.loads((tmp_path / "run.json").read_text())
    assert summary["scenarios"]["hang"]["error"] == "stopped: still running after the time limit of 10 s"
    assert summary["scenarios"]["eat"]["memory"] > 600 << 20
    assert json.loads((tmp_path / "eat" / "result.json").read_text())["status"] == "memory"
    assert {process.pid for process in psutil.Process().children(recursive=True)} == before


def test_resuming_reuses_what_is_still_valid_and_says_why_it_runs_the_rest(ran, tmp_path):
    scenarios = [scenes.scene(f"good{k}", duration=k + 1) for k in range(3)]
    run_all(scenarios, tmp_path, rrd=False, execution=TWO)
    wanted = files_of(tmp_path)
    damaged = bytearray((tmp_path / "good2" / "good2.mcap").read_bytes())
    damaged[len(damaged) // 2] ^= 1
    (tmp_path / "good2" / "good2.mcap").write_bytes(damaged)
    scenarios[1] = scenes.scene("good1", duration=2, distance=1.3)
    remarks = Remarks()
    run = run_all(scenarios, tmp_path, rrd=False, resume=True, execution=TWO, watch=remarks)
    assert [result.reused for result in run.results] == [True, False, False]
    assert remarks.said[0] == "good0: reused"
    assert remarks.said[1] == "good1: runs again: changed: file good1.yaml"
    assert remarks.said[2].startswith("good2: runs again: damaged")
    again = files_of(tmp_path)
    assert {str(name) for name in wanted if wanted[name] != again[name]} == {
        "good1/good1.mcap",
        "good1/result.json",  # with the numbers of its readings
    }
    model = BUILTIN_MODELS["thesis2015"]
    run = run_all(scenarios[:1], tmp_path, rrd=False, resume=True, model=model, execution=TWO, watch=remarks)
    assert remarks.said[3].startswith("good0: runs again: changed: model ")
    run_all(scenarios[:1], tmp_path, rrd=False, overwrite=True, savings=False, execution=TWO)
    run_all(scenarios[:1], tmp_path, rrd=False, resume=True, execution=TWO, watch=remarks)
    assert remarks.said[4] == "good0: runs again: changed: model savings"


def test_recordings_are_kept_unless_told_otherwise(ran):
    with pytest.raises(RecordingExistsError):
        run_all([scenes.scene("good0")], ran)


def test_shards_are_all_scenarios_each_once_and_about_equally_long():
    scenarios = [scenes.scene(f"s{k}", duration=d) for k, d in enumerate((1, 100, 1, 90, 5, 5, 7))]
    shards = [Shard(k, 3).of(scenarios) for k in (1, 2, 3)]
    assert sorted(s.name for shard in shards for s in shard) == sorted(s.name for s in scenarios)
    assert {"s1", "s3"} not in [{s.name for s in shard} for shard in shards]
    assert expected_cost(scenarios[1]) > expected_cost(scenarios[3])
    for wrong in ("0/2", "3/2", "1", "a/b"):
        with pytest.raises(InvalidValue, match="must be i/n"):
            Shard.parse(wrong)


def test_a_killed_run_leaves_no_result_of_an_earlier_one_beside_its_recordings(ran, tmp_path, monkeypatch):
    """Resuming would take the earlier result for that of the recording; the expectations may be others."""
    run_all([scenes.scene("crash_a"), scenes.scene("good")], tmp_path, rrd=False, execution=TWO)
    assert (tmp_path / "crash_a" / "result.json").exists()
    monkeypatch.setattr("replay.batch.run.run_case", scenes.look_and_misbehave)
    (found,) = run_all([scenes.scene("good")], tmp_path, rrd=False, overwrite=True, execution=TWO).results
    assert found.notes == ("good.mcap", "log.txt")
