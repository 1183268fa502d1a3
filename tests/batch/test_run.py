"""Runs of many scenarios: verdicts, files, resuming, shards, and Ctrl-C."""

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from replay.batch.case import CaseStatus
from replay.batch.cost import expected_cost
from replay.batch.prepare import needs_of
from replay.batch.run import Execution, Unwatched, run_all
from replay.batch.shard import Shard
from replay.errors import InvalidValue, NoSpaceError, RecordingExistsError
from replay.logs.part_file import write_file
from replay.scenario.methods import BUILTIN_MODELS, Model
from tests.batch import scenes

TWO = Execution(workers=2)


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
    limits = Execution(workers=2, timeout=3.0, memory=600 << 20)
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
    assert summary["scenarios"]["hang"]["error"] == "stopped: still running after the time limit of 3 s"
    assert summary["scenarios"]["eat"]["memory"] > 600 << 20
    assert json.loads((tmp_path / "eat" / "result.json").read_text())["status"] == "memory"
    assert {process.pid for process in psutil.Process().children(recursive=True)} == before


MODELS = {
    "its own": None,
    "the thesis's": BUILTIN_MODELS["thesis2015"],
    "convex pieces by FCL, rays": Model.model_validate(
        {
            "collision": {"bounds": "aabb", "narrowphase": "fcl", "pieces": "convex", "clearance": "always"},
            "distance": {"method": "rays"},
            "capacitive": {"method": "exact"},
        }
    ),
    "triangles by FCL": Model.model_validate({"collision": {"bounds": "sphere", "narrowphase": "fcl"}}),
}


CALLED = """
import gc, pickle, sys, replay
from replay.batch.prepare import PrepareKernels, needs_of
from replay.batch.worker import Messages
scenario, model, savings = pickle.load(sys.stdin.buffer)
PrepareKernels(needs_of([scenario], model), savings=savings)(Messages(lambda message: None))
from replay.numerics.jit.compiler import KernelDispatcher
kernels = [kernel for kernel in gc.get_objects() if isinstance(kernel, KernelDispatcher)]
ready = {(kernel.py_func.__qualname__, types) for kernel in kernels for types in kernel.overloads}
for block in replay.simulate(scenario, model=model, savings=savings): pass
kernels = [kernel for kernel in gc.get_objects() if isinstance(kernel, KernelDispatcher)]
called = {(kernel.py_func.__qualname__, types) for kernel in kernels for types in kernel.overloads}
rare = {kernel.py_func.__qualname__ for kernel in kernels if hasattr(kernel, "rare")}
print(len(ready), sorted(str(each) for each in called - ready if each[0] not in rare))
"""


@pytest.mark.parametrize("savings", [True, False])
@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_kernels_are_all_compiled_before_the_first_scenario_but_for_rare_ones(model, savings):
    given = pickle.dumps((scenes.with_meshes(), model, savings))
    done = subprocess.run([sys.executable, "-c", CALLED], check=True, capture_output=True, input=given)
    count, missed = done.stdout.decode().split(maxsplit=1)
    assert missed.strip() == "[]"
    assert int(count) > 5


def test_a_sweep_of_numbers_needs_its_kernels_once():
    models = [Model.model_validate({"capacitive": {"rtol": rtol}}) for rtol in (1e-3, 1e-6)]
    models += [Model.model_validate({"distance": {"method": "rays", "count": count}}) for count in (10, 20)]
    scene, meshes = scenes.scene("a"), scenes.with_meshes()
    found = {need for model in models for need in needs_of([scene, scene, meshes], model)}
    assert len(found) == 4  # two methods, with and without meshes
    assert sum(need.meshes for need in found) == 2


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
    assert {str(name) for name in wanted if wanted[name] != again[name]} == {"good1/good1.mcap"}
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


