"""A rerun recording once more with another arrangement: looked at from another place, or its scene alone."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from replay.errors import ViewerError
from replay.numerics.arrays import Floats
from replay.recording import blueprint
from replay.recording.rerun_file import RerunFile
from replay.recording.side_by_side import Contents, readable

Camera = tuple[tuple[float, float, float], tuple[float, float, float] | None]
"""From where, and to where; None for what the recording itself looks at [m]."""


def write_rearranged(file: Path, target: Path, *, camera: Camera | None, only_scene: bool) -> Any:
    """Write a recording with another arrangement; return the id of its scene's view where that is alone.

    Args:
        file: an `.rrd` file of one recording.
        target: the one to write.
        camera: from where its scene is looked at; as it is when None.
        only_scene: nothing but the scene is shown.

    Raises:
        ViewerError: the file cannot be read, or is no recording of replay.
        WriteError: the other cannot be written.
    """
    result = RerunFile(target, overwrite=True)
    try:
        found = copied(file, result)
        eye, end = _eye(camera, *found.eyes[0]), blueprint.axis_until(found.end)
        view = blueprint.scene_view(eye)
        result.arrange(blueprint.whole(view) if only_scene else blueprint.recording(found.charts, eye, end))
        result.commit()
        return view.id if only_scene else None
    except BaseException:
        result.discard()
        raise


def copied(file: Path, result: RerunFile) -> Contents:
    """Copy what a file holds, but for its arrangement; return what that is."""
    stream = result.open("replay: rearranged")
    stream.send_recording_name(file.stem)
    found = Contents()
    with readable(file) as reader:
        found.look_from(reader)
        for chunk in reader.stream():
            if not str(chunk.entity_path).startswith("/__"):
                stream.send_chunks(chunk)
                found.take(chunk)
    if not found.eyes:
        raise ViewerError(f"{file}: says nothing of how its scene is looked at; is it a recording of replay?")
    return found


def _eye(camera: Camera | None, position: Floats, target: Floats) -> Any:
    if camera is None:
        return blueprint.eye_at(position, target)
    at, to = camera
    return blueprint.eye_at(np.array(at), target if to is None else np.array(to))
