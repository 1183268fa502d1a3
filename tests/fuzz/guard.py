"""What holds while damaged input is read: no foreign file or address is opened, nothing hangs, memory stays bounded."""

from __future__ import annotations

import contextlib
import os
import re
import resource
import signal
import site
import sys
import sysconfig
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

import replay

LONGEST = 20.0
"""Longest processor time [s] of one input: what others do on the machine does not count."""
STILL = 300.0
"""Longest time [s] of one input that waits for something."""
MOST = 2 << 30
"""Most resident memory [bytes] of the process."""
_OWN = tuple(
    os.path.realpath(place) + "/"
    for place in (
        tempfile.gettempdir(),
        *("/dev/null", "/proc/self", "/proc/meminfo", "/sys", "/usr/share", "/etc/mime.types"),
        *(Path(replay.__file__).parents[1], *site.getsitepackages()),
        *sysconfig.get_paths().values(),
        *(sys.prefix, sys.base_prefix),
    )
)
"""Where files may be opened: what a test writes, and what Python and its libraries load."""
_PROCESSES = re.compile(r"subprocess\.|os\.(system|exec|spawn|posix_spawn|fork|startfile)|pty\.|socket\.(?!__new__)")

_foreign: list[str] = []
_watching: list[bool] = []


def _hook(event: str, arguments: tuple[object, ...]) -> None:
    if not _watching:
        return
    if event == "open" and isinstance(arguments[0], str | bytes | os.PathLike):
        path = os.path.realpath(os.fsdecode(arguments[0]))
        if not f"{path}/".startswith(_OWN):
            _foreign.append(f"open {path}")
    elif _PROCESSES.match(event):
        _foreign.append(event)


class Hang(BaseException):
    """One input took too long; no handler of errors may swallow it."""


def _late(signum: int, frame: FrameType | None) -> None:
    raise Hang(f"longer than {LONGEST:g} s of work" if signum == signal.SIGPROF else f"longer than {STILL:g} s")


def install() -> None:
    """Begin to listen; hooks cannot be taken away again, so that this does nothing between watches."""
    if not getattr(install, "done", False):
        sys.addaudithook(_hook)
        install.done = True


@contextlib.contextmanager
def watched() -> Iterator[None]:
    """Raise AssertionError for what was opened inside, Hang for what takes too long, MemoryError for what grows."""
    before = [signal.signal(number, _late) for number in (signal.SIGPROF, signal.SIGALRM)]
    signal.setitimer(signal.ITIMER_PROF, LONGEST)
    signal.setitimer(signal.ITIMER_REAL, STILL)
    begin, peak = time.process_time(), _peak()
    _foreign.clear()
    _watching.append(True)
    try:
        yield
    finally:
        _watching.clear()
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in zip((signal.SIGPROF, signal.SIGALRM), before, strict=True):
            signal.signal(number, handler)
    assert not _foreign, f"opened: {_foreign}"
    assert time.process_time() - begin < LONGEST, "took too long in native code"
    assert _peak() < MOST or _peak() == peak, f"memory rose to {_peak() / 2**20:.0f} MiB"


def _peak() -> int:
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
