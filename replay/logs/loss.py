"""What is missing from a file that was cut or damaged and read nevertheless."""

from __future__ import annotations

from dataclasses import dataclass

from replay.errors import count


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
        saved = "all" if kept == frames > 1 else f"{kept or 'none'} of"
        return f"{self.reason}; {saved} {count(frames, 'frame')} {'was' if kept == 1 else 'were'} salvaged"
