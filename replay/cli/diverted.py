"""Standard error put aside for a while: what libraries write there goes to a file."""

from __future__ import annotations

import contextlib
import os
import sys
from collections import Counter
from collections.abc import Iterator
from typing import Any, BinaryIO, TextIO

_MOST = 1 << 20  # bytes that are read of what libraries say


@contextlib.contextmanager
def diverted_stderr(to: BinaryIO) -> Iterator[TextIO]:
    """Let all that is written to standard error go to a file, by Python, by native code or by processes started here.

    Yields:
        A stream to where it went before, for what the user is to see meanwhile.
    """
    sys.stderr.flush()
    before = os.dup(2)
    how: Any = {"mode": "w", "buffering": 1, "encoding": "utf-8", "errors": "backslashreplace", "closefd": False}
    try:
        with open(before, **how) as shown, open(2, **how) as written:  # noqa: PTH123
            os.dup2(to.fileno(), 2)
            with contextlib.redirect_stderr(written):
                yield shown
    finally:
        os.dup2(before, 2)
        os.close(before)


def lines_of(file: BinaryIO) -> list[str]:
    """Return the lines that a file holds, in the order in which they came first and with how often, and empty it."""
    sys.stderr.flush()
    file.seek(0)
    times = Counter(line.rstrip() for line in file.read(_MOST).decode(errors="backslashreplace").splitlines())
    file.seek(0)
    file.truncate()
    return [f"{line} ({count} times)" if count > 1 else line for line, count in times.items() if line]
