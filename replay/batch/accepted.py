"""When a baseline was accepted last, as its log says."""

from __future__ import annotations

from pathlib import Path

from replay.batch.baseline import LOG
from replay.json_text import read_json

_TAIL = 1 << 20
"""Bytes at the end of the log that are looked at; a line of 10 000 scenarios has less."""


def last_accepted(baseline: Path) -> str:
    """Return the time of the last acceptance, in ISO 8601; "" when there is no log, or its end is none."""
    try:
        with (baseline / LOG).open("rb") as stream:
            stream.seek(max(stream.seek(0, 2) - _TAIL, 0))
            lines = stream.read().splitlines()
        time = read_json(lines[-1], surrogates=True)["time"] if lines else ""
    except (OSError, ValueError, KeyError, TypeError):
        return ""
    return time if isinstance(time, str) else ""
