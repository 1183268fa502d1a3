"""Progress of benchmarks on stderr: a line that moves on a terminal, a line for each benchmark elsewhere."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TextIO

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from replay.bench import measure
from replay.errors import printable
from replay.numerics.jit import progress as compiling

SECONDS = {
    "collision": 60.0,
    "between": 60.0,
    "distance": 60.0,
    "capacitive": 60.0,
    "pipeline": 60.0,
    "savings": 60.0,
    "scaling": 60.0,
    "stability": 60.0,
    "recording": 60.0,
    "diff": 60.0,
    "start": 60.0,
}
"""What benchmarks take on one machine [s]; only their ratios matter."""


class BenchProgress:
    """Says which benchmark runs, on what, and how long all will take; use as a context.

    Args:
        names: of the benchmarks, in the order in which they run.
        stream: where it is said.
    """

    def __init__(self, names: Sequence[str], stream: TextIO) -> None:
        self._names = names
        console = Console(file=stream, highlight=False)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._bars = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)
        self._task = self._bars.add_task("bench", total=len(names))
        self._done = 0
        self._begin = time.monotonic()

    def __enter__(self) -> BenchProgress:
        self._of_kernels = compiling.counted().tell
        measure.tell_by(self.follow)
        compiling.tell_by(lambda state: self.follow(str(state)))
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()
        compiling.tell_by(self._of_kernels)
        measure.tell_by(str)

    def follow(self, case: str) -> None:
        """Show what is measured."""
        name = self._names[self._done]
        self._bars.update(self._task, description=escape(printable(f"bench {name}: {case}{self.left()}")))

    def done(self, seconds: float) -> None:
        """Count a benchmark, and say what it took."""
        name = self._names[self._done]
        self._done += 1
        self._bars.update(self._task, completed=self._done)
        self._bars.console.print(f"replay: bench {name}: {seconds:.0f} s{self.left()}", markup=False, soft_wrap=True)

    def left(self) -> str:
        """Return about how long the others will take, by the pace so far; "" before the first is done."""
        done = sum(SECONDS[name] for name in self._names[: self._done])
        rest = sum(SECONDS[name] for name in self._names[self._done :])
        if not done or not rest:
            return ""
        seconds = rest / done * (time.monotonic() - self._begin)
        return f", about {seconds / 60.0:.0f} min left" if seconds >= 60.0 else ", less than a minute left"
