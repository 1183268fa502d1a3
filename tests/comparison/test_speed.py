"""Time and memory of a diff of two long recordings, in a process of its own."""

import dataclasses
import json
import subprocess
import sys

import numpy as np
import pytest

from tests.comparison import made_up

FRAMES = 60_000
LAYOUT = dataclasses.replace(
    made_up.LAYOUT,
    sensors={"distance": tuple(f"d{k:02}" for k in range(18)), "capacitive": tuple(f"c{k}" for k in range(9))},
)  # with /tf, /joint_states and /collision: 30 topics

MEASURE = """
import json, resource, sys, time
from replay.comparison.runs import diff
begin = time.perf_counter()
found = diff(*sys.argv[1:])
seconds = time.perf_counter() - begin
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(json.dumps([found.verdict.value, len(found.signals), found.compared, seconds, peak]))
"""


def disturb(columns):
    """Change every number of every frame, and move every event."""
    rng = np.random.default_rng(1)
    for field in dataclasses.fields(columns):
        values = getattr(columns, field.name)
        if values is None:
            continue
        if field.name in ("collision", "readings"):
            for group in values.values() if isinstance(values, dict) else (values,):
                disturb(group)
        elif field.name == "link_poses":
            values[..., :3, 3] += 1e-6
        elif field.name == "link_quaternions":
            values[:] = np.roll(values, 1, axis=0)
        elif isinstance(values, np.ndarray) and values.dtype == np.float64:
            values += 1e-6 * rng.normal(size=values.shape)
        elif isinstance(values, np.ndarray) and values.dtype != np.int64:
            values[:] = np.roll(values, 3, axis=0)


def alternate(columns, period):
    """Let one pair touch and let go, and each sensor see and lose, in nearly every frame."""
    frames = np.arange(FRAMES)
    columns.collision.level[:, 0] = np.where(frames % period, 2, 1)
    columns.distance.status[:] = (frames[:, None] // (period - 1) + np.arange(len(LAYOUT.distance_sensors))) % 2


def measure(*paths):
    done = subprocess.run([sys.executable, "-c", MEASURE, *map(str, paths)], capture_output=True, text=True, check=True)
    return json.loads(done.stdout)


@pytest.mark.soak
def test_long_recordings_are_compared_in_bounded_time_and_memory(tmp_path):
    recording = made_up.recording(FRAMES, LAYOUT)
    baseline = made_up.write(recording, tmp_path / "a.mcap")
    again = made_up.write(recording, tmp_path / "b.mcap")
    disturb(recording)
    other = made_up.write(recording, tmp_path / "c.mcap")
    verdict, signals, _, seconds, peak = measure(baseline, again)
    assert (verdict, signals) == ("same", 0)
    assert seconds <= 5.0
    assert peak <= 1024.0
    verdict, signals, compared, seconds, peak = measure(baseline, other)
    assert verdict == "different"
    assert signals >= 0.8 * compared
    assert seconds <= 30.0
    assert peak <= 1024.0
    busy = []
    for period in (2, 3):
        recording = made_up.recording(FRAMES, LAYOUT)
        alternate(recording, period)
        busy.append(made_up.write(recording, tmp_path / f"events_{period}.mcap"))
    verdict, signals, _, seconds, peak = measure(*busy)
    assert (verdict, signals) == ("different", 1 + len(LAYOUT.distance_sensors))
    assert seconds <= 30.0
    assert peak <= 1024.0
