"""The viewer as a process: whom it asks, as the system sees it, and what it leaves behind."""

import contextlib
import json
import re
import shutil
import socket
import subprocess
import time
from pathlib import Path

import psutil
import pytest

from replay.recording.rerun_log import RerunWriter
from replay.recording.viewer_process import free_port, quarters, viewer_binary
from tests.recording import moving

needs_a_driver = pytest.mark.skipif(
    not list(Path("/usr/share/vulkan/icd.d").glob("*.json")), reason="needs a Vulkan driver"
)
needs_strace = pytest.mark.skipif(shutil.which("strace") is None, reason="needs strace to see whom a process asks")


def test_a_home_refuses_statistics_and_goes_with_all_that_was_written(monkeypatch):
    monkeypatch.setenv("FORCE_RERUN_ANALYTICS", "1")
    monkeypatch.setenv("HTTPS_PROXY", "http://proxy.example:3128")
    with quarters() as where:
        told = json.loads((where.home / "rerun" / "analytics.json").read_text())
        assert told["analytics_enabled"] is False
        assert "FORCE_RERUN_ANALYTICS" not in where.environment
        assert where.environment["HTTPS_PROXY"] == where.environment["https_proxy"] == "http://127.0.0.1:9"
        (Path(where.environment["TMPDIR"]) / "rerun-data-1").mkdir()
    assert not where.home.exists()


def test_a_free_port_is_the_one_that_the_system_gave(monkeypatch):
    given = []

    class Noted(socket.socket):
        def bind(self, address):
            super().bind(address)
            given.append((address, self.getsockname()))

    monkeypatch.setattr(socket, "socket", Noted)
    port = free_port()
    (((host, wanted), (_, found)),) = given
    assert (host, wanted, found) == ("127.0.0.1", 0, port)  # 0: any that is free


def asked(environment, recording, folder):
    """Return what the system was asked to connect to while a viewer showed a recording for a while."""
    calls = folder / "calls"
    command = ["strace", "-f", "-qq", "-s", "200", "-e", "trace=connect,sendto,sendmsg,sendmmsg", "-e", "signal=none"]
    command += ["-o", str(calls), str(viewer_binary()), "--headless", "--bind", "127.0.0.1", "--hide-welcome-screen"]
    command += ["--port", str(free_port()), "--window-size", "300x200", str(recording)]
    with (
        (folder / "said").open("w") as said,
        subprocess.Popen(command, env=environment, stdout=said, stderr=said) as run,
    ):
        deadline = time.monotonic() + 120.0
        while "Headless viewer running" not in (folder / "said").read_text() and time.monotonic() < deadline:
            time.sleep(0.5)
        time.sleep(10.0)  # it asks for a new version, and tells that it is used, within two seconds
        for process in psutil.Process(run.pid).children(recursive=True):
            with contextlib.suppress(psutil.NoSuchProcess):
                process.terminate()
        run.wait(timeout=60.0)
    assert "Headless viewer running" in (folder / "said").read_text()
    return calls.read_text(errors="replace")


@needs_strace
@needs_a_driver
def test_the_viewer_asks_no_other_host(tmp_path):
    recording = tmp_path / "moving.rrd"
    writer = RerunWriter(recording, moving.LAYOUT, moving.scene())
    writer.write(next(moving.blocks(50)))
    writer.commit()
    with quarters() as where:
        found = asked(where.environment, recording, tmp_path)
    networks = re.findall(r"sa_family=AF_INET6?[^}]*}", found)
    assert networks and all('"127.0.0.1"' in place for place in networks), networks
    with quarters() as where:  # seen is what there is to be seen: the same without the proxies that lead nowhere
        loud = {name: value for name, value in where.environment.items() if "proxy" not in name.lower()}
        found = asked(loud, recording, tmp_path)
    assert "github" in found
