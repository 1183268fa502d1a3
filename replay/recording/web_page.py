"""The viewer's web page, served to browsers of this machine by us, so that it asks no other host.

The library's own page takes a font from one host, tells another that it is used, and looks for examples on a third.
Here its parts come from 127.0.0.1, under a Content-Security-Policy by which a browser asks nobody else, whatever the
page wants; and without local storage, in which it would keep a number to be known by.
"""

from __future__ import annotations

import http.client
import http.server
import re
import shutil
import subprocess
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from collections.abc import Callable
from http import HTTPStatus
from pathlib import Path

from replay.errors import ViewerError
from replay.recording.viewer_process import LOOPBACK, free_port, quarters, running, viewer_binary

_USUAL_PORT = 9090
_STARTUP = 60.0  # [s] until the library must have given its page
_PAUSE = 0.05
_INDEX = "index.html"
_PARTS = {
    _INDEX: "text/html; charset=utf-8",
    "re_viewer.js": "text/javascript",
    "re_viewer_bg.wasm": "application/wasm",
    "favicon.ico": "image/x-icon",
}
"""Files of the page with their types."""
_RECORDING = "recording.rrd"
_ELSEWHERE = re.compile(rb"<link\b[^>]*https?://[^>]*>")
_MORE = {
    b"<head>": b"<script>Object.defineProperty(window, 'localStorage', {value: null});</script>",
    b"const options = {": b"check_for_updates_on_startup: false,",
}
"""What is put behind places of the page, so that it does not even try what the policy would not let it do."""
_HEADERS = {
    "Content-Security-Policy": (
        "default-src 'none'; script-src 'self' 'unsafe-inline' 'wasm-unsafe-eval'; style-src 'unsafe-inline'; "
        "img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self' data: blob:; worker-src 'self' blob:; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "X-DNS-Prefetch-Control": "off",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cache-Control": "no-store",
}
_OURS = re.compile(r"(127\.0\.0\.1|localhost|\[::1\])(:\d+)?")
"""What a browser calls us by; another name is a page elsewhere that had its name lead here, to read the recording."""


def serve(file: Path, tell: Callable[[str], None]) -> None:
    """Serve a recording and the viewer to browsers on this machine (127.0.0.1 only) until interrupted.

    Args:
        file: an `.rrd` file.
        tell: called with the address once it answers.

    Raises:
        ViewerError: the viewer is not installed, or does not give its page.
    """
    with _listening(_page(), file) as server:
        tell(f"http://{LOOPBACK}:{server.server_port}/")
        server.serve_forever()


def _listening(page: dict[str, bytes], file: Path) -> _Server:
    """Return a server on the usual port, or on another one where somebody has that."""
    try:
        return _Server((LOOPBACK, _USUAL_PORT), _Handler, page, file)
    except OSError:
        return _Server((LOOPBACK, 0), _Handler, page, file)


def _page() -> dict[str, bytes]:
    """Return the files of the viewer's page, which the viewer program gives over HTTP and nothing else."""
    ports = free_port(), free_port()
    command = [str(viewer_binary()), "--serve-web", "--bind", LOOPBACK]
    command += ["--port", str(ports[0]), "--web-viewer-port", str(ports[1])]
    quiet = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    straight = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    with quarters() as where, running(command, where, **quiet) as process:
        page: dict[str, bytes] = {}
        deadline = time.monotonic() + _STARTUP
        while len(page) < len(_PARTS):
            name = list(_PARTS)[len(page)]
            try:
                with straight.open(f"http://{LOOPBACK}:{ports[1]}/{name}", timeout=_STARTUP) as answer:
                    page[name] = answer.read()
            except urllib.error.HTTPError as error:
                raise ViewerError(f"this version of the rerun viewer has no {name} ({error}); use a window") from None
            except (OSError, http.client.HTTPException) as error:  # it does not listen yet
                if process.poll() is not None or time.monotonic() > deadline:
                    raise ViewerError(f"the rerun viewer does not give its web page: {error}") from None
                time.sleep(_PAUSE)
    index = _ELSEWHERE.sub(b"", page[_INDEX])
    for place, more in _MORE.items():
        index = index.replace(place, place + more, 1)
    return {**page, _INDEX: index}


class _Server(http.server.ThreadingHTTPServer):
    """Answers browsers, each request in a thread that ends with the command."""

    daemon_threads = True
    allow_reuse_address = sys.platform != "win32"  # a port that was just given up; there it would be another's as well

    def __init__(self, place: tuple[str, int], handler: type[_Handler], page: dict[str, bytes], file: Path) -> None:
        self.page = page
        self.file = file
        super().__init__(place, handler)

    def handle_error(self, *_: object) -> None:
        """Say nothing: a browser that goes away in the middle of an answer is no trouble."""


class _Handler(http.server.BaseHTTPRequestHandler):
    """Gives the page, its parts and the recording."""

    protocol_version = "HTTP/1.1"
    server: _Server

    def do_GET(self) -> None:
        """Answer a request."""
        host = self.headers.get("Host", "")
        path, _, query = self.path.partition("?")
        name = path.removeprefix("/") or _INDEX
        if _OURS.fullmatch(host) is None:
            self._answer(HTTPStatus.MISDIRECTED_REQUEST, b"ask for 127.0.0.1\n", "text/plain")
        elif name == _INDEX and not query:  # the viewer reads from the address what to show
            shown = urllib.parse.urlencode(
                {"url": f"http://{host}/{_RECORDING}", "hide_welcome_screen": 1, "persist": 0, "theme": "dark"}
            )
            self._answer(HTTPStatus.FOUND, b"", "text/plain", Location=f"/?{shown}")
        elif name in self.server.page:
            self._answer(HTTPStatus.OK, self.server.page[name], _PARTS[name])
        elif name == _RECORDING:
            self._recording()
        else:
            self._answer(HTTPStatus.NOT_FOUND, b"", "text/plain")

    def log_message(self, *_: object) -> None:
        """Say nothing on the terminal."""

    def _answer(self, status: HTTPStatus, body: bytes, kind: str, **more: str) -> None:
        self._head(status, len(body), kind, **more)
        self.wfile.write(body)

    def _recording(self) -> None:
        try:
            stream = self.server.file.open("rb")
        except OSError as error:
            self._answer(HTTPStatus.NOT_FOUND, f"{error.strerror}\n".encode(), "text/plain")
            return
        with stream:
            self._head(HTTPStatus.OK, self.server.file.stat().st_size, "application/octet-stream")
            shutil.copyfileobj(stream, self.wfile)

    def _head(self, status: HTTPStatus, length: int, kind: str, **more: str) -> None:
        self.send_response(status)
        for name, value in {**_HEADERS, "Content-Type": kind, "Content-Length": str(length), **more}.items():
            self.send_header(name, value)
        self.end_headers()
