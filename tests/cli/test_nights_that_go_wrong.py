"""Nights that are cut, meet something odd or cannot be written: what is left of them, and what is said."""

import json
import signal
import subprocess
import sys

import pytest

from replay.batch import judge
from replay.batch.baseline import Baseline
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import RecordingError
from tests.batch import scenes
from tests.cli.nights import junit_of, night, prepare, rows_of, verdicts_of

INTERRUPTED = """
import signal, sys, time
import replay.batch.judge as judge
from replay.cli.main import main

signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell's background jobs ignore it
read_pair = judge.read_pair

def slow(baseline, candidate, **rules):
    if candidate.stem == "b":
        print("comparing b", flush=True)
        time.sleep(60)
    return read_pair(baseline, candidate, **rules)

judge.read_pair = slow
main(sys.argv[1:])
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_request_to_stop_while_comparing_leaves_partial_reports(tmp_path, capsys, number):
    for name in "abc":
        scenes.write(tmp_path / "in", name)
    out, base = tmp_path / "out", tmp_path / "base"
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FINE
    arguments = ["regress", str(tmp_path / "in"), "--baseline", str(base), "-o", str(out), "--workers", "1"]
    command = [sys.executable, "-c", INTERRUPTED, *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout.readline() == "comparing b\n"
            assert not (out / "index.html").exists()  # that of the night before
            process.send_signal(number)
            text, error = process.communicate(timeout=20)
        finally:
            process.kill()
    assert process.returncode == 130, error
    assert "Traceback" not in error
    assert "b: interrupted: the run was ended before it was compared" in text
    assert "interrupted: the reports are partial" in text
    assert json.loads((out / "run.json").read_text())["interrupted"] is True
    assert verdicts_of(out) == {"a": "same", "b": "interrupted", "c": "interrupted"}
    assert junit_of(out) == {"a": "pass", "b": "error", "c": "error"}
    assert "Interrupted" in (out / "index.html").read_text()
    assert len((out / "history.jsonl").read_text().splitlines()) == 1  # no night of the history
    assert run(["accept", str(out), "--baseline", str(base), "--yes"]) is ExitCode.INVALID
    assert "interrupted" in capsys.readouterr().err


def test_a_request_to_stop_after_the_results_changes_nothing(tmp_path):
    scenes.write(tmp_path / "in", "a")
    code = "import atexit, sys, time; from replay.cli.main import main;"
    code += "atexit.register(lambda: (print('end', flush=True), time.sleep(0.5))); main(sys.argv[1:])"
    command = [sys.executable, "-c", code, "validate", str(tmp_path / "in")]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        while process.stdout.readline() != "end\n":
            assert process.poll() is None
        process.send_signal(signal.SIGTERM)
        process.communicate(timeout=20)
    assert process.returncode == 0


def test_a_baseline_folder_that_cannot_be_written_is_told_in_the_reports(tmp_path, capsys):
    scenes.write(tmp_path / "in", "a")
    (tmp_path / "base").mkdir()
    (tmp_path / "base" / "a").write_text("where the folder should be")
    assert night(tmp_path, tmp_path / "out", "--missing-baseline", "create", "--rrd", "none") is ExitCode.FAILED
    assert f"a: missing baseline: {tmp_path / 'base'}" in capsys.readouterr().out
    assert junit_of(tmp_path / "out") == {"a": "failure"}


def test_a_night_that_could_not_be_reported_is_not_begun(tmp_path, capsys):
    scenes.write(tmp_path / "in", "plain")
    (tmp_path / "file").write_text("")
    for arguments, message in [
        (["--baseline", str(tmp_path / "file")], "is a file; give the folder that `replay accept` writes"),
        (["--baseline", str(tmp_path), "--history", str(tmp_path)], "cannot be read before it is appended to: Is a"),
        (["--baseline", str(tmp_path), "--history", str(tmp_path / "file" / "h")], "file where a folder is needed"),
    ]:
        assert run(["regress", str(tmp_path / "in"), "-o", str(tmp_path / "out"), *arguments]) is ExitCode.INVALID
        said = capsys.readouterr().err
        assert message in said and said.count("\n") == 1
        assert not (tmp_path / "out").exists()


def test_one_odd_baseline_never_ends_a_night(tmp_path, monkeypatch, capsys):
    """Whatever is odd about one comparison, in a way that nobody has foreseen."""
    prepare(tmp_path, plain=4, bad=0, differing=1)
    read_pair = judge.read_pair

    def odd(baseline, candidate, **rules):
        match candidate.stem:
            case "plain_0":
                raise RecursionError("maximum recursion depth exceeded\nwhile comparing")
            case "plain_1":
                raise RecordingError(str(candidate), "damaged: its end is missing")
            case "plain_2":
                raise RecordingError(str(baseline), "damaged: its end is missing")
        return read_pair(baseline, candidate, **rules)

    def undrawable(*_):
        raise ZeroDivisionError("no extent")

    monkeypatch.setattr(judge, "read_pair", odd)
    monkeypatch.setattr(judge, "plots", undrawable)
    monkeypatch.setattr(judge, "write_overlay", undrawable)
    out = tmp_path / "out"
    assert night(tmp_path, out) is ExitCode.INVALID
    assert verdicts_of(out) == {
        "differ_0": "different",
        "plain_0": "failed",
        "plain_1": "failed",
        "plain_2": "unreadable baseline",
        "plain_3": "same",
    }
    tags = ["failure", "error", "error", "error", "pass"]
    assert list(junit_of(out).values()) == tags
    said = capsys.readouterr().out
    recursion = "RecursionError: maximum recursion depth exceeded while comparing"
    assert f"plain_0: failed: it cannot be compared with its baseline: {recursion}" in said
    assert f"plain_1: failed: its own recording: {out / 'plain_1' / 'plain_1.mcap'}: damaged" in said
    assert "it cannot be drawn: ZeroDivisionError: no extent (replay/batch/judge.py:" in said
    assert "; both runs cannot be shown" in said
    assert "Traceback" in (out / "plain_0" / "log.txt").read_text()
    assert "differ_0" in rows_of(out)
    assert len((out / "history.jsonl").read_text().splitlines()) == 1


def test_one_report_that_cannot_be_made_keeps_none_of_the_others(tmp_path, monkeypatch, capsys):
    prepare(tmp_path, plain=1, bad=0, differing=0)
    out = tmp_path / "out"
    (out / "junit.xml").mkdir(parents=True)
    (out / "junit.xml" / "in_the_way").touch()
    capsys.readouterr()
    assert night(tmp_path, out, "--rrd", "none") is ExitCode.INVALID
    said = capsys.readouterr()
    assert "junit.xml: cannot be written" in said.err and "1 scenario: 1 same" in said.out
    assert verdicts_of(out) == {"plain_0": "same"}
    assert (out / "index.html").is_file() and (out / "history.jsonl").is_file()


def test_a_new_baseline_is_told_only_where_one_was_written(tmp_path, capsys):
    scenes.write(tmp_path / "in", "a", contact="always")
    scenes.write(tmp_path / "in", "b")
    scenes.write(tmp_path / "in", "c")
    (tmp_path / "base").mkdir()
    (tmp_path / "base" / "c").write_text("where the folder should be")
    out = tmp_path / "out"
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FAILED
    assert verdicts_of(out) == {"a": "broken", "b": "missing baseline", "c": "missing baseline"}
    assert "its baseline is new" not in (out / "run.json").read_text() + capsys.readouterr().out
    (tmp_path / "base" / "c").unlink()
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FAILED
    entries = json.loads((out / "run.json").read_text())["verdicts"]
    assert {name: entry.get("message", "") for name, entry in entries.items() if name != "a"} == dict.fromkeys(
        "bc", "its baseline is new"
    )
    assert "baseline is new" not in entries["a"]["message"]
    assert Baseline(tmp_path / "base").names() == ["b", "c"]


KILLED = """
import os, signal, sys
from replay.batch.judge import Judge
from replay.cli.main import main
judged = Judge.judge

