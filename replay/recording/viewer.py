"""The rerun viewer in a window; it never outlives the command that opened it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from replay.errors import ViewerError
from replay.lfs_pointer import LARGEST_POINTER, LFS_POINTER, is_lfs_pointer
from replay.recording.viewer_process import LOOPBACK, free_port, quarters, running, viewer_binary


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


def show(file: Path) -> None:
    """Open a recording in a window of its own and wait until it is closed; see `web_page.serve` for a browser.

    Args:
        file: an `.rrd` file.

    Raises:
        ViewerError: the viewer is not installed or fails, as it does without a display.
    """
    command = [str(viewer_binary()), str(file.resolve()), "--hide-welcome-screen"]
    command += ["--bind", LOOPBACK, "--port", str(free_port())]  # it takes data from others; another viewer is not ours
    with quarters() as where, running(command, where) as process:
        code = process.wait()
    if code != 0:
        raise ViewerError(f"the rerun viewer failed with code {code}; without a display use --web or --screenshot")
