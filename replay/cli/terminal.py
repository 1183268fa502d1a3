"""The door of the terminal: all that the command writes goes through it, and nothing of it steers the terminal."""

from __future__ import annotations

import io
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


def install() -> None:
    """Put doors before standard output and standard error; what the terminal's encoding lacks is shown as escapes."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None or isinstance(stream, Door):
            continue
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
        setattr(sys, name, Door(stream))


def stderr_beneath() -> Any:
    """Return standard error itself, for bars that move: what they show of others has to be `printable` before."""
    stream: Any = sys.stderr
    return stream.beneath if isinstance(stream, Door) else stream


def put(lines: Iterable[str], *, err: bool = False) -> None:
    """Write lines to standard output or standard error; a line break within one of them makes no second line."""
    click.echo("\n".join(map(printable, lines)), err=err)