def test_a_folder_that_cannot_be_written_is_the_error_of_its_scenario(tmp_path):
    (tmp_path / "bad").write_text("where its folder should be")
    run = run_all([scenes.scene("bad"), scenes.scene("good")], tmp_path, rrd=False, execution=TWO)
    bad, good = run.results
    assert (bad.status, good.status) == (CaseStatus.FAILED, CaseStatus.PASSED)
    assert (
        bad.error
        == f"{tmp_path / 'bad' / 'log.txt'}: cannot be written: {tmp_path / 'bad'} is a file where a folder is needed"
    )
    (tmp_path / "good" / "result.json").unlink()
    (tmp_path / "good" / "result.json").mkdir()
    (again,) = run_all([scenes.scene("good")], tmp_path, rrd=False, overwrite=True, execution=TWO).results
    assert (again.status, again.recordings) == (CaseStatus.FAILED, None)


def test_a_full_disk_ends_the_run_and_leaves_no_whole_run(tmp_path, monkeypatch):
    def full(path, data):
        if path.name == "result.json":
            raise NoSpaceError(str(path), "No space left on device")
        return write_file(path, data)

    monkeypatch.setattr("replay.batch.case_folder.write_file", full)
    with pytest.raises(NoSpaceError):
        run_all([scenes.scene("good"), scenes.scene("other")], tmp_path, rrd=False, execution=TWO)
    assert json.loads((tmp_path / "run.json").read_text())["interrupted"] is True


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a full disk")
def test_a_disk_that_is_full_for_a_recording_ends_the_run(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "a.mcap.part").symlink_to("/dev/full")
    with pytest.raises(NoSpaceError, match="No space left"):
        run_all([scenes.scene("a"), scenes.scene("b")], tmp_path, rrd=False, execution=Execution(workers=1))
    assert json.loads((tmp_path / "run.json").read_text())["interrupted"] is True
    assert not (tmp_path / "b" / "b.mcap").exists()


@pytest.mark.skipif(os.name != "posix", reason="sends a signal as a terminal does")
def test_ctrl_c_ends_cleanly_with_a_partial_report_and_no_process_left(tmp_path):
    scenes.write(tmp_path / "in", "good")
    scenes.write(tmp_path / "in", "hang", duration=0.5)
    code = (
        "import replay.batch.run as run, signal, sys; from tests.batch import scenes; from replay.cli.main import main;"
        "signal.signal(signal.SIGINT, signal.default_int_handler);"  # a shell's background jobs ignore it
        "run.run_case = scenes.misbehave; main(sys.argv[1:])"
    )
    out = tmp_path / "out"
    arguments = ["run", str(tmp_path / "in"), "-o", str(out), "--no-rrd", "--workers", "1"]
    command = [sys.executable, "-c", code, *arguments]
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        try:
            while not (out / "good" / "result.json").exists():
                time.sleep(0.05)
                assert process.poll() is None
            time.sleep(0.3)
            family = psutil.Process(process.pid).children(recursive=True)
            process.send_signal(signal.SIGINT)
            _, error = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 130, error
    assert "Traceback" not in error
    assert family
    assert not any(member.is_running() for member in family)
    summary = json.loads((out / "run.json").read_text())
    assert summary["interrupted"] is True
    assert {name: entry["status"] for name, entry in summary["scenarios"].items()} == {
        "good": "passed",
        "hang": "interrupted",
    }


FULL = """
mkdir full && mount -t tmpfs -o size={size}k none full
{python} -m replay {command} 2>error.txt
echo $? > code.txt
cp -r full/. left/
"""


def on_a_small_disk(folder, command, size):
    """Run a command where `full` is a disk of some KiB; return its exit code, what it said, and its files."""
    script = FULL.format(size=size, command=command, python=sys.executable)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])}
    (folder / "left").mkdir()
    subprocess.run(["unshare", "-m", "bash", "-c", script], cwd=folder, check=True, env=environment)
    return int((folder / "code.txt").read_text()), (folder / "error.txt").read_text(), folder / "left"


mounts = pytest.mark.skipif(
    sys.platform != "linux" or subprocess.run(["unshare", "-m", "true"], check=False, capture_output=True).returncode,
    reason="needs to mount a small disk",
)


