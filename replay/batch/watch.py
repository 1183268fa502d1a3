"""Who follows a run: what a run tells while it goes on."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from typing import Protocol

from replay.batch.case import CaseResult
from replay.numerics.compiling import Compiling


class Watch(Protocol):
    """Who follows a run; each method may raise KeyboardInterrupt, which ends it."""

    def plan(self, costs: dict[str, float]) -> None:
        """Take what is going to run: names with expected costs."""

    def prepare(self, state: Compiling) -> None:
        """Take how far kernels are compiled."""

    def follow(self, name: str, done: int, total: int) -> None:
        """Take how many frames of a scenario are done; (name, 0, 0) when it begins."""

    def done(self, result: CaseResult) -> None:
        """Take what became of a scenario."""

    def compare(self, name: str) -> None:
        """Take which scenario is compared with its baseline now."""

    def tell(self, text: str) -> None:
        """Take a remark."""

    def check(self) -> None:
        """Do nothing, but be called all the time, so that a request to end the run is noticed soon."""

    def undisturbed(self) -> AbstractContextManager[None]:
        """Return a context in which a request to end the run waits for `check`."""
        ...


class Unwatched:
    """Nobody follows."""

    def plan(self, costs: dict[str, float]) -> None:
        """Do nothing."""

    def prepare(self, state: Compiling) -> None:
        """Do nothing."""

    def follow(self, name: str, done: int, total: int) -> None:
        """Do nothing."""

    def done(self, result: CaseResult) -> None:
        """Do nothing."""

    def compare(self, name: str) -> None:
        """Do nothing."""

    def tell(self, text: str) -> None:
        """Do nothing."""

    def check(self) -> None:
        """Do nothing."""

    def undisturbed(self) -> AbstractContextManager[None]:
        """Return a context that does nothing."""
        return nullcontext()
