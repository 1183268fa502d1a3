"""`replay view`: the viewer as a process."""

import os
import subprocess
import sys
import time

import pytest
import rerun as rr

from replay.cli.exit_codes import ExitCode


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
