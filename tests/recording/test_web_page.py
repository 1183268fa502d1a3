"""The viewer in a real browser: it shows the recording, and asks no host but ours."""

import contextlib
import http.client
import http.server
import io
import os
import re
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import sync_playwright

from replay.cli.exit_codes import ExitCode
from replay.recording.rerun_log import RerunWriter
from replay.recording.viewer_process import free_port, quarters, running, viewer_binary
from tests.recording import moving

ROOT = Path(__file__).parents[2]
FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"]

SLOW = 300_000  # [ms] a browser without a graphics card on a busy machine
BROWSERS_OWN = re.compile(r"(accounts|clients\d?|safebrowsing)\.google\.com|(?!fonts\.)[\w-]+\.googleapis\.com")
"""What the browser asks by itself, on any page: for updates, accounts, and what may be filled into fields."""


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    path = tmp_path_factory.mktemp("web") / "moving.rrd"
    writer = RerunWriter(path, moving.LAYOUT, moving.scene())
    for block in moving.blocks(120):
        writer.write(block)
    writer.commit()
    return path


@contextlib.contextmanager
def viewing(*arguments, places):
    """Run `replay view --web` with a folder for its temporary files; yield the line that it prints, and its address."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "TMPDIR": str(places), "HOME": str(places / "home")}
    environment |= {"XDG_CONFIG_HOME": str(places / "home"), "XDG_DATA_HOME": str(places / "home")}
    command = [sys.executable, "-m", "replay", "view", "--web", *map(str, arguments)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment
    ) as process:
        line = process.stdout.readline()
        try:
            yield line, int(re.match(r"http://127\.0\.0\.1:(\d+)/ ", line)[1])
        finally:
            process.send_signal(signal.SIGTERM)
            assert process.wait(timeout=30.0) == ExitCode.INTERRUPTED
            assert process.stderr.read().strip() == "replay: interrupted"


class _Listener(http.server.BaseHTTPRequestHandler):
    def answer(self):
        self.server.asked.append(self.path)
        self.send_error(502)

    do_CONNECT = do_GET = do_POST = do_HEAD = answer

    def log_message(self, *_):
        pass


@contextlib.contextmanager
def browser():
    """Yield a browser, and the list of what it asks hosts other than this machine for: its proxy takes them down."""
    chromium = shutil.which("chromium")
    assert chromium, "this test needs a browser (Debian: apt-get install chromium)"
    proxy = http.server.ThreadingHTTPServer(("127.0.0.1", 0), _Listener)
    proxy.asked = []
    threading.Thread(target=proxy.serve_forever, daemon=True).start()
    through = f"--proxy-server=http://127.0.0.1:{proxy.server_port}"
    with proxy, sync_playwright() as playwright:
        opened = playwright.chromium.launch(executable_path=chromium, args=[*FLAGS, through])
        yield opened, proxy.asked
        opened.close()
        proxy.shutdown()


def hosts(asked):
    """Return the hosts of what a proxy was asked for: HOST:PORT, or an address."""
    return {urlsplit(what if "://" in what else f"//{what}").hostname for what in asked}


def test_the_page_shows_the_recording_and_asks_nobody_else(recording, tmp_path):
    with viewing(recording, places=tmp_path) as (line, port), browser() as (opened, asked):
        assert line == f"http://127.0.0.1:{port}/ shows moving.rrd until Ctrl-C\n"
        page = opened.new_page(viewport={"width": 1000, "height": 700})
        requests, said = [], []
        page.on("request", lambda request: requests.append(request.url))
        page.on("console", lambda message: said.append(message.text))
        page.goto(f"http://127.0.0.1:{port}/")
        page.locator("#the_canvas_id.visible").wait_for(timeout=SLOW)
        deadline = time.monotonic() + SLOW / 1000
        while not any("recording.rrd has finished" in text for text in said) and time.monotonic() < deadline:
            page.wait_for_timeout(500)
        page.wait_for_timeout(12_000)  # [ms] the library sends what it has gathered every few seconds
        with Image.open(io.BytesIO(page.screenshot(timeout=SLOW))) as image:
            pixels = np.asarray(image.convert("RGB"))
        stored = page.context.storage_state()["origins"]
    assert f"http://127.0.0.1:{port}/recording.rrd" in requests
    assert {url for url in requests if not url.startswith((f"http://127.0.0.1:{port}/", "blob:", "data:"))} == set()
    assert [host for host in hosts(asked) if not BROWSERS_OWN.fullmatch(host)] == []
    assert stored == []
    assert list(tmp_path.iterdir()) == []
    scene = pixels[100:600, :550].reshape(-1, 3)
    assert len(np.unique(scene, axis=0)) > 100  # the scene is large, as the recording's own arrangement has it
    assert "Content Security Policy" not in "\n".join(said)  # it does not even try


def test_the_librarys_own_page_would_ask_others():
    """Listening hears what there is to be heard."""
    port = free_port()
    command = [str(viewer_binary()), "--serve-web", "--bind", "127.0.0.1"]
    command += ["--port", str(free_port()), "--web-viewer-port", str(port)]
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    with quarters() as where, running(command, where, **quiet), browser() as (opened, asked):
        page = opened.new_page()
        for _ in range(100):
            with contextlib.suppress(Exception):
                page.goto(f"http://127.0.0.1:{port}/")
                break
            page.wait_for_timeout(100)
        page.wait_for_timeout(3_000)
    assert "fonts.googleapis.com" in hosts(asked)


def test_only_those_who_ask_for_this_machine_are_answered(recording, tmp_path):
    def ask(port, path, host):
        with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
            connection.request("GET", path, headers={"Host": host})
            answer = connection.getresponse()
            return answer.status, answer.headers, answer.read()

    with viewing(recording, places=tmp_path) as (_, port):
        status, _, body = ask(port, "/recording.rrd", f"127.0.0.1:{port}")
        assert (status, body) == (200, recording.read_bytes())
        for host in ("evil.example", f"evil.example:{port}", "127.0.0.1.evil.example", "", "localhost@evil.example"):
            assert ask(port, "/recording.rrd", host)[0] == 421
        status, headers, _ = ask(port, "/", "localhost:1234")  # as through a tunnel
        assert (status, headers["Location"].split("&")[0]) == (
            302,
            "/?url=http%3A%2F%2Flocalhost%3A1234%2Frecording.rrd",
        )
        for path in ("/../moving.rrd", "/moving.rrd", "//etc/passwd", "/%2e%2e/", "/sw.js"):
            assert ask(port, path, "localhost")[0] == 404
        _, headers, page = ask(port, "/?a=b", "localhost")
        assert "connect-src 'self'" in headers["Content-Security-Policy"]
        assert "Access-Control-Allow-Origin" not in headers
        assert not re.search(rb"<link[^>]*https?:", page)


def test_a_second_viewer_finds_a_port(recording, tmp_path):
    places = [tmp_path / name for name in "ab"]
    for place in places:
        place.mkdir()
    with viewing(recording, places=places[0]) as (_, one), viewing(recording, places=places[1]) as (_, other):
        assert one != other
