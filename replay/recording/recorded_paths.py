"""Where the recordings of a run are."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class RecordedPaths:
    """Where the recordings of a run are; `rrd` is None when none was asked for."""

    mcap: Path
    rrd: Path | None
