"""A rerun recording as a file that is whole or not there.

The library's own writing thread stops at the first error, such as a full disk, and whoever then flushes or closes the
stream waits for ever. So the library writes into a pipe, which never fails, and the bytes are written to the file here,
where an error is an error. (Windows has no such pipe: there the library writes the file.)

The library keeps every recording of a process, with four threads each, until it is told to look for those that nobody
holds any more, and a blueprint that was sent holds itself. Both are seen to here, or a night would grow by 1.4 MiB with
each recording.
"""

from __future__ import annotations

import contextlib
import os
import sys
import threading
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import Any

from replay.errors import WriteError
from replay.logs.part_file import PartFile
from replay.recording import rerun_inside

_FLUSH = 60.0  # [s] until what was sent must have been written
_PIECE = 1 << 20  # bytes
_LITTLE = 1 << 15  # bytes; a pipe holds more, so that the library need not wait when there are fewer
_PAUSE = 0.005  # [s] after little, lest every chunk wakes a thread that takes the interpreter from the others

_opening = threading.Lock()
_unfinished: weakref.WeakSet[RerunFile] = weakref.WeakSet()
"""Recordings that this process writes now."""


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

    def open(self, application: str) -> Any:
        """Open the stream and return it."""
        import rerun as rr

        with _opening:
            if not _unfinished:  # the library waits for those, holding what this thread would need to write them
                _give_back()
            _unfinished.add(self)
            self.stream = rr.RecordingStream(application)
        try:
            if sys.platform == "win32":
                self.stream.save(self._file.part)
            else:
                self._open_pipe()
        except (OSError, RuntimeError) as error:
            raise WriteError(str(self.path), str(error)) from None
        return self.stream

    def arrange(self, blueprint: Any) -> None:
        """Say how the viewer arranges the recording; `blueprint` is as of rerun.RecordingStream.send_blueprint."""
        rerun_inside.send_blueprint(self.stream, blueprint)

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

    def _open_pipe(self) -> None:
        source, sink = os.pipe()
        _widen(sink)
        self._thread = threading.Thread(target=self._copy, args=(source,), name="replay-rrd", daemon=True)
        self._thread.start()
        try:
            self.stream.save(f"/dev/fd/{sink}")
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
        _unfinished.discard(self)

    def _guard(self, task: Callable[..., None], *arguments: bytes) -> None:
        """Run a task and keep the first error: nobody waits for this thread until the end."""
        try:
            task(*arguments)
        except BaseException as error:
            self._error = self._error or error

    def _check(self) -> None:
        if self._error is not None:
            raise self._error


def _give_back() -> None:
    """Let the library give back what it keeps of recordings that nobody holds: it does so when it is begun anew."""
    import rerun as rr

    if rr.get_global_data_recording() is None:  # a caller's own recording would be taken away
        with contextlib.suppress(RuntimeError):  # one of a caller's own cannot be written; ours will say so themselves
            rr.init("replay", init_logging=False)


def _widen(pipe: int) -> None:
    """Let a pipe hold as much as is read from it at once, so that the library need not wait for the interpreter."""
    if sys.platform == "linux":
        import fcntl

        with contextlib.suppress(OSError):  # a user may have many pipes, or less room for them
            fcntl.fcntl(pipe, fcntl.F_SETPIPE_SZ, _PIECE)
