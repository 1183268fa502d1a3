"""Readers that leave, and standard streams that are closed: the command does its work and its exit code is its own."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from tests.batch import scenes

pytestmark = pytest.mark.skipif(os.name != "posix", reason="uses a shell of POSIX")


def shell(command, **options):
    """Run a command of bash in which $R is `replay`; return exit codes of its first pipe, and what was said."""
    env = {**os.environ, "R": f"{sys.executable} -m replay", "PYTHONPATH": str(Path(__file__).parents[2])}
    script = f"{command}\ncodes=${{PIPESTATUS[0]}}; echo; echo $codes"
    done = subprocess.run(["bash", "-c", script], capture_output=True, text=True, env=env, check=True, **options)
    return done.stdout.splitlines()[-1], done.stdout + done.stderr


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    folder = tmp_path_factory.mktemp("runs")
    for name, distance in (("a", 1.2), ("b", 1.25)):
        scenes.write(folder / f"in_{name}", "s", distance=distance)
        assert run(["run", str(folder / f"in_{name}"), "-o", str(folder / name), "--no-rrd"]) is ExitCode.FINE
    return folder


@pytest.mark.parametrize("reader", ["true", "head -c 1"])
@pytest.mark.parametrize(
    ("command", "code"),
    [("diff a a", 0), ("diff a b", 1), ("validate in_a", 0), ("run --help", 0), ("info none.mcap 2>&1", 2)],
)
def test_the_exit_code_does_not_depend_on_the_reader(runs, command, code, reader):
    found, said = shell(f"$R {command} | {reader}", cwd=runs)
    assert found == str(code)
    assert "Traceback" not in said and "Broken" not in said and "Exception ignored" not in said


def test_a_night_whose_progress_nobody_reads_goes_on(runs, tmp_path):
    for name in "ab":
        scenes.write(tmp_path / "in", name)
    found, _ = shell("$R run in -o out --no-rrd --workers 1 2>&1 | true", cwd=tmp_path)
    assert found == "0"
    summary = json.loads((tmp_path / "out" / "run.json").read_text())
    assert summary["interrupted"] is False
    assert {entry["status"] for entry in summary["scenarios"].values()} == {"passed"}
    accept = "$R accept out --baseline base --yes --reason x"
    assert shell(f"{accept} | true", cwd=tmp_path)[0] == "0"
    assert (tmp_path / "base" / "b" / "b.mcap").is_file()
    assert shell("$R regress in --baseline base -o night --workers 1 2>&1 | true", cwd=tmp_path)[0] == "0"
    assert (tmp_path / "night" / "junit.xml").is_file() and (tmp_path / "night" / "history.jsonl").is_file()


@pytest.mark.parametrize("closed", [">&-", "2>&-", "<&- >&- 2>&-", "2>/dev/full"])
def test_closed_streams_do_no_harm(runs, tmp_path, closed):
    out = tmp_path / "out"
    found, _ = shell(f"$R run in_a -o {out} --no-rrd --workers 1 {closed}", cwd=runs)
    assert found == "0"
    assert (out / "s" / "s.mcap").read_bytes() == (runs / "a" / "s" / "s.mcap").read_bytes()
    assert json.loads((out / "run.json").read_text())["interrupted"] is False
