"""Exit codes, one meaning each, and which one wins when several apply."""

from __future__ import annotations

import enum
from collections.abc import Iterable


class ExitCode(enum.IntEnum):
    """What the shell is told."""

    FINE = 0
    DIFFERENT = 1
    INVALID = 2  # usage, invalid or unreadable input
    LOSSES = 3  # finished, but data was salvaged
    FAILED = 4  # a scenario failed: crash, timeout, memory, missing baseline, broken expectation
    NOTHING = 5  # nothing was selected
    INTERRUPTED = 130


_PRECEDENCE = (
    ExitCode.INTERRUPTED,
    ExitCode.INVALID,
    ExitCode.FAILED,
    ExitCode.LOSSES,
    ExitCode.DIFFERENT,
    ExitCode.NOTHING,
    ExitCode.FINE,
)


def worst(codes: Iterable[ExitCode]) -> ExitCode:
    """Return the code that wins among several; FINE for none."""
    return min(codes, key=_PRECEDENCE.index, default=ExitCode.FINE)
