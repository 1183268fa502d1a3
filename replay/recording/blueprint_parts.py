"""The blueprint of one recording, most of which is the same in every recording and made once.

Describing a blueprint to the library takes 3 ms; of its 25 parts only the eye and the axes of the charts differ.
"""

from __future__ import annotations

import functools
from collections.abc import Collection
from typing import Any

import numpy as np

from replay.numerics.arrays import Floats
from replay.recording import blueprint
from replay.recording.rerun_columns import Chunks, Column, constants, made

_EYE, _AXIS = "EyeControls3D", "TimeAxis"  # what the library calls the parts that differ


class RecordingBlueprint:
    """The arrangement that `blueprint.recording` describes, as rerun's `send_blueprint` takes it.

    Args:
        charts: which of `blueprint.CHARTS` have curves.
        corners: (n, 3) points [m] in world coordinates that the first picture should show.
        end: time [ns] at which the charts end.
    """

    def __init__(self, charts: Collection[str], corners: Floats, end: int) -> None:
        own = {_EYE: constants(blueprint.eye_of(corners)), _AXIS: _axis(end)}
        self._chunks = Chunks()
        for path, chunk in _chunks(frozenset(charts)).items():
            columns = own.get(path.rpartition("/")[2])
            self._chunks.take(chunk if columns is None else made(path, _first(), columns))

    def to_blueprint(self) -> RecordingBlueprint:
        """Return this."""
        return self

    def _log_to_stream(self, stream: Any) -> None:
        self._chunks.send(stream)


class _Recorder:
    """Takes what a blueprint logs: its chunks by the path in the blueprint."""

    def __init__(self) -> None:
        self.chunks: dict[str, Any] = {}

    def log(self, path: str, archetype: Any) -> None:
        self.chunks[path] = made(path, _first(), constants(archetype))


@functools.cache
def _chunks(charts: frozenset[str]) -> dict[str, Any]:
    recorder = _Recorder()
    anywhere = blueprint.eye_of(np.eye(3))
    blueprint.recording(charts, anywhere, blueprint.axis_until(1))._log_to_stream(recorder)
    return recorder.chunks


@functools.lru_cache(maxsize=16)  # runs of a night are often equally long
def _axis(end: int) -> tuple[Column, ...]:
    return constants(blueprint.axis_until(end))


@functools.cache
def _first() -> dict[str, Any]:
    """Return the time of what a blueprint begins with."""
    import pyarrow as pa

    return {"blueprint": pa.array([0], pa.int64())}
