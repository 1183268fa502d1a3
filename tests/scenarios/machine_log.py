"""The synthetic log of `scenarios/carm_parking_measured.yaml`: python -m tests.scenarios.machine_log writes it again.

"The machine" is the thesis's model of the distance sensor, with a clock, a sampler and electronics of its own.
"""

from __future__ import annotations

import math
import re
import tempfile
from pathlib import Path

import numpy as np

import replay
from replay.scenario.source import Folder

SCENARIO = Path(replay.__file__).parents[1] / "scenarios" / "carm_parking_measured.yaml"
LOG = SCENARIO.parent / "logs" / "parking_run.csv"
OFFSET = -0.137
"""[s] What is added to the log's times to get those of the scenario."""
MISSED = (2.40, 2.46)
"""[s] When one sensor misses the patient."""
SENSORS = ("corner_foot_left", "corner_foot_right")


def machine(folder: Path) -> replay.Recording:
    """Return a recording of the same motion by the thesis's model; the scenario is read without its log."""
    library = Folder(SCENARIO)
    text = SCENARIO.read_text(encoding="utf-8").partition("\nmeasured:\n")[0]
    names = [SCENARIO.name, *re.findall(r"parts/\w+\.yaml", text)]
    known = {name: library.read(name) for name in names} | {SCENARIO.name: text.encode()}
    scenario = replay.load(_written(folder, known))
    return replay.read(replay.record(scenario, folder / "run", model="thesis2015", rrd=False).mcap)


def _written(folder: Path, files: dict[str, bytes]) -> Path:
    for name, data in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_bytes(data)
    return folder / SCENARIO.name


def log_of(recording: replay.Recording) -> str:
    """Return the log: 50 Hz with jitter of 2 ms, noise of 1 mm and 0.02 deg, whole millimetres, 0 for nothing."""
    rng = np.random.default_rng(2015)
    frames = recording.time / 1e9
    time = np.arange(0.0, 6.0, 0.02)
    time = time + rng.uniform(-2e-3, 2e-3, len(time))
    time = time[(time >= 0.0) & (time <= frames[-1])]
    before = np.clip(np.searchsorted(frames, time) - 1, 0, len(frames) - 2)
    weight = (time - frames[before]) / (frames[before + 1] - frames[before])
    columns = [recording.distance.distance[:, recording.layout.distance_sensors.index(name)] for name in SENSORS]
    columns.append(np.degrees(recording.joint_positions[:, recording.layout.joints.index("rotation")]))
    left, right, angle = (c[before] + weight * (c[before + 1] - c[before]) for c in columns)
    noise = rng.normal(0.0, 1.0, (3, len(time)))
    left = np.where((time >= MISSED[0]) & (time < MISSED[1]), np.nan, left)
    lines = ["# synthetic: see scenarios/carm_parking_measured.yaml", "t_ms,foot_left_mm,foot_right_mm,c_arm [deg]"]
    for k, moment in enumerate(time.tolist()):
        there = [1000.0 * float(value[k]) + noise[row, k] for row, value in enumerate((left, right))]
        shown = ",".join("0" if math.isnan(value) else f"{value:.0f}" for value in there)
        lines.append(f"{(moment - OFFSET) * 1000:.2f},{shown},{angle[k] + 0.02 * noise[2, k]:.2f}")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as made:
        LOG.parent.mkdir(exist_ok=True)
        LOG.write_text(log_of(machine(Path(made))), encoding="utf-8")
