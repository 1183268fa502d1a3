"""Progress of benchmarks on stderr: a line that moves on a terminal, a line for each benchmark elsewhere."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from typing import TextIO

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from replay.bench import measure
from replay.errors import printable
from replay.numerics.jit import progress as compiling


class BenchProgress:
    """Says which benchmark runs, on what, and how long all will take; use as a context.

    Args:
        names: of the benchmarks, in the order in which they run.
        seconds: what they took in an earlier run, as far as that is known: only the ratios matter, and all are taken to
            be alike where one is missing.
        stream: where it is said.
    """

    def __init__(self, names: Sequence[str], seconds: Mapping[str, float], stream: TextIO) -> None:
        self._names = names
        known = all(seconds.get(name, 0.0) > 0.0 for name in names)
        self._shares = [seconds[name] if known else 1.0 for name in names]
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
        measure.tell_by(measure.silent)

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
        done, rest = sum(self._shares[: self._done]), sum(self._shares[self._done :])
        if not done or not rest:
            return ""
        seconds = rest / done * (time.monotonic() - self._begin)
        return f", about {seconds / 60.0:.0f} min left" if seconds >= 60.0 else ", less than a minute left"
