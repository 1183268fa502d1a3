"""Progress of a run on stderr: live on a terminal; elsewhere, such as in a nightly's log, a line every few seconds."""

from __future__ import annotations

import dataclasses
import time
from contextlib import AbstractContextManager
from typing import TYPE_CHECKING

from rich.console import Console
from rich.markup import escape
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID, TextColumn, TimeElapsedColumn

from replay.cli import interruption, terminal
from replay.errors import printable
from replay.numerics.compiling import Compiling

if TYPE_CHECKING:
    from replay.batch.case import CaseResult

_SECONDS_BETWEEN_LINES = 5.0


class RunProgress:
    """Counts scenarios done, failed and running, with rate and time left; use as a context."""

    def __init__(self) -> None:
        self._console = Console(file=terminal.stderr_beneath(), stderr=True, highlight=False)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        self._bars = Progress(*columns, console=self._console, transient=True, disable=not self._console.is_terminal)
        self._all = self._bars.add_task("scenarios", total=None)
        self._running: dict[str, TaskID] = {}
        self._costs: dict[str, float] = {}
        self._done = self._failed = 0
        self._cost_done = 0.0
        self._begin: float | None = None
        self._kernels: TaskID | None = None
        self._compiling: Compiling | None = None
        self._next_line = 0.0

    def __enter__(self) -> RunProgress:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def plan(self, costs: dict[str, float]) -> None:
        """Begin to count."""
        interruption.check()
        self._costs = costs
        self._bars.update(self._all, total=len(costs))

    def prepare(self, state: Compiling) -> None:
        """Show how far kernels are compiled; several workers tell, and what is done does not become less."""
        interruption.check()
        known = self._compiling or state
        done, seconds = max(known.done, state.done), max(known.seconds, state.seconds)
        self._compiling = Compiling(done, known.total, seconds, kept=known.kept and state.kept)
        if self._console.is_terminal:
            if self._kernels is None:
                self._kernels = self._bars.add_task("compiling kernels", total=known.total)
            self._bars.update(self._kernels, completed=self._compiling.done)
        elif time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + _SECONDS_BETWEEN_LINES
            self.tell(str(self._compiling))

    def follow(self, name: str, done: int, total: int) -> None:
        """Show how far a running scenario is."""
        interruption.check()
        self._begin = self._begin or time.monotonic()  # kernels are ready now
        if self._compiling is not None:
            self.tell(str(dataclasses.replace(self._compiling, done=self._compiling.total, ended=True)))
            self._compiling = None
        if self._kernels is not None:
            self._bars.remove_task(self._kernels)
            self._kernels = None
        if name not in self._running:
            self._running[name] = self._bars.add_task(f"  {escape(printable(name))}", total=None)
        if total:
            self._bars.update(self._running[name], completed=done, total=total)
        self._show()

    def done(self, result: CaseResult) -> None:
        """Count a scenario."""
        interruption.check()
        self._done += 1
        self._failed += result.status.value != "passed"
        self._cost_done += self._costs.get(result.name, 0.0)
        if result.name in self._running:
            self._bars.remove_task(self._running.pop(result.name))
        self._bars.update(self._all, completed=self._done)
        if not self._console.is_terminal and len(self._costs) > 1:
            self._line(result)
        self._show()

    def _line(self, result: CaseResult) -> None:
        """Tell of a scenario that fails and of the last one; of others at most one line in five seconds."""
        failed, last = result.status.value != "passed", self._done == len(self._costs)
        if failed or last or time.monotonic() >= self._next_line:
            self._next_line = time.monotonic() + _SECONDS_BETWEEN_LINES
            state = f"{result.name}: {result.status.value} in {result.seconds:.1f} s"
            self.tell(f"[{self._done}/{len(self._costs)}] {state}{self._left()}")

    def compare(self, name: str) -> None:
        """Show which scenario is compared."""
        interruption.check()
        self._bars.update(self._all, description=f"comparing {escape(printable(name))}")

    def check(self) -> None:
        """Raise KeyboardInterrupt when the command was asked to stop."""
        interruption.check()

    def undisturbed(self) -> AbstractContextManager[None]:
        """Return a context in which a request to stop waits for `check`."""
        return interruption.undisturbed()

    def tell(self, text: str) -> None:
        """Say something above the bars."""
        self._console.print(f"replay: {printable(text)}", markup=False, soft_wrap=True)

    def _show(self) -> None:
        counts = f"scenarios: {self._failed} failed, {len(self._running)} running{self._left()}"
        self._bars.update(self._all, description=counts)

    def _left(self) -> str:
        """Return rate and time left, by the expected costs of what is done and what is not."""
        if self._begin is None or not self._done or self._done >= len(self._costs):
            return ""
        seconds = max(time.monotonic() - self._begin, 1e-9)
        rest = max(sum(self._costs.values()) - self._cost_done, 0.0) / max(self._cost_done, 1e-9) * seconds
        left = f"about {rest / 60.0:.0f} min left" if rest >= 60.0 else "less than a minute left"
        return f", {60.0 * self._done / seconds:.0f} a minute, {left}"
