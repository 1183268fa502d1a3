"""`replay run`: what it leaves, refuses and says, and how it ends."""

import json
import os
import signal
import subprocess
import sys
import time

import pytest

import replay
import replay.batch.run
import replay.batch.select
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes
from tests.cli.swing import SCENARIO


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


def test_a_file_that_is_not_valid_is_told_and_the_others_are_run(tmp_path, capsys):
    for name in ("first", "second"):
        (tmp_path / f"{name}.yaml").write_text(
            SCENARIO.replace("EXPECTED", "never").replace("name: swing", f"name: {name}", 1)
        )
    (tmp_path / "broken.yaml").write_text("version: 1\nname: [broken\n")
    (tmp_path / "lost.yml").symlink_to("nowhere.yml")
    out = tmp_path / "out"
    command = ["run", str(tmp_path), "-o", str(out), "--no-rrd"]
    assert run(command) is ExitCode.INVALID
    text = capsys.readouterr().out
    assert "broken: failed\n  " in text and f"{tmp_path}/broken.yaml:" in text and "not YAML" in text
    assert "lost: failed" in text and "is a link to a file that does not exist" in text
    assert "4 scenarios: 2 passed, 2 failed (broken, lost)" in text
    assert (out / "first" / "first.mcap").is_file() and (out / "second" / "second.mcap").is_file()
    assert json.loads((out / "run.json").read_text())["scenarios"]["broken"]["status"] == "failed"
    (out / "broken" / "broken.mcap").write_bytes(b"an earlier one")
    assert run([*command, "--select", "broken"]) is ExitCode.INVALID  # nothing else is left: as for a single file
    assert (out / "broken" / "broken.mcap").read_bytes() == b"an earlier one"


def test_nothing_selected_is_exit_code_5(scenario, tmp_path, capsys):
    assert run(["run", str(scenario), "--select", "tag:none", "-o", str(tmp_path)]) is ExitCode.NOTHING
    assert "nothing selected by tag:none" in capsys.readouterr().err
    assert run(["run", str(scenario), "--select", "swing", "--shard", "2/2", "-o", str(tmp_path)]) is ExitCode.NOTHING
    assert "nothing selected by swing in part 2 of 2" in capsys.readouterr().err
    assert run(["validate", str(scenario), "--select", "sw*"]) is ExitCode.FINE


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
    assert text.endswith("\n2 scenarios: 1 crashed (raise_first), 1 passed\n")
    folder = tmp_path / "out" / "raise_first"
    assert "Traceback" in (folder / "log.txt").read_text()
    assert sorted(file.name for file in folder.iterdir()) == ["log.txt", "result.json"]


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
