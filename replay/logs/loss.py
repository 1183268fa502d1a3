"""What is missing from a file that was cut or damaged and read nevertheless."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Loss:
    """What a salvaged file has lost.

    Attributes:
        reason: what is wrong, and where.
        bytes: bytes at the end of the file that could not be used.
    """

    reason: str
    bytes: int

    def text(self, kept: int, frames: int) -> str:
        """Return it in words for a recording of which some frames were kept."""
        saved = f"all {frames} frames were" if kept == frames else f"{kept or 'none'} of {frames} frames were"
        return f"{self.reason}; {saved} salvaged"
