"""A rerun recording as a file that is whole or not there.

The library's own writing thread stops at the first error, such as a full disk, and whoever then flushes or closes the
stream waits for ever. So the library writes into a pipe, which never fails, and the bytes are written to the file here,
where an error is an error. (Windows has no such pipe: there the library writes the file.)
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from replay.errors import WriteError
from replay.logs.part_file import PartFile

_FLUSH = 60.0  # [s] until what was sent must have been written
_PIECE = 1 << 20  # bytes
_LITTLE = 1 << 15  # bytes; a pipe holds more, so that the library need not wait when there are fewer
_PAUSE = 0.005  # [s] after little, lest every chunk wakes a thread that takes the interpreter from the others


class RerunFile:
    """One rerun recording: NAME.rrd.part while it grows, NAME.rrd when it is whole.

    Attributes:
        path: the final name.
        stream: the rerun.RecordingStream, once it is open; it must not be flushed or closed by anyone else.
    """

    def __init__(self, path: str | Path, *, overwrite: bool) -> None:
        """Create the file.

        Raises:
            RecordingExistsError: it exists and may not be overwritten.
            WriteError: the file cannot be written.
        """
        self._file = PartFile(Path(path), overwrite=overwrite)
        self.path = self._file.path
        self.stream: Any = None
        self._error: BaseException | None = None
        self._thread: threading.Thread | None = None
        self._closing: threading.Thread | None = None
        self._ending = threading.Event()

    def open(self, application: str, **options: Any) -> Any:
        """Open the stream and return it; `options` are those of rerun.RecordingStream.save."""
        import rerun as rr

        self.stream = rr.RecordingStream(application)
        try:
            if sys.platform == "win32":
                self.stream.save(self._file.part, **options)
            else:
                self._open_pipe(options)
        except (OSError, RuntimeError) as error:
            raise WriteError(str(self.path), str(error)) from None
        return self.stream

    def flush(self) -> None:
        """Wait until everything that was sent is written; WriteError when that fails."""
        try:
            self.stream.flush(timeout_sec=_FLUSH)
        except Exception as error:
            raise WriteError(str(self.path), f"not all of it was written: {error}") from None
        self._check()

    def finish(self) -> None:
        """Begin to finish the recording in the background: all is written and the file is made durable."""
        if self.stream is not None and self._closing is None:
            self._ending.set()
            self._closing = threading.Thread(target=self._close, name="replay-rrd-end", daemon=True)
            self._closing.start()

    def commit(self) -> None:
        """Finish the recording and give the file its name; WriteError when not all of it reached the disk."""
        self._wait()
        self._check()
        self._file.commit()

    def discard(self) -> None:
        """Give the recording up and remove the unfinished file."""
        self._wait()
        self._file.discard()

    def _wait(self) -> None:
        self.finish()
        if self._closing is not None:
            self._closing.join()

    def _open_pipe(self, options: dict[str, Any]) -> None:
        source, sink = os.pipe()
        _widen(sink)
        self._thread = threading.Thread(target=self._copy, args=(source,), name="replay-rrd", daemon=True)
        self._thread.start()
        try:
            self.stream.save(f"/dev/fd/{sink}", **options)
        finally:
            os.close(sink)  # the library has an end of its own; when that is closed, so is the pipe

    def _copy(self, source: int) -> None:
        with contextlib.closing(os.fdopen(source, "rb", buffering=0)) as pipe:
            while data := pipe.read(_PIECE):
                if self._error is None:  # after an error the rest is only taken, so that nobody waits
                    self._guard(self._file.write, data)
                if len(data) < _LITTLE:
                    self._ending.wait(_PAUSE)

    def _close(self) -> None:
        self._guard(self.flush)
        self._guard(self.stream.disconnect)
        if self._thread is not None:
            self._thread.join()
        if self._error is None:
            self._guard(self._file.finish)

    def _guard(self, task: Callable[..., None], *arguments: bytes) -> None:
        """Run a task and keep the first error: nobody waits for this thread until the end."""
        try:
            task(*arguments)
        except BaseException as error:
            self._error = self._error or error

    def _check(self) -> None:
        if self._error is not None:
            raise self._error


def _widen(pipe: int) -> None:
    """Let a pipe hold as much as is read from it at once, so that the library need not wait for the interpreter."""
    if sys.platform == "linux":
        import fcntl

        with contextlib.suppress(OSError):  # a user may have many pipes, or less room for them
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIECE)
