"""`replay bench`."""

import contextlib
import io
import json
import os
import re
import subprocess
import sys

import pytest

from replay.bench import distance, results, start
from replay.bench.goals import Goal
from replay.bench.report import Report
from replay.cli import bench_progress
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run


def test_writes_reports_and_says_what_is_missed(tmp_path, monkeypatch, capsys):
    def small(*, quick):
        assert quick
        return Report("distance", goals=[Goal("cone.speed", 2.0)])

    monkeypatch.setattr(distance, "run", small)
    assert run(["bench", "distance", "--quick", "-o", str(tmp_path)]) == ExitCode.DIFFERENT
    assert "missed" in capsys.readouterr().out
    assert json.loads((tmp_path / "bench.json").read_text())["goals"][0]["verdict"] == "missed"
    assert (tmp_path / "bench.html").exists()


def test_an_unknown_benchmark_is_a_usage_error(capsys):
    assert run(["bench", "speed"]) == ExitCode.INVALID
    assert "collision" in capsys.readouterr().err


def test_what_peers_say_on_stderr_is_in_the_report_and_not_on_the_terminal(tmp_path, monkeypatch, capfd):
    def loud(*, quick):
        for _ in range(400):
            os.write(2, b"a peer's <warning>\n")
        print("another one", file=sys.stderr)
        subprocess.run([sys.executable, "-c", "import os; os.write(2, b'from a process\\n')"], check=True)
        return Report("distance")

    monkeypatch.setattr(distance, "run", loud)
    monkeypatch.setattr(start, "run", lambda *, quick: Report("start"))
    assert run(["bench", "distance", "start", "-o", str(tmp_path)]) == ExitCode.FINE
    said = capfd.readouterr().err
    assert "warning" not in said and "another" not in said and "process" not in said
    lines = [re.sub(r"\d+ s", "N s", line) for line in said.splitlines()]
    paths = ", ".join(str(tmp_path / name) for name in ("bench.json", "bench.html"))
    left = "replay: bench distance: N s, less than a minute left"
    assert lines == [left, "replay: bench start: N s", f"replay: wrote {paths}"], "no line noise without a terminal"
    found = json.loads((tmp_path / "bench.json").read_text())["benchmarks"]
    assert found["start"]["said"] == []
    assert sorted(found["distance"]["said"]) == ["a peer's <warning> (400 times)", "another one", "from a process"]
    assert "a peer&#x27;s &lt;warning&gt; (400 times)" in (tmp_path / "bench.html").read_text()
    os.write(2, b"afterwards\n")
    assert capfd.readouterr().err == "afterwards\n"


@pytest.mark.parametrize(
    ("before", "left"),
    [
        ({}, ", about 4 min left"),
        ({"a": 1.0, "b": 20.0, "c": 0.5}, ", about 41 min left"),
        ({"a": 1.0, "b": 20.0}, ", about 4 min left"),
        ({"a": 100.0, "b": 1.0, "c": 1.0}, ", less than a minute left"),
    ],
)
def test_time_left_goes_by_the_pace_and_an_earlier_run(before, left, monkeypatch):
    monkeypatch.setattr(bench_progress.time, "monotonic", iter([0.0, 120.0]).__next__)
    said = io.StringIO()
    progress = bench_progress.BenchProgress(["a", "b", "c"], before, said)
    progress.done(120.0)
    assert said.getvalue() == f"replay: bench a: 120 s{left}\n"


def test_an_earlier_run_is_read_from_its_report(tmp_path):
    assert results.earlier_seconds(tmp_path) == {}
    results.write([Report("a", seconds=1.5), Report("b", seconds=2.0)], tmp_path)
    assert results.earlier_seconds(tmp_path) == {"a": 1.5, "b": 2.0}
    (tmp_path / "bench.json").write_text('{"benchmarks": {"a": {"seconds": "many"}}}')
    assert results.earlier_seconds(tmp_path) == {}


@pytest.mark.skipif(sys.platform == "win32", reason="needs a terminal of its own")
def test_a_terminal_shows_what_is_measured_and_the_time_left(tmp_path):
    import pty

    command = f"""
from replay.bench import distance, measure, start
from replay.bench.report import Report
from replay.cli.main import run
import time

def slow(*, quick):
    measure.compete("boxes", [], rounds=1)
    time.sleep(0.4)
    return Report("slow")

distance.run = start.run = slow
run(["bench", "distance", "start", "-o", {str(tmp_path)!r}])
"""
    mine, its = pty.openpty()
    child = subprocess.Popen(
        [sys.executable, "-c", command], stdout=subprocess.DEVNULL, stderr=its, env={**os.environ, "TERM": "xterm"}
    )
    os.close(its)
    shown = b""
    with contextlib.suppress(OSError):  # the end of a terminal
        while more := os.read(mine, 4096):
            shown += more
    os.close(mine)
    assert child.wait() == 0
    assert b"bench distance: boxes" in shown and b"bench start: boxes, less than a minute left" in shown
