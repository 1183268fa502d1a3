"""The door of the terminal: all that the command writes goes through it.

Nothing of it steers the terminal: what would is written as escapes, whoever writes it. And the door outlives whoever
reads behind it. `replay diff A B | head -1`: the reader leaves, and the command goes on, does its work and says by its
exit code what came out. What cannot be written to a pipe without a reader is dropped, and so is whatever cannot be
written to standard error: progress and remarks are no reason to end a night.
"""

from __future__ import annotations

import contextlib
import errno
import io
import os
import sys
from collections.abc import Iterable
from typing import Any

import click

from replay.errors import printable


class Door:
    """A text stream before another one: what would steer a terminal is written as escapes, whoever writes it.

    Attributes:
        beneath: the stream behind it, for what moves the cursor on purpose.
    """

    def __init__(self, beneath: Any) -> None:
        self.beneath = beneath

    def write(self, text: str, /) -> int:
        """Write text; lines stay lines."""
        self.beneath.write(printable(text, keep="\n\t"))
        return len(text)

    def writelines(self, lines: Iterable[str], /) -> None:
        """Write several texts."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        if name == "buffer":  # the way around
            raise AttributeError(name)
        return getattr(self.beneath, name)


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
    """Put doors before standard output and standard error; descriptors that are closed are opened to nothing.

    Otherwise the next file that is opened would be standard output, and get what a library prints.
    """
    for descriptor in (0, 1, 2):
        try:
            os.fstat(descriptor)
        except OSError:
            with contextlib.suppress(OSError):
                os.open(os.devnull, os.O_RDWR)  # takes the lowest that is free
    sys.stdin = sys.stdin or open(os.devnull, encoding="utf-8")  # noqa: SIM115, PTH123
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if not isinstance(stream, Door):
            setattr(sys, name, Door(_outlet(stream, any_error=name == "stderr")))


def _outlet(stream: Any, *, any_error: bool) -> Any:
    """Return a stream to the same place; what its encoding lacks is shown as escapes.

    A console of Windows stays as it is, and so does what is no stream of Python's own.
    """
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")  # noqa: PTH123
    if not isinstance(stream, io.TextIOWrapper):
        return stream
    raw = getattr(stream.buffer, "raw", stream.buffer)
    if not isinstance(raw, io.FileIO):
        stream.reconfigure(errors="backslashreplace")
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(_Outlet(raw.fileno(), any_error=any_error)),
        encoding=stream.encoding,
        errors="backslashreplace",
        line_buffering=stream.line_buffering or stream.write_through,
    )


def stderr_beneath() -> Any:
    """Return standard error itself, for bars that move: what they show of others has to be `printable` before."""
    stream: Any = sys.stderr
    return stream.beneath if isinstance(stream, Door) else stream


def put(lines: Iterable[str], *, err: bool = False) -> None:
    """Write lines to standard output or standard error; a line break within one of them makes no second line."""
    click.echo("\n".join(map(printable, lines)), err=err)
