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
from replay.recording.rerun_columns import Column, constants
from replay.recording.rerun_inside import ChunkBlueprint, available, made, parts_of

_EYE, _AXIS = "EyeControls3D", "TimeAxis"  # what the library calls the parts that differ


def recording_blueprint(charts: Collection[str], corners: Floats, end: int) -> Any:
    """Return the arrangement that `blueprint.recording` describes, as `rerun_inside.send_blueprint` takes it.

    Args:
        charts: which of `blueprint.CHARTS` have curves.
        corners: (n, 3) points [m] in world coordinates that the first picture should show.
        end: time [ns] at which the charts end.
    """
    eye = blueprint.eye_of(corners)
    if not available():
        return blueprint.recording(charts, eye, blueprint.axis_until(end))
    own = {_EYE: constants(eye), _AXIS: _axis(end)}
    return ChunkBlueprint(
        [
            made(path, _first(), own[part]) if (part := path.rpartition("/")[2]) in own else chunk
            for path, chunk in _chunks(frozenset(charts)).items()
        ]
    )


@functools.cache
def _chunks(charts: frozenset[str]) -> dict[str, Any]:
    described = blueprint.recording(charts, blueprint.eye_of(np.eye(3)), blueprint.axis_until(1))
    return {path: made(path, _first(), constants(archetype)) for path, archetype in parts_of(described)}


@functools.lru_cache(maxsize=16)  # runs of a night are often equally long
def _axis(end: int) -> tuple[Column, ...]:
    return constants(blueprint.axis_until(end))


@functools.cache
def _first() -> dict[str, Any]:
    """Return the time of what a blueprint begins with."""
    import pyarrow as pa

    return {"blueprint": pa.array([0], pa.int64())}
