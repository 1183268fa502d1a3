"""The viewer program of the rerun package as a process that sends nothing anywhere and leaves nothing behind."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import socket
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from replay.errors import ViewerError

LOOPBACK = "127.0.0.1"
_ENDING = 10.0  # [s] until a viewer that is asked to end is killed
_HOME = ("HOME", "XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_CACHE_HOME", "XDG_STATE_HOME", "APPDATA", "LOCALAPPDATA")
_TEMPORARY = ("TMPDIR", "TEMP", "TMP")
_NOWHERE = f"http://{LOOPBACK}:9"  # the port of what takes and answers nothing, where nobody listens
_PROXIES = ("HTTP_PROXY", "HTTPS_PROXY", "ALL_PROXY")
_HERE = f"{LOOPBACK},localhost"
_QUIET = {
    "CI": "true",  # the library counts nobody's use in continuous integration
    "TELEMETRY_ENABLED": "false",
    **dict.fromkeys((*_PROXIES, *map(str.lower, _PROXIES)), _NOWHERE),  # it asks for new versions and examples
    **dict.fromkeys(("NO_PROXY", "no_proxy"), _HERE),
}
_LOUD = "FORCE_RERUN_ANALYTICS"


def viewer_binary() -> Path:
    """Return the viewer program that comes with the rerun package.

    The `rerun` script beside it starts it as a child, which then outlives a script that is stopped.

    Raises:
        ViewerError: the package has none.
    """
    spec = importlib.util.find_spec("rerun_cli")
    folder = Path(spec.origin).parent if spec and spec.origin else None
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    if folder is None or not (folder / name).is_file():
        raise ViewerError("the rerun viewer is not installed; pip install rerun-sdk brings it")
    return folder / name


@dataclass(frozen=True)
class Quarters:
    """Where a viewer lives: a home of its own, empty but for the word that its user takes no part in statistics.

    Nobody's settings change what it shows, no server that they name is asked, and what it writes goes with the home.

    Attributes:
        home: the folder.
        environment: for the process.
    """

    home: Path
    environment: dict[str, str]


@contextlib.contextmanager
def quarters() -> Iterator[Quarters]:
    """Give a viewer a home, which is gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="replay-view-", ignore_cleanup_errors=True) as name:
        home = Path(name)
        environment = {key: value for key, value in os.environ.items() if key != _LOUD}
        environment.setdefault("XAUTHORITY", str(Path.home() / ".Xauthority"))  # what a window needs of the true home
        environment |= dict.fromkeys((*_HOME, *_TEMPORARY), name) | _QUIET
        refused = {"analytics_enabled": False, "analytics_id": "", "metadata": {}}
        for place in (home / "rerun", home / "Library" / "Application Support" / "rerun"):  # the second is macOS's
            place.mkdir(parents=True)
            paths = {"config_file_path": str(place / "analytics.json"), "data_dir_path": str(place / "analytics")}
            (place / "analytics.json").write_text(json.dumps(refused | paths), encoding="utf-8")
        yield Quarters(home, environment)


@contextlib.contextmanager
def running(command: list[str], where: Quarters, **streams: Any) -> Iterator[subprocess.Popen[bytes]]:
    """Run a viewer; it is ended afterwards, and by whatever interrupts the start of it."""
    begun: list[subprocess.Popen[bytes]] = []
    try:
        with ThreadPoolExecutor(1) as starter:  # no signal interrupts a thread: a viewer that has begun is known here
            starter.submit(int).result()  # the thread is there
            start = lambda: begun.append(subprocess.Popen(command, env=where.environment, **streams))  # noqa: E731
            starter.submit(start).result()
        yield begun[0]
    finally:
        for process in begun:
            _end(process)


def _end(viewer: subprocess.Popen[bytes]) -> None:
    """End a viewer, unless it has ended."""
    viewer.terminate()
    try:
        viewer.wait(timeout=_ENDING)
    except subprocess.TimeoutExpired:
        viewer.kill()
        viewer.wait()


def free_port() -> int:
    """Return a port of 127.0.0.1 that nobody listens on."""
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])
