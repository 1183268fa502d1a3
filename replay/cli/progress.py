"""Progress of a run on stderr: a live bar on a terminal, nothing where nobody watches."""

from __future__ import annotations

from collections.abc import Callable

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from replay.cli import interruption

Follow = Callable[[int, int], None]


class RunProgress:
    """One bar for the scenario that runs, named after it; use as a context."""

    def __init__(self) -> None:
        columns = (
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("frames"),
            TimeElapsedColumn(),
            TimeRemainingColumn(),
        )
        console = Console(stderr=True)
        self._bars = Progress(*columns, console=console, transient=True, disable=not console.is_terminal)

    def __enter__(self) -> RunProgress:
        self._bars.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bars.stop()

    def follow(self, name: str, frames: int) -> Follow:
        """Return what advances a new bar; called with frames computed and all frames."""
        interruption.check()
        bar = self._bars.add_task(name, total=frames)

        def advance(done: int, total: int) -> None:
            interruption.check()
            self._bars.update(bar, completed=done, total=total, visible=done < total)

        return advance
