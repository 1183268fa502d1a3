"""A made-up recording and one in which a little of everything has changed."""

import dataclasses
from pathlib import Path

import numpy as np

from replay.comparison.runs import Case, RecordingPair, RunDifference, diff_pair
from replay.recording.provenance import sha256
from tests.comparison import made_up

BASELINE = made_up.recording()


def change(recording):
    recording.collision.level[40:42, 0] = 1
    recording.distance.distance[20, 0] = np.nan
    recording.distance.distance[20:40, 1] += 1e-3
    recording.joint_positions[3, 0] = np.nextafter(recording.joint_positions[3, 0], 9.0)
    recording.link_quaternions[5:9, 0, 0] += 1e-9
    recording.collision.evaluated[20:22, 0] = False
    recording.collision.clearance[20:22, 0] = np.nan


BEAM = b"hollow beam"
CANDIDATE = made_up.with_provenance(
    dataclasses.replace(made_up.altered(BASELINE, change), files={**BASELINE.files, "meshes/beam.stl": BEAM}),
    libraries={**BASELINE.provenance.libraries, "numpy": "9.9"},
    files={**BASELINE.provenance.files, "meshes/beam.stl": sha256(BEAM)},
)


def compared(name="made_up", rules=None):
    pair = RecordingPair(BASELINE, CANDIDATE)
    case = Case(name, Path("a.mcap"), Path("b.mcap"), diff_pair(pair, rules=rules))
    return RunDifference("a.mcap", "b.mcap", (case,)), pair
