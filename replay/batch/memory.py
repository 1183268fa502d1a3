"""The most memory that this process has had resident, since a moment where the system can tell that."""

from __future__ import annotations

import contextlib
import sys
from dataclasses import dataclass
from pathlib import Path

_NOISE = 4 << 20  # bytes; systems count approximately
_STATUS, _REFERENCES = Path("/proc/self/status"), Path("/proc/self/clear_refs")


@dataclass(frozen=True)
class Peak:
    """The most resident memory of a task.

    Attributes:
        bytes: of it.
        sure: whether it is the task's. Otherwise it is the most since the process began, and the task had no more.
    """

    bytes: int
    sure: bool


class PeakMeter:
    """Measures from its making on: a task may be over before anyone has looked at it from outside."""

    def __init__(self) -> None:
        self._begins_anew = False
        with contextlib.suppress(OSError):
            _REFERENCES.write_text("5")  # as Linux does then
            self._begins_anew = _since_reset() is not None
        self._before = _since_begin()

    def read(self) -> Peak:
        """Return the most since then."""
        if self._begins_anew:
            return Peak(_since_reset() or 0, sure=True)
        highest = _since_begin()
        return Peak(highest, sure=highest > self._before + _NOISE)


def _since_reset() -> int | None:
    with contextlib.suppress(OSError, ValueError):
        lines = _STATUS.read_text().splitlines()
        return next((1024 * int(line.split()[1]) for line in lines if line.startswith("VmHWM:")), None)
    return None


def _since_begin() -> int:
    if sys.platform == "win32":
        import psutil

        return int(psutil.Process().memory_info().peak_wset)
    import resource

    highest = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return highest if sys.platform == "darwin" else highest * 1024