@mounts
@pytest.mark.parametrize("size", [60, 76, 92])
def test_run_json_says_what_was_finished_before_the_disk_was_full(tmp_path, size):
    for k in range(6):
        scenes.write(tmp_path / "in", f"s{k}", duration=3)
    code, error, left = on_a_small_disk(tmp_path, "run in -o full/out --no-rrd --workers 1", size)
    assert code == 2
    assert error.splitlines()[-1].endswith("No space left on device")
    summary = json.loads((left / "out" / "run.json").read_text())
    assert summary["interrupted"] is True
    statuses = {name: entry["status"] for name, entry in summary["scenarios"].items()}
    whole = sorted(file.stem for file in left.glob("out/*/*.mcap"))
    assert sorted(name for name, status in statuses.items() if status == "passed") == whole
    assert 0 < len(whole) < 6
    assert "interrupted" in statuses.values()
    assert all(summary["scenarios"][name].get("error") for name in statuses if name not in whole)
    assert not list(left.rglob("*.part")) and not list(left.rglob(".lock"))


@mounts
def test_the_last_words_find_room_on_a_disk_that_others_have_filled(tmp_path):
    script = """if True:
        import os
        from pathlib import Path
        from replay.batch.case import CaseResult
        from replay.batch.run_file import RunFile
        file = RunFile(Path("full"), ["a", "b"], workers=1)
        file.begin([])
        file.add(CaseResult("a", seconds=1.25, memory=123456789))
        filler = os.open("full/filler", os.O_WRONLY | os.O_CREAT)
        try:
            while True: os.write(filler, bytes(4096))
        except OSError: pass
        run = file.end(interrupted=True)
        print(run.results)
    """
    (tmp_path / "script.py").write_text(script)
    code, error, left = on_a_small_disk(tmp_path, f"--version; {sys.executable} script.py", 64)
    assert (code, error) == (0, "")
    scenarios = json.loads((left / "run.json").read_text())["scenarios"]
    assert {name: entry["status"] for name, entry in scenarios.items()} == {"a": "passed", "b": "interrupted"}
    assert scenarios["b"]["error"] == "the run was ended before this scenario was"


STOPPED = """
import os, signal, sys, threading
import replay.batch.{module} as module
from replay.cli.main import main

def stopping(*arguments, **options):
    for number in (signal.SIGTERM, signal.SIGTERM):  # as `timeout` sends it: to the process and to its group
        os.kill(os.getpid(), number)
    return original(*arguments, **options)

original = module.{name}
module.{name} = stopping
main(sys.argv[1:])
"""


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
@pytest.mark.parametrize(
    ("module", "name"),
    [("run", "finish"), ("case_folder", "append_lines"), ("run_file", "as_json"), ("run", "begin"), ("pool", "_known")],
)
def test_a_request_to_stop_at_any_moment_makes_no_finished_scenario_an_interrupted_one(tmp_path, module, name):
    for k in range(2):
        scenes.write(tmp_path / "in", f"s{k}")
    out = tmp_path / "out"
    code = STOPPED.format(module=module, name=name)
    arguments = ["run", str(tmp_path / "in"), "-o", str(out), "--no-rrd", "--workers", "1"]
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=False)
    assert done.returncode == 130
    assert "Traceback" not in done.stderr
    if not (out / "run.json").exists():
        assert not list(out.rglob("*"))  # it was stopped before it began
        return
    summary = json.loads((out / "run.json").read_text())
    for scenario, entry in summary["scenarios"].items():
        told = (out / scenario / "result.json").exists()
        assert entry["status"] == ("passed" if told else "interrupted")
        assert (out / scenario / f"{scenario}.mcap").exists() >= told
    assert summary["interrupted"] == any(entry["status"] == "interrupted" for entry in summary["scenarios"].values())
    assert not list(out.rglob("*.part")) and not list(out.rglob(".lock"))


def test_a_killed_run_leaves_no_result_of_an_earlier_one_beside_its_recordings(ran, tmp_path, monkeypatch):
    """Resuming would take the earlier result for that of the recording; the expectations may be others."""
    run_all([scenes.scene("crash_a"), scenes.scene("good")], tmp_path, rrd=False, execution=TWO)
    assert (tmp_path / "crash_a" / "result.json").exists()
    monkeypatch.setattr("replay.batch.run.run_case", scenes.look_and_misbehave)
    (found,) = run_all([scenes.scene("good")], tmp_path, rrd=False, overwrite=True, execution=TWO).results
    assert found.notes == ("good.mcap", "log.txt")
