"""`replay diff` of two long recordings, equal and all different: time and peak memory of the whole command."""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from replay.bench.goals import Goal
from replay.bench.report import Grid, Report
from replay.recording.record import record
from replay.scenario.load import load_sources

FRAMES = 60_000
"""Of the goal, with 30 topics; it is not measured on fewer."""
DISTANCE, CAPACITIVE = 18, 9
"""Sensors: a topic each, beside joint states, link poses and collisions."""
TOPICS = 3 + DISTANCE + CAPACITIVE
LONGEST = 300.0
"""[s] A command that takes longer is given up."""

_COMMAND = """
import sys
from pathlib import Path
from replay.cli.main import run
code = run(["diff", *sys.argv[1:], "--format", "json"])
status = Path("/proc/self/status")
peak = next((line.split()[1] for line in status.read_text().splitlines() if line.startswith("VmHWM")), "nan")
print(peak if status.exists() else "nan", file=sys.stderr)
sys.exit(code)
"""
TABLE = "replay diff, process start included"


def run(*, quick: bool = False, frames: int | None = None) -> Report:
    """Run the benchmark.

    Args:
        quick: a tenth of the frames, for which nothing is promised.
        frames: so many instead.
    """
    report = Report("diff")
    count = frames or (FRAMES // 10 if quick else FRAMES)
    lines = []
    with tempfile.TemporaryDirectory() as folder:
        baseline, other = (_recorded(Path(folder) / name, count, shift) for name, shift in (("a", 0.0), ("c", 1e-3)))
        again = Path(shutil.copy(baseline, Path(folder) / "again.mcap"))
        results = {"equal": _compare(baseline, again), "different": _compare(baseline, other)}
    for what, (seconds, peak, right) in results.items():
        lines.append(
            {
                "recordings": what,
                "frames": count,
                "topics": TOPICS,
                "seconds": f"{seconds:.2f}",
                "peak memory [MiB]": f"{peak:.0f}",
                "verdict": "right" if right else "WRONG",
            }
        )
    report.grids[TABLE] = Grid(lines)
    known = count == FRAMES
    for what, (seconds, _, right) in results.items():
        report.goals.append(Goal(f"diff.{what}", seconds if known else math.nan, not right))
    peak = max(peak for _, peak, _ in results.values())
    report.goals.append(
        Goal("diff.memory", peak if known else math.nan, not all(right for *_, right in results.values()))
    )
    return report


def _recorded(folder: Path, frames: int, shift: float) -> Path:
    """Return a recording of an arm with all sensors before a wall; `shift` moves wall [m] and swing [rad]."""
    rate = 1000
    sensors = "".join(
        f"    d{k:02}: {{link: arm, pose: {{xyz: [0, {0.02 * k}, {0.1 + 0.05 * k}], rpy: [0, 90 deg, 0]}}, "
        "aperture: 30 deg, range: 5}\n"
        for k in range(DISTANCE)
    )
    plates = "".join(
        f"    c{k}: {{link: arm, plates: {{p: {{pose: {{xyz: [0.1, 0, {0.1 * k}], rpy: [0, 90 deg, 0]}}, "
        "size: [0.1, 0.1]}}, coupling: 10 pF}\n"
        for k in range(CAPACITIVE)
    )
    turns = ", ".join(f"{{time: {t}, position: {angle + shift}}}" for t, angle in _swing((frames - 1) / rate))
    text = _SCENE.format(rate=rate, seconds=(frames - 1) / rate, wall=2.0 + shift, turns=turns, d=sensors, c=plates)
    scenario = load_sources("long.yaml", {"long.yaml": text.encode()})
    assert scenario.frames == frames
    return record(scenario, folder, rrd=False).mcap


def _swing(seconds: float) -> list[tuple[float, float]]:
    """Return key points [(s, rad)]; neighbours differ, so that no frame is as the one before."""
    count = max(1, round(seconds))
    return [(seconds * k / count, 0.2 + 0.1 * (k % 7)) for k in range(count + 1)]


_SCENE = """
version: 1
name: long
rate: {rate} Hz
duration: {seconds} s
links:
  room: {{shapes: {{wall: {{type: cuboid, size: [0.1, 4, 4], pose: {{xyz: [{wall}, 0, 0]}}}}}}}}
  stand: {{parent: room}}
  arm:
    parent: stand
    joint: {{name: swing, type: revolute, axis: [0, 1, 0], lower: -1.5, upper: 1.5, velocity: 9, acceleration: 99}}
    shapes: {{rod: {{type: cuboid, size: [0.1, 0.1, 1.9], pose: {{xyz: [0, 0, 0.9]}}}}}}
motion: {{points: {{swing: [{turns}]}}}}
model: {{collision: {{clearance: always}}, capacitive: {{method: midpoint, splits: 0}}}}  # quickly made
sensors:
  distance:
{d}  capacitive:
{c}"""


def _compare(a: Path, b: Path) -> tuple[float, float, bool]:
    """Return seconds, peak memory [MiB] and whether the verdict is right: no topic differs, or all do.

    The memory is NaN where the system does not say.
    """
    begin = time.perf_counter()
    command = [sys.executable, "-c", _COMMAND, str(a), str(b)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=LONGEST, check=False)
    seconds = time.perf_counter() - begin
    right = False
    if done.returncode in (0, 1):
        found = json.loads(done.stdout)["cases"][0]
        topics = {line["signal"]["topic"] for line in found["signals"]}
        same = a.read_bytes() == b.read_bytes()
        right = found["verdict"] == "same" if same else len(topics) == TOPICS
    said = done.stderr.split()
    return seconds, float(said[-1]) / 1024.0 if said else math.nan, right
