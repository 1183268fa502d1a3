"""Folders for temporary files: gone when the command ends, and when it was killed, gone with the next."""

import os
import signal
import subprocess
import sys
import tempfile

import pytest

from replay.recording import own_folder

pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals and locks as POSIX has them")
HOLD = "from replay.recording.own_folder import own_folder as f\nwith f() as a: print(a, flush=True); input()"


def hold(folder):
    environment = {**os.environ, "TMPDIR": str(folder)}
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment, text=True
    )
    process.stdout.readline()
    return process


def test_what_a_killed_command_left_goes_with_the_next(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with hold(tmp_path) as killed, hold(tmp_path) as running:
        left, held = sorted(tmp_path.iterdir(), key=lambda path: path.stat().st_mtime_ns)
        (left / "data").write_text("x")
        killed.send_signal(signal.SIGKILL)
        killed.wait()
        (tmp_path / "replay-view-file").write_text("not ours")
        (tmp_path / "replay-view-link").symlink_to(held)
        with own_folder.own_folder() as young:
            assert left.exists(), "it may be a folder that somebody has made just now"
        monkeypatch.setattr(own_folder, "_YOUNG", 0.0)
        with own_folder.own_folder() as own:
            assert sorted(tmp_path.iterdir()) == sorted(
                [held, own, tmp_path / "replay-view-file", tmp_path / "replay-view-link"]
            )
        assert held.exists()
        assert not (young.exists() or own.exists())
        running.communicate("\n")
    assert not held.exists()
