"""A folder for what a command needs while it runs; what a command that was killed has left, the next one removes."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

_PREFIX = "replay-view-"
_YOUNG = 60.0  # [s] a folder may be there without being held yet


@contextlib.contextmanager
def own_folder() -> Iterator[Path]:
    """Give a new folder in the place for temporary files, which is gone afterwards."""
    _remove_left()
    with tempfile.TemporaryDirectory(prefix=_PREFIX, ignore_cleanup_errors=True) as name, _held(Path(name)):
        yield Path(name)


def _remove_left() -> None:
    """Remove folders of ours that nobody holds: whoever made them did not end by itself."""
    if sys.platform == "win32":  # where folders cannot be held
        return
    for folder in Path(tempfile.gettempdir()).glob(f"{_PREFIX}*"):
        with contextlib.suppress(OSError):  # somebody holds it, or has removed it
            found = folder.lstat()
            if found.st_uid == os.getuid() and time.time() - found.st_mtime > _YOUNG:
                with _held(folder):
                    shutil.rmtree(folder)


@contextlib.contextmanager
def _held(folder: Path) -> Iterator[None]:
    """Hold a folder, as long as this process lives at most; OSError when somebody else does, or it is no folder."""
    if sys.platform == "win32":
        yield
        return
    import fcntl

    handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)
