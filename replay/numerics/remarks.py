"""What is said once a process, by whatever has to say it: on stderr, or by others where nobody reads that."""

from __future__ import annotations

import sys
from collections.abc import Callable

_said: set[str] = set()


def _print(text: str) -> None:
    print(f"replay: {text}", file=sys.stderr, flush=True)


_tell: Callable[[str], None] = _print


def tell_by(tell: Callable[[str], None]) -> None:
    """Let others say it, as in a process whose stderr nobody reads."""
    global _tell  # noqa: PLW0603
    _tell = tell


def remark(text: str) -> None:
    """Say something, once a process."""
    if text not in _said:
        _said.add(text)
        _tell(text)
