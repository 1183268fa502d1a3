"""Pictures of a night: the worst moment of the first scenarios that differ, both runs beside each other."""

from __future__ import annotations

import time
from collections.abc import Iterable
from pathlib import Path

from replay.batch.case_folder import is_there
from replay.batch.judged import OVERLAY, PICTURE, Judged
from replay.batch.watch import Watch
from replay.comparison.both_sides import write_both_sides
from replay.errors import ReplayError
from replay.recording.own_folder import own_folder
from replay.recording.picture import picture

_SIZE = (1200, 600)
_SECONDS = 180.0
"""All pictures of a night may take so long; one takes 5 to 30 s."""


def take_pictures(judged: Iterable[Judged], directory: Path, most: int, watch: Watch) -> None:
    """Render the worst moment of scenarios that have a recording of both runs, the worst first.

    Where nothing can be rendered, that is told once, and there are no pictures.

    Args:
        judged: scenarios, the worst first.
        directory: the run folder.
        most: number of pictures.
        watch: is told.
    """
    began = time.monotonic()
    for item in judged:
        overlay = directory / item.name / OVERLAY.format(name=item.name)
        at = item.finding.effects[0].at if item.finding is not None and item.finding.effects else None
        if most <= 0 or at is None or not is_there(overlay):
            continue
        if time.monotonic() - began > _SECONDS:
            watch.tell(f"no more pictures: they have taken {_SECONDS:.0f} s")
            return
        watch.tell(f"rendering {item.name} at {at:.6g} s (--pictures 0 leaves it out)")
        try:
            with own_folder() as folder:
                both = folder / "both.rrd"
                write_both_sides(overlay, both)
                picture(both, overlay.with_name(PICTURE), at=at, size=_SIZE)
        except ReplayError as error:
            watch.tell(f"no pictures: {error}")
            return
        most -= 1
