"""An error that nobody has foreseen as one line: what it is, what it says, and where in this package it was raised."""

from __future__ import annotations

import traceback
from pathlib import Path

import replay

_PACKAGE = Path(replay.__file__).parent
_ANYWHERE = (MemoryError, RecursionError)
"""Raised wherever the last bit of room was asked for, which says nothing."""
_OWN = _PACKAGE / "batch" / "worker.py"


def told(error: Exception) -> str:
    """Return "KeyError: 'arm' (replay/scenario/links.py:88)": with the innermost place in the package, if any."""
    line = ": ".join(filter(None, [type(error).__name__, " ".join(str(error).split())]))
    places = [
        f"{_PACKAGE.name}/{file.relative_to(_PACKAGE).as_posix()}:{frame.lineno}"
        for frame in traceback.extract_tb(error.__traceback__)
        for file in [Path(frame.filename)]
        if file.is_relative_to(_PACKAGE) and file != _OWN
    ]
    return f"{line} ({places[-1]})" if places and not isinstance(error, _ANYWHERE) else line
