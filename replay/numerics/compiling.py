"""How far the compiling of kernels is, as users are told it; apart from `jit`, since telling it needs no numba."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Compiling:
    """How far it is.

    Attributes:
        done, total: kernels compiled, and all that are wanted.
        seconds: since the first of them was begun.
        ended: nothing is left to compile for now.
        kept: the next run finds them compiled.
    """

    done: int
    total: int
    seconds: float
    ended: bool = False
    kept: bool = True

    def __str__(self) -> str:
        if self.ended:
            kept = "; they are kept" if self.kept else ""
            return f"compiled {self.done} kernel{'s' * (self.done != 1)} in {self.seconds:.1f} s{kept}"
        return f"compiling kernels: {self.done} of {self.total}, {self.seconds:.0f} s"
