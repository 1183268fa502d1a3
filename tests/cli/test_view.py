"""`replay view`: the viewer as a process."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest
import rerun as rr

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run


@pytest.mark.skipif(os.name != "posix", reason="signals as POSIX has them")
def test_the_viewer_does_not_outlive_the_command(tmp_path):
    viewer = tmp_path / "viewer"
    lines = [
        "#!/bin/sh",
        f"cd {tmp_path}",
        "echo $@ > arguments",
        "env > environment",
        "echo $$ > pid",
        "exec sleep 600",
    ]
    viewer.write_text("\n".join(lines) + "\n")
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
    *arguments, port = (tmp_path / "arguments").read_text().split()
    assert arguments == [str(tmp_path / "a.rrd"), "--hide-welcome-screen", "--bind", "127.0.0.1", "--port"]
    assert int(port) != 9876, "another viewer may have the usual one, and would be the one that shows"
    environment = dict(
        line.split("=", 1) for line in (tmp_path / "environment").read_text().splitlines() if "=" in line
    )
    assert environment["XDG_CONFIG_HOME"] == environment["TMPDIR"] != os.environ.get("TMPDIR")
    assert not Path(environment["XDG_CONFIG_HOME"]).exists(), "the viewer's home goes with it"
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid.read_text()), 0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--at", "1"], "--at belongs to --screenshot"),
        (["--scene-only"], "--scene-only belongs to --screenshot"),
        (["--screenshot", "a.png", "--at", "-0.001"], "--at -0.001 is no moment of a recording"),
        (["--screenshot", "a.png", "--at", "inf"], "--at inf is no moment of a recording"),
        (["--screenshot", "a.png", "--at", "nan"], "--at nan is no moment of a recording"),
        (["--screenshot", "a.jpg"], "--screenshot a.jpg must end in .png"),
        (["--screenshot", "a.png", "--web"], "--screenshot and --web exclude each other"),
        (["--screenshot", "a.png", "--scene-only", "no.rrd"], "--camera and --scene-only are for one recording"),
        # what may be said: then the recording is looked for
        (["--screenshot", "a.PNG", "--at", "0"], "no.rrd"),
        (["--screenshot", "a.png", "--at", "1e9", "--scene-only"], "no.rrd"),
        (["--web"], "no.rrd"),
        ([], "no.rrd"),
    ],
)
def test_options_that_do_not_go_together_are_told_before_anything_is_read(
    tmp_path, monkeypatch, capsys, options, message
):
    monkeypatch.chdir(tmp_path)
    assert run(["view", "no.rrd", *options]) is ExitCode.INVALID
    assert message in capsys.readouterr().err
