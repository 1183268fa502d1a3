"""A door that something comes in by, and how damaged input is brought in."""

from __future__ import annotations

import contextlib
import io
import random
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.errors import ReplayError


@dataclass(frozen=True)
class Door:
    """A way in.

    Attributes:
        weight: share of the executions.
        make: damaged input, by file name.
        enter: brings it in from a folder; raises ReplayError where it is refused.
    """

    weight: int
    make: Callable[[random.Random], dict[str, bytes]]
    enter: Callable[[Path], object]


def command(*arguments: str) -> ExitCode:
    """Run the command line; AssertionError for a traceback."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = run(arguments)
    assert "fault of replay" not in err.getvalue(), err.getvalue()[-2000:]
    return code


def knock(door: Door, folder: Path, files: dict[str, bytes]) -> str:
    """Bring files in by a door; return what became of them: "read", or "refused" in one line each."""
    for name, data in files.items():
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_bytes(data)
    try:
        with np.errstate(all="ignore"):
            done = door.enter(folder)
    except ReplayError as error:
        assert str(error).strip(), "an error without a word"
        assert all(len(line) < 2000 for line in str(error).splitlines()), "an error of endless words"
        return "refused"
    return "refused" if done is ExitCode.INVALID else "read"