def killing(self, scenario, result):
    if scenario.name == "c":
        os.kill(os.getpid(), signal.SIGKILL)
    return judged(self, scenario, result)

Judge.judge = killing
main(sys.argv[1:])
"""


def test_a_night_that_was_cut_is_carried_on(tmp_path, capsys):
    for name in "abc":
        scenes.write(tmp_path / "in", name)
    out, base = tmp_path / "out", tmp_path / "base"
    assert night(tmp_path, out, "--missing-baseline", "create", "--rrd", "none") is ExitCode.FINE
    scenes.write(tmp_path / "in", "b", distance=1.3)
    arguments = ["regress", str(tmp_path / "in"), "--baseline", str(base), "-o", str(out), "--workers", "1"]
    assert subprocess.run([sys.executable, "-c", KILLED, *arguments], check=False).returncode == -signal.SIGKILL
    cut = json.loads((out / "run.json").read_text())
    assert cut["interrupted"] is True and "verdicts" not in cut  # the night is not over
    assert {entry["status"] for entry in cut["scenarios"].values()} == {"passed"}
    assert run(["accept", str(out), "--baseline", str(base), "--yes"]) is ExitCode.INVALID
    before = {file: file.stat().st_mtime_ns for file in out.glob("*/*.mcap")}
    capsys.readouterr()
    assert night(tmp_path, out, "--resume", "--rrd", "none") is ExitCode.DIFFERENT
    assert capsys.readouterr().err.count(": reused") == 3
    assert {file: file.stat().st_mtime_ns for file in out.glob("*/*.mcap")} == before
    assert verdicts_of(out) == {"a": "same", "b": "different", "c": "same"}
    assert json.loads((out / "run.json").read_text())["interrupted"] is False
    assert len((out / "history.jsonl").read_text().splitlines()) == 2
    (out / "c" / "c.mcap").unlink()
    assert night(tmp_path, out, "--resume", "--rrd", "all") is ExitCode.DIFFERENT  # now with recordings for eyes
    assert len(list(out.glob("*/?.rrd"))) == 3
    assert verdicts_of(out)["c"] == "same"
