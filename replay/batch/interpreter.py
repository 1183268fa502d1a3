"""The interpreter of a worker process: begun when there is work for it, or ahead, while scenarios are still read."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Sequence

from replay.batch.import_path import import_path

_BEGIN = "import sys; ahead, *sys.path[:] = sys.argv[1:]; from replay.batch.worker import main; main(ahead.split())"
_OF_ALL = ("replay.batch.case", "replay.scenario.scene", "replay.recording.record", "replay.numerics.jit.compiler")
_OF_DRAWINGS = ("replay.recording.rerun_log", "rerun.blueprint")


def begin(module: str, inherit: Sequence[int], ahead: Sequence[str] = ()) -> subprocess.Popen[bytes]:
    """Begin a fresh interpreter that waits for a `Start`.

    Args:
        module: that holds the work.
        inherit: descriptors that it keeps open as long as it lives.
        ahead: modules that it loads before it listens.
    """
    return subprocess.Popen(
        # -P: not even `_BEGIN` imports from the current folder; -u: what a task printed is in its log if it dies
        [sys.executable, "-P", "-u", "-c", _BEGIN, " ".join(ahead), *import_path(module)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        pass_fds=inherit,
        start_new_session=True,  # Ctrl-C is for the pool, which then ends its workers itself
    )


class Ahead:
    """One interpreter that loads what every scenario needs while the scenarios are read; use as a context.

    That is half of the time of a run of one short scenario. Nothing of it reaches a result.

    Args:
        inherit: as of `begin`.
        rrd: whether rerun recordings will be made.
    """

    def __init__(self, inherit: Sequence[int], *, rrd: bool) -> None:
        self._begun: subprocess.Popen[bytes] | None = None
        self._begun = begin(__name__, inherit, (*_OF_ALL, *(_OF_DRAWINGS if rrd else ())))

    def __enter__(self) -> Ahead:
        return self

    def __exit__(self, *_: object) -> None:
        begun = self.take()
        if begun is not None:
            begun.kill()
            with begun:  # waits, and closes its pipes
                pass

    def take(self) -> subprocess.Popen[bytes] | None:
        """Return the interpreter to the first who asks, whose it is from then on."""
        begun, self._begun = self._begun, None
        return begun
