"""Standard output and standard error that outlive whoever reads them.

`replay diff A B | head -1`: the reader leaves, and the command goes on, does its work and says by its exit code what
came out. What cannot be written to a pipe without a reader is dropped, and so is whatever cannot be written to standard
error: progress and remarks are no reason to end a night.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from typing import Any


class _Outlet(io.FileIO):
    """A descriptor that takes everything; what nobody can read is dropped.

    Args:
        descriptor: of standard output or error.
        any_error: whether it does not matter why something cannot be written.
    """

    def __init__(self, descriptor: int, *, any_error: bool) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._any_error = any_error

    def write(self, data: Any, /) -> int:
        """Write bytes, or drop them."""
        try:
            return super().write(data)
        except OSError as error:
            if not self._any_error and error.errno != errno.EPIPE:
                raise
            return memoryview(data).nbytes


def install() -> None:
    """Replace sys.stdout and sys.stderr; descriptors that are closed are opened to nothing.

    Otherwise the next file that is opened would be standard output, and get what a library prints.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)  # takes the lowest that is free
    sys.stdin = sys.stdin or open(os.devnull, encoding="utf-8")  # noqa: SIM115, PTH123
    sys.stdout = _outlet(sys.stdout, any_error=False)
    sys.stderr = _outlet(sys.stderr, any_error=True)


def _outlet(stream: Any, *, any_error: bool) -> Any:
    """Return a stream to the same place, with its encoding; a console of Windows stays as it is."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    raw = getattr(stream.buffer, "raw", stream.buffer)
    if not isinstance(raw, io.FileIO):
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(_Outlet(raw.fileno(), any_error=any_error)),
        encoding=stream.encoding,
        errors=stream.errors,
        line_buffering=stream.line_buffering or stream.write_through,
    )
