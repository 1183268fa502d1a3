"""A picture of a rerun recording at one moment, rendered by the viewer without a display."""

from __future__ import annotations

import contextlib
import re
import shutil
import subprocess
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO, Any

from replay.errors import ViewerError
from replay.logs.part_file import write_file
from replay.recording.blueprint import TIMELINE
from replay.recording.own_folder import own_folder
from replay.recording.rearranged import Camera, write_rearranged
from replay.recording.viewer_process import LOOPBACK, free_port, quarters, running, viewer_binary

_STARTUP = 60.0  # [s] until the viewer must answer
_LOADING = 120.0  # [s] until the picture must have come to rest
_PAUSE = 0.5
_TYPED = 10_000_000  # [ns] by which a moment may be after the end: the end typed with few digits


def picture(
    recording: str | Path,
    png: str | Path,
    *,
    at: float | None = None,
    size: tuple[int, int] = (1280, 800),
    camera: Camera | None = None,
    only_scene: bool = False,
) -> None:
    """Render a recording as the viewer shows it.

    Args:
        recording: an `.rrd` file.
        png: the picture to write.
        at: moment to show [s] from the start; its end when None.
        size: width and height of the viewer's window [pixels], and of a picture of all of it.
        camera: from where the scene is looked at; as the recording says when None.
        only_scene: the scene alone, without the window around it, its charts and tables.

    Raises:
        ViewerError: the viewer is not installed, cannot render here (it needs a Vulkan driver, such as Debian's
            mesa-vulkan-drivers), lacks a letter, cannot read the recording, or does not come to rest in time; or
            the recording ends before the moment.
        WriteError: the picture cannot be written.
    """
    recording, png = Path(recording), Path(png)
    if not recording.is_file():
        raise ViewerError(f"{recording}: no such file")
    with _arranged(recording.resolve(), camera, only_scene) as (file, view), _viewer(file, size) as viewer:
        state = _when(viewer.get_state, lambda s: s.recordings and not s.loading, _LOADING, f"{recording}: not loaded")
        shown = state.recordings[0]
        lines = {line.name: line for line in shown.timelines}
        if TIMELINE not in lines or lines[TIMELINE].end is None:
            raise ViewerError(f"{recording}: has no timeline {TIMELINE!r}; is it a recording of replay?")
        end = int(lines[TIMELINE].end)
        moment = end if at is None else round(at * 1e9)
        if moment > end + _TYPED:
            raise ViewerError(f"{recording}: has no moment {at:g} s; it ends at {end / 1e9:g} s")
        viewer.set_time(TIMELINE, duration=_nanoseconds(min(moment, end)), play_state="paused")
        before, now = b"", None
        deadline = time.monotonic() + _LOADING
        while now is None or now != before:
            if time.monotonic() > deadline:
                raise ViewerError(f"{recording}: the viewer's picture did not come to rest in {_LOADING:.0f} s")
            time.sleep(_PAUSE)
            with contextlib.suppress(TimeoutError):  # the library gives a picture 15 s, a busy machine may need more
                before, now = now or b"", viewer.take_screenshot(view)
    write_file(png, now, named=True)


@contextlib.contextmanager
def _arranged(recording: Path, camera: Camera | None, only_scene: bool) -> Iterator[tuple[Path, Any]]:
    """Give the recording itself or, where it is to be seen otherwise, another one that is gone afterwards; and a view.

    The view is the scene's where that alone is wanted, and None for the whole window.
    """
    if camera is None and not only_scene:
        yield recording, None
        return
    with own_folder() as folder:
        target = folder / recording.name
        view = write_rearranged(recording, target, camera=camera, only_scene=only_scene)
        yield target, view


@contextlib.contextmanager
def _viewer(recording: Path, size: tuple[int, int]) -> Iterator[Any]:
    """Run a viewer of its own, which nobody else can reach, and yield the client that steers it."""
    from rerun.experimental import ViewerClient

    port = free_port()
    command = [str(viewer_binary()), "--headless", "--bind", LOOPBACK, "--port", str(port)]
    command += ["--window-size", f"{size[0]}x{size[1]}", "--hide-welcome-screen"]
    with tempfile.TemporaryFile("w+") as log, quarters() as where:
        command.append(_plain_name(recording, where.home))
        where.environment["RUST_LOG"] = "error"  # what it would tell beside that stands over the picture for seconds
        with running(command, where, stdout=log, stderr=subprocess.STDOUT) as process:
            yield _connect(ViewerClient, f"rerun+http://{LOOPBACK}:{port}/proxy", process, log)


def _plain_name(recording: Path, folder: Path) -> str:
    """Return a path that leads to the recording: the viewer shows it, and stops at a letter that its font lacks."""
    plain = folder / f"recording{recording.suffix}"
    try:
        plain.symlink_to(recording)
    except OSError:  # Windows allows it to some only
        shutil.copyfile(recording, plain)
    return str(plain)


def _connect(client_type: Any, url: str, process: subprocess.Popen[bytes], log: IO[str]) -> Any:
    deadline = time.monotonic() + _STARTUP
    while time.monotonic() < deadline:
        if process.poll() is not None:
            log.seek(0)
            raise ViewerError(f"the rerun viewer stopped at once: {_cause(log.read())}")
        try:
            client = client_type.connect(url)
            client.get_state()
            return client
        except Exception:  # whatever the library raises while nobody listens yet
            time.sleep(_PAUSE)
    raise ViewerError(f"the rerun viewer did not answer in {_STARTUP:.0f} s")


def _cause(log: str) -> str:
    """Return why a viewer stopped, from what it said."""
    if missing := re.search(r"No glyph for (\S+ \(U\+\w+\))", log):
        return f"its font has no letter {missing[1]}, which is in a name or a text that it shows"
    without = ("graphics adapter", "render context")
    if any(words in log for words in without):
        return "it found no Vulkan driver; on Debian, apt-get install mesa-vulkan-drivers"
    lines = [line for line in log.splitlines() if "panicked at" in line] or log.strip().splitlines()[-1:]
    return lines[0] if lines else "no message"


def _when(get: Any, ready: Any, seconds: float, reason: str) -> Any:
    deadline = time.monotonic() + seconds
    while time.monotonic() < deadline:
        value = get()
        if ready(value):
            return value
        time.sleep(_PAUSE)
    raise ViewerError(f"{reason} in {seconds:.0f} s")


def _nanoseconds(value: int) -> Any:
    import numpy as np

    return np.timedelta64(value, "ns")
