"""A run that is stopped at any moment: what is finished stays, and nothing is left behind."""

import json
import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from tests.batch import scenes


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
