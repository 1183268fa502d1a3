"""The rerun viewer in a window or in a browser; it never outlives the command that opened it."""

from __future__ import annotations

import contextlib
import socket
import subprocess
import sys
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from replay.errors import ViewerError
from replay.lfs_pointer import LARGEST_POINTER, LFS_POINTER, is_lfs_pointer
from replay.recording.picture import end, viewer_binary


def rerun_files(recordings: Sequence[str | Path]) -> list[Path]:
    """Return the `.rrd` file of each recording: the file itself, or for a `.mcap` the one beside it.

    Raises:
        ViewerError: a file is not there, is neither, or is a Git LFS pointer.
    """
    files = []
    for path in map(Path, recordings):
        if path.suffix not in (".rrd", ".mcap"):
            raise ViewerError(f"{path}: is neither a .rrd nor a .mcap recording")
        if not path.is_file():
            raise ViewerError(f"{path}: no such file")
        rrd = path.with_suffix(".rrd")
        if not rrd.is_file():
            raise ViewerError(f"{path}: has no {rrd.name} beside it; `replay run {path} -o DIR` makes one")
        with rrd.open("rb") as stream:
            if is_lfs_pointer(stream.read(LARGEST_POINTER)):
                raise ViewerError(f"{rrd}: {LFS_POINTER}")
        files.append(rrd)
    return files


def show(file: Path, *, web: bool = False) -> None:
    """Open a recording in a viewer and wait until it is closed.

    Args:
        file: an `.rrd` file.
        web: serve the viewer to browsers on this machine (127.0.0.1 only) until interrupted.

    Raises:
        ViewerError: the viewer is not installed or fails, as it does without a display.
    """
    command = [str(viewer_binary()), str(file), "--bind", "127.0.0.1"]  # the window takes data from others too
    if web:
        command += ["--web-viewer", "--web-viewer-port", str(free_port(9090)), "--port", str(free_port(9876))]
    begun: list[subprocess.Popen[bytes]] = []
    try:
        with ThreadPoolExecutor(1) as starter:  # no signal interrupts a thread: a viewer that has begun is known here
            starter.submit(int).result()  # the thread is there
            starter.submit(lambda: begun.append(subprocess.Popen(command))).result()
        code = begun[0].wait()
    finally:
        for process in begun:
            end(process)
    if code != 0:
        hint = "" if web else "; without a display use --web or --screenshot"
        raise ViewerError(f"the rerun viewer failed with code {code}{hint}")


def free_port(usual: int) -> int:
    """Return a port of 127.0.0.1 that nobody listens on: the usual one, unless another viewer has it."""
    for port in (usual, 0):
        with socket.socket() as probe, contextlib.suppress(OSError):
            if sys.platform != "win32":  # a port whose viewer has just ended is free; Windows means another thing by it
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(("127.0.0.1", port))
            return int(probe.getsockname()[1])
    raise ViewerError("no port of 127.0.0.1 is free for the viewer")
