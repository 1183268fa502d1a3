"""The commands as a user meets them: output, files, exit codes."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rerun as rr

import replay
import replay.batch.run
import replay.batch.select
from replay.cli.exit_codes import ExitCode, worst
from replay.cli.main import run
from tests.batch import scenes

SCENARIO = """
version: 1
name: swing
rate: 60 Hz
duration: 1 s
tags: [quick]
links:
  wall: {shapes: {slab: {type: cuboid, size: [0.1, 2, 2], pose: {xyz: [1.2, 0, 0]}}}}
  arm:
    joint: {name: swing, type: revolute, axis: [0, 1, 0], lower: -100 deg, upper: 100 deg}
    shapes: {rod: {type: cuboid, size: [0.1, 0.1, 1], pose: {xyz: [0, 0, 0.5]}}}
motion:
  points: {swing: [{time: 0, position: 0}, {time: 1, position: 60 deg}]}
sensors:
  distance: {tip: {link: arm, pose: {xyz: [0, 0, 1], rpy: [0, 90 deg, 0]}, aperture: 20 deg, range: 3}}
expect:
  - {pair: [arm, wall], contact: EXPECTED}
"""


@pytest.fixture(scope="module")
def scenario(tmp_path_factory):
    path = tmp_path_factory.mktemp("scenario") / "swing.yaml"
    path.write_text(SCENARIO.replace("EXPECTED", "never"))
    return path


@pytest.fixture(scope="module")
def recorded(scenario, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert run(["run", str(scenario), "-o", str(folder)]) is ExitCode.FINE
    return folder / "swing"


def test_run_leaves_the_run_folder_of_the_design(recorded):
    assert sorted(file.name for file in recorded.iterdir()) == ["log.txt", "result.json", "swing.mcap", "swing.rrd"]
    result = json.loads((recorded / "result.json").read_text())
    assert result["status"] == "passed"
    assert result["frames"] == 61
    assert result["expectations"][0]["passed"] is True
    summary = json.loads((recorded.parent / "run.json").read_text())
    assert summary["scenarios"]["swing"]["status"] == "passed"
    assert len(replay.read(recorded / "swing.mcap").time) == 61


def test_recordings_are_not_overwritten_unless_asked(scenario, recorded, capsys):
    before = (recorded / "swing.mcap").read_bytes()
    assert run(["run", str(scenario), "-o", str(recorded.parent)]) is ExitCode.INVALID
    said = capsys.readouterr().err
    assert "exists already; pass --overwrite to replace it, --resume to keep what is up to date, or -o DIR" in said
    assert run(["run", str(scenario), "-o", str(recorded.parent), "--overwrite"]) is ExitCode.FINE
    assert (recorded / "swing.mcap").read_bytes() == before  # the same inputs give the same bytes


def test_without_savings_the_recording_says_so_and_reads_the_same(scenario, recorded, tmp_path):
    assert run(["run", str(scenario), "-o", str(tmp_path / "all"), "--no-rrd", "--no-savings"]) is ExitCode.FINE
    assert replay.read(tmp_path / "all/swing/swing.mcap").provenance.model["savings"] == "off"
    assert run(["diff", str(recorded / "swing.mcap"), str(tmp_path / "all/swing/swing.mcap")]) is ExitCode.FINE


def test_a_broken_expectation_is_exit_code_4_and_named(tmp_path, capsys):
    path = tmp_path / "swing.yaml"
    path.write_text(SCENARIO.replace("EXPECTED", "always"))
    assert run(["run", str(path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FAILED
    assert "FAIL arm | wall: contact always" in capsys.readouterr().out


def test_a_recording_runs_again_from_its_attachments_alone(recorded, tmp_path):
    moved = tmp_path / "elsewhere.mcap"
    moved.write_bytes((recorded / "swing.mcap").read_bytes())
    assert run(["run", str(moved), "-o", str(tmp_path / "again"), "--no-rrd"]) is ExitCode.FINE
    assert (tmp_path / "again" / "swing" / "swing.mcap").read_bytes() == moved.read_bytes()


def test_nothing_selected_is_exit_code_5(scenario, tmp_path, capsys):
    assert run(["run", str(scenario), "--select", "tag:none", "-o", str(tmp_path)]) is ExitCode.NOTHING
    assert "nothing selected by tag:none" in capsys.readouterr().err
    assert run(["validate", str(scenario), "--select", "sw*"]) is ExitCode.FINE


def test_validate_says_place_value_rule_and_remedy(tmp_path, capsys):
    path = tmp_path / "swing.yaml"
    path.write_text(SCENARIO.replace("EXPECTED", "never").replace("60 deg", "60 cm"))
    assert run(["validate", str(path)]) is ExitCode.INVALID
    error = capsys.readouterr().err
    assert "swing.yaml:13:" in error
    assert "60 cm" in error


def test_a_mistake_in_a_sweep_is_not_said_a_thousand_times(tmp_path, capsys):
    path = tmp_path / "many.yaml"
    path.write_text(
        "version: 1\nname: many\nrate: 10\nduration: 1\nlinks: {a: {shapes: {s: {type: cube, size: 1}}}}\n"
        f"sweep: {{grid: {{links.a.shapes.s.size: {[-k for k in range(1000)]}}}}}\n"
    )
    assert run(["validate", str(path)]) is ExitCode.INVALID
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 101
    assert lines[-1] == "replay: error: ... and 900 more"


def test_a_note_that_the_cases_of_a_sweep_share_is_said_once(tmp_path, capsys):
    path = tmp_path / "many.yaml"
    path.write_text(
        SCENARIO.replace("EXPECTED", "never").replace("time: 1,", "time: 3,") + "sweep: {grid: {rate: [10, 20]}}\n"
    )
    assert run(["validate", str(path)]) is ExitCode.FINE
    assert capsys.readouterr().err.count("after the scenario's end") == 1


def test_validate_deep_counts_what_would_be_simulated(scenario, capsys):
    assert run(["validate", str(scenario), "--deep", "--format", "json"]) is ExitCode.FINE
    entry = json.loads(capsys.readouterr().out)[0]
    assert (entry["pairs"], entry["triangles"], entry["distance_sensors"]) == (1, 24, 1)


def test_an_unusable_mesh_is_invalid_input_and_fails_one_of_many(tmp_path, capsys):
    (tmp_path / "cut.ply").write_bytes(b"ply\nformat ascii 1.0\nelement vertex 9\nend_header\n0\n")
    path = tmp_path / "bad.yaml"
    path.write_text(
        "version: 1\nname: bad\nrate: 10\nduration: 1\n"
        "links: {a: {shapes: {m: {type: mesh, file: cut.ply, scale: 1}}}}\n"
    )
    line = f"{path}:5:44: links.a.shapes.m.file = 'cut.ply' cannot be used: is not a usable PLY file: its header"
    assert run(["validate", str(path)]) is ExitCode.FINE
    assert run(["validate", "--deep", str(path)]) is ExitCode.INVALID
    assert capsys.readouterr().err.startswith(f"replay: error: {line}")
    out = ["-o", str(tmp_path / "out"), "--no-rrd", "--overwrite"]
    assert run(["run", str(path), *out]) is ExitCode.INVALID
    assert line in capsys.readouterr().out
    path.with_name("good.yaml").write_text("version: 1\nname: good\nrate: 10\nduration: 1\nlinks: {a: {}}\n")
    assert run(["run", str(tmp_path), *out]) is ExitCode.FAILED
    assert "good: passed" in capsys.readouterr().out


def test_info_lists_topics_counts_and_provenance(recorded, capsys):
    assert run(["info", str(recorded / "swing.mcap")]) is ExitCode.FINE
    text = capsys.readouterr().out
    assert "/distance/tip" in text
    assert "replay.DistanceReading" in text
    assert "distance exact@2" in text
    assert "swing.yaml" in text
    assert run(["info", str(recorded / "swing.mcap"), "--format", "json"]) is ExitCode.FINE
    counts = {topic["topic"]: topic["messages"] for topic in json.loads(capsys.readouterr().out)["topics"]}
    assert counts["/collision"] == counts["/tf"] == counts["/joint_states"] == 61


def test_info_salvages_a_cut_file_with_exit_code_3(recorded, tmp_path, capsys):
    data = (recorded / "swing.mcap").read_bytes()
    part = tmp_path / "swing.mcap.part"
    part.write_bytes(data[: len(data) // 2])
    assert run(["info", str(part)]) is ExitCode.LOSSES
    said = capsys.readouterr().err
    assert said.startswith(f"replay: {part}: cut at byte") and said.endswith("; none of 61 frames were salvaged\n")
    cut = tmp_path / "cut.mcap"  # a copy that was stopped, say
    cut.write_bytes(part.read_bytes())
    assert run(["info", str(cut)]) is ExitCode.LOSSES
    assert run(["export", str(cut), "--format", "csv", "-o", str(tmp_path), "--topic", "/tf"]) is ExitCode.LOSSES
    cut.write_bytes(data[:-20])
    capsys.readouterr()
    assert run(["info", str(cut)]) is ExitCode.LOSSES
    assert capsys.readouterr().err.endswith("; all 61 frames were salvaged\n")
    cut.write_bytes(data[:30])
    assert run(["info", str(cut)]) is ExitCode.INVALID


def test_a_stopped_run_is_run_again_from_what_it_left(recorded, tmp_path, capsys):
    data = (recorded / "swing.mcap").read_bytes()
    part = tmp_path / "swing.mcap.part"
    part.write_bytes(data[: len(data) * 9 // 10])
    assert run(["run", str(part), "-o", str(tmp_path), "--no-rrd"]) is ExitCode.FINE
    assert (tmp_path / "swing" / "swing.mcap").read_bytes() == data
    part.write_bytes(data[:900])
    assert run(["run", str(part), "-o", str(tmp_path), "--overwrite"]) is ExitCode.INVALID
    assert "nothing can be salvaged" in capsys.readouterr().err
    assert run(["run", str(recorded / "swing.rrd"), "-o", str(tmp_path)]) is ExitCode.INVALID
    assert "the .mcap beside it" in capsys.readouterr().err


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_name_that_the_terminal_cannot_show_is_shown_as_escapes(recorded, tmp_path, encoding):
    named = tmp_path / "bone 🦴.mcap"
    named.write_bytes((recorded / "swing.mcap").read_bytes())
    command = [sys.executable, "-m", "replay", "info", str(named)]
    environment = {**os.environ, "PYTHONIOENCODING": encoding}
    done = subprocess.run(command, env=environment, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(str(tmp_path).encode())


def test_export_writes_tables_with_units(recorded, tmp_path, capsys):
    arguments = [
        "export",
        str(recorded / "swing.mcap"),
        "--format",
        "csv",
        "-o",
        str(tmp_path),
        "--topic",
        "/distance/*",
    ]
    assert run(arguments) is ExitCode.FINE
    (written,) = capsys.readouterr().out.split()
    assert "[m]" in Path(written).read_text().splitlines()[0]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run"], "Missing argument"),
        (["nonsense"], "No such command 'nonsense'; run, validate"),
        (["valdate", "x"], "No such command 'valdate'; did you mean 'validate'?; see replay --help"),
        (["run", "x", "--workers", "0"], "'0' is no number of processes; write 1 or more; see replay run --help"),
        (["run", "x", "--shard", "3/2"], "must be i/n with 1 <= i <= n, such as 2/4; see replay run --help"),
        (["info", "none.mcap"], "cannot be read"),
        (["view", "none.rrd"], "no such file"),
        (["view", "none.txt"], "neither a .rrd nor a .mcap"),
        (["view", "none.rrd", "--at", "1"], "--at belongs to --screenshot"),
        (["view", "none.rrd", "--screenshot", "x.jpg"], "x.jpg must end in .png"),
        (["run", "none.yaml"], "is not there"),
        (["run", "/dev/null"], "is neither a file nor a folder"),
        (["run", ""], "the path is empty"),
        (["run", "x", "-o", ""], "the path is empty"),
        (["run", "x", "--model", ""], "model = '': names none; give a file, or a built-in model: thesis2015"),
        (["export", "x.mcap"], "Missing option '--format'. Choose from: csv, json, parquet; see replay export --help"),
        (["view", "none.rrd", "--screenshot", "x.png", "--at", "nan"], "is no moment of a recording"),
    ],
)
def test_usage_and_unreadable_input_are_exit_code_2(arguments, message, capsys):
    assert run(arguments) is ExitCode.INVALID
    said = capsys.readouterr().err
    assert message in said
    assert said.startswith("replay: error: ") and said.count("\n") == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a system without /dev/full")
def test_a_result_that_standard_output_has_no_space_for_is_one_line(scenario):
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "replay", "validate", str(scenario)]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == ExitCode.INVALID
    assert done.stderr == ("replay: error: the result cannot be written to standard output: No space left on device\n")


@pytest.mark.parametrize("arguments", [["--help"], ["validate", "SCENARIO"], ["--version"]])
def test_light_commands_load_nothing_heavy(arguments, scenario):
    arguments = [str(scenario) if argument == "SCENARIO" else argument for argument in arguments]
    heavy = ("numba", "rerun", "trimesh", "scipy", "matplotlib", "pyarrow", "fcl")
    code = (
        f"import sys; from replay.cli.main import run; code = run({arguments!r});"
        f"print(int(code), [m for m in {heavy!r} if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "0 []"


def test_exit_codes_win_in_the_order_of_the_design():
    codes = [ExitCode(code) for code in (0, 5, 1, 3, 4, 2, 130)]
    assert [worst(codes[: k + 1]) for k in range(len(codes))] == codes
    assert worst([]) is ExitCode.FINE


def test_a_crash_fails_its_scenario_and_no_other(tmp_path, monkeypatch, capsys):
    for name in ("raise_first", "second"):
        (tmp_path / f"{name}.yaml").write_text(
            SCENARIO.replace("EXPECTED", "never").replace("name: swing", f"name: {name}", 1)
        )
    monkeypatch.setattr(replay.batch.run, "run_case", scenes.misbehave)
    assert run(["run", str(tmp_path), "-o", str(tmp_path / "out"), "--no-rrd"]) is ExitCode.FAILED
    text = capsys.readouterr().out
    assert "raise_first: crashed" in text and "MemoryError: no room for 8 GiB" in text
    assert "second: passed" in text
    folder = tmp_path / "out" / "raise_first"
    assert "Traceback" in (folder / "log.txt").read_text()
    assert sorted(file.name for file in folder.iterdir()) == ["log.txt", "result.json"]


def test_a_fault_of_the_program_never_looks_like_a_difference(scenario, monkeypatch, capsys):
    def broken(_):
        raise RuntimeError("unforeseen")

    monkeypatch.setattr(replay.batch.select, "load_all", broken)
    assert run(["validate", str(scenario)]) is ExitCode.FAILED
    assert "fault of replay: RuntimeError: unforeseen" in capsys.readouterr().err


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupted_run_leaves_no_half_recordings(tmp_path, number):
    path = tmp_path / "long.yaml"
    path.write_text(SCENARIO.replace("EXPECTED", "never").replace("duration: 1 s", "duration: 2000 s"))
    code = (
        "import signal, sys; from replay.cli.main import main;"
        "signal.signal(signal.SIGINT, signal.default_int_handler); main(sys.argv[1:])"  # background jobs ignore it
    )
    command = [sys.executable, "-c", code, "run", str(path), "-o", str(tmp_path / "out")]
    with subprocess.Popen(command) as process:
        deadline = time.monotonic() + 60.0
        while not list(tmp_path.glob("out/swing/*.mcap.part")) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.send_signal(number)
        assert process.wait(timeout=60.0) == ExitCode.INTERRUPTED
    assert list(tmp_path.glob("out/swing/*")) == []
    assert (tmp_path / "out" / "run.json").is_file()


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_the_viewer_does_not_outlive_the_command(tmp_path):
    viewer = tmp_path / "viewer"
    viewer.write_text(f"#!/bin/sh\necho $@ > {tmp_path}/arguments\necho $$ > {tmp_path}/pid\nexec sleep 600\n")
    viewer.chmod(0o700)
    with rr.RecordingStream("replay") as stream:
        stream.save(tmp_path / "a.rrd")
    code = (
        "import pathlib, replay.recording.viewer as v; from replay.cli.main import main;"
        f"v.viewer_binary = lambda: pathlib.Path({str(viewer)!r}); main(['view', {str(tmp_path / 'a.rrd')!r}])"
    )
    with subprocess.Popen([sys.executable, "-c", code]) as process:
        deadline = time.monotonic() + 30.0
        pid = tmp_path / "pid"
        while not (pid.is_file() and pid.read_text().strip()) and time.monotonic() < deadline:
            time.sleep(0.05)
        process.terminate()
        assert process.wait(timeout=30.0) == ExitCode.INTERRUPTED
    assert (tmp_path / "arguments").read_text().split() == [str(tmp_path / "a.rrd"), "--bind", "127.0.0.1"]
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


def test_an_interruption_that_native_code_swallows_is_not_lost(scenario, tmp_path):
    code = """if True:
        import os, signal, sys, replay.batch.run as batch
        expected_cost = batch.expected_cost
        def swallowing(scenario):
            try:
                os.kill(os.getpid(), signal.SIGTERM)
            except KeyboardInterrupt:
                pass
            return expected_cost(scenario)
        batch.expected_cost = swallowing
        from replay.cli.main import main
        main(sys.argv[1:])
    """
    command = [sys.executable, "-c", code, "run", str(scenario), "-o", str(tmp_path), "--no-rrd"]
    assert subprocess.run(command, check=False).returncode == ExitCode.INTERRUPTED
    assert list(tmp_path.glob("swing/*")) == []
