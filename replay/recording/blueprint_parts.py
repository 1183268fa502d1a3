"""The blueprint of one recording, most of which is the same in every recording and made once.

Describing a blueprint to the library takes 3 ms; of its 25 parts only the eye and the axes of the charts differ.
"""

from __future__ import annotations

import functools
from collections.abc import Collection
from typing import Any

import numpy as np

from replay.recording import blueprint
from replay.recording.rerun_columns import Chunks, Column, constants
from replay.recording.scene_view import Floats

_EYE, _AXIS = "EyeControls3D", "TimeAxis"  # what the library calls the parts that differ

Parts = dict[str, tuple[Column, ...]]
"""What is logged, by the path in the blueprint."""


class RecordingBlueprint:
    """The arrangement that `blueprint.recording` describes, as rerun's `send_blueprint` takes it.

    Args:
        charts: which of DISTANCE, CAPACITIVE, CLEARANCE and JOINTS have curves.
        corners: (n, 3) points [m] in world coordinates that the first picture should show.
        end: time [ns] at which the charts end.
    """

    def __init__(self, charts: Collection[str], corners: Floats, end: int) -> None:
        eye = blueprint.eye_of(corners)
        own = {_EYE: constants(eye), _AXIS: constants(blueprint.axis_until(end))}
        first = {"blueprint": _zero()}
        self._chunks = Chunks()
        for path, columns in _parts(frozenset(charts)).items():
            self._chunks.add(path, first, own.get(path.rpartition("/")[2], columns))

    def to_blueprint(self) -> RecordingBlueprint:
        """Return this."""
        return self

    def _log_to_stream(self, stream: Any) -> None:
        self._chunks.send(stream)


class _Recorder:
    """Takes what a blueprint logs."""

    def __init__(self) -> None:
        self.parts: Parts = {}

    def log(self, path: str, archetype: Any) -> None:
        self.parts[path] = constants(archetype)


@functools.cache
def _parts(charts: frozenset[str]) -> Parts:
    recorder = _Recorder()
    anywhere = blueprint.eye_of(np.eye(3))
    blueprint.recording(charts, anywhere, blueprint.axis_until(1))._log_to_stream(recorder)
    return recorder.parts


@functools.cache
def _zero() -> Any:
    import pyarrow as pa

    return pa.array([0], pa.int64())
