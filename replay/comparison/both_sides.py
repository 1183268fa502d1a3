"""The recording that shows two runs in one scene, with their scenes beside each other instead."""

from __future__ import annotations

from pathlib import Path

from replay.comparison.overlay import BASELINE, CANDIDATE
from replay.recording import blueprint
from replay.recording.rearranged import copied
from replay.recording.rerun_file import RerunFile


def write_both_sides(overlay: Path, target: Path) -> None:
    """Write a recording of two runs, which shows both in one scene, with a scene of each run beside the other's.

    Args:
        overlay: what `write_overlay` wrote.
        target: the one to write.

    Raises:
        ViewerError: the overlay cannot be read.
        WriteError: the other cannot be written.
    """
    import rerun.blueprint as rrb

    result = RerunFile(target, overwrite=True)
    try:
        found = copied(overlay, result)
        eye = blueprint.eye_at(*found.eyes[0])
        views = [blueprint.scene_view(eye, f"/{side}", side) for side in (BASELINE, CANDIDATE)]
        result.arrange(blueprint.whole(rrb.Horizontal(*views)))
        result.commit()
    except BaseException:
        result.discard()
        raise
