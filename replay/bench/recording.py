"""What recording costs: the same run with and without, in turn, on every scene that is shipped.

How much of it is the rerun library's own is measured too: it is given the same chunks, of the recording and of the
viewer's arrangement, ready to be sent, and nothing is computed.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

from replay.bench.goals import Goal
from replay.bench.measure import Check, Contender, Row, absent, compete
from replay.bench.report import Grid, Report
from replay.bench.shipped import shipped
from replay.recording.reader import read
from replay.recording.record import record_blocks
from replay.scenario.model import Scenario
from replay.scenario.scene import Scene, build
from replay.simulation import Simulation

SCENES = (
    "carm_bodyguard",
    "carm_parking",
    "experiments/parallel_10cm",
    "doctor_walks_in",
    "carm_near",
    "carm_head_contact",
    "carm_clear",
    "experiments/inclined_plate",
    "experiments/parallel_20cm",
    "experiments/parallel_30cm",
    "experiments/pivot_10cm",
    "experiments/pivot_20cm",
)
"""All shipped scenes."""
GUARDED = SCENES[0]
"""The scene of the goal: its capacitive sensors are the most there is to compute."""
PLAIN, LOG, BOTH = "without recording", "MCAP", "MCAP and rerun"
LIBRARY = "the rerun library alone"
TABLE, COSTS = "a frame of a run", "what recording adds, opening and closing the files included"
_BOTH, _LIBRARY = f"{BOTH}, us a frame", f"{LIBRARY}, us a frame"
FEW = 100
"""Frames below which a run is all opening and closing; it has a goal of its own."""


def run(*, quick: bool = False, rounds: int | None = None, scenes: Sequence[str] = SCENES) -> Report:
    """Run the benchmark.

    Args:
        quick: fewer scenes; about ten seconds.
        rounds: times that every run is timed; 11 if None.
        scenes: names of shipped scenarios.
    """
    report = Report("recording")
    rows: list[Row] = []
    for name in scenes[:3] if quick else scenes:
        found = shipped(name)
        rows += [absent(name, PLAIN, found)] if isinstance(found, str) else on(name, found, rounds or 11)
    report.tables[TABLE] = rows
    costs = {row.case: cost(rows, row.case) for row in rows if row.method == BOTH}
    if costs:
        report.grids[COSTS] = Grid(list(costs.values()))
    failed = any(row.failed for row in rows)
    ratio = float(costs[GUARDED]["with over without"]) if GUARDED in costs else math.nan
    report.goals.append(Goal("recording.ratio", ratio, failed))
    for key, few in (("recording.frame", False), ("recording.short", True)):
        adds = [float(cost[_BOTH]) for cost in costs.values() if (int(cost["frames"]) < FEW) is few]
        report.goals.append(Goal(key, max(adds, default=math.nan), failed))
    return report


def cost(rows: Sequence[Row], name: str) -> dict[str, str]:
    """Return what recording adds to a scene, from its fastest rounds."""
    times = {row.method: row for row in rows if row.case == name}
    plain, log, both, library = (times[method].low for method in (PLAIN, LOG, BOTH, LIBRARY))
    return {
        "scene": name,
        "frames": f"{times[PLAIN].queries}",
        "with over without": f"{both / plain:.3f}",
        f"{LOG}, us a frame": f"{1e6 * (log - plain):.1f}",
        _BOTH: f"{1e6 * (both - plain):.1f}",
        _LIBRARY: f"{1e6 * library:.1f}",
    }


def on(name: str, scenario: Scenario, rounds: int) -> list[Row]:
    """Return the rows of one scenario; a recording that does not read back whole is wrong."""
    scene = build(scenario)
    with tempfile.TemporaryDirectory() as folder:
        contenders = [Contender(PLAIN, partial(_simulate, scene), scene.frames, lambda _: Check(0.0))]
        for method, rrd in ((LOG, False), (BOTH, True)):
            task = partial(_record, scene, Path(folder), rrd)
            contenders.append(Contender(method, task, scene.frames, lambda path: _judge(path, scene)))
        made = _record(scene, Path(folder), True).with_suffix(".rrd")
        ready, copy = _Ready(made), Path(folder) / "copy.rrd"
        contenders.append(Contender(LIBRARY, partial(_send, ready, copy), scene.frames, partial(_judge_copy, ready)))
        return compete(name, contenders, rounds=rounds)


def _simulate(scene: Scene) -> None:
    for _ in Simulation(scene).blocks():
        pass


def _record(scene: Scene, folder: Path, rrd: bool) -> Path:
    return record_blocks(scene, Simulation(scene).blocks(), folder, rrd=rrd, overwrite=True).mcap


def _judge(path: Path, scene: Scene) -> Check:
    found = read(path)
    lost = scene.frames - len(found.time) + found.lost_frames
    return Check(float(lost), lost)


class _Ready:
    """What is in an .rrd file, as chunks that are ready to be sent; to the library it is an arrangement too."""

    def __init__(self, rrd: Path) -> None:
        from rerun.chunk import RrdReader

        reader = RrdReader(str(rrd))
        self.recording = list(reader.stream())
        self.arrangement = [chunk for store in reader.blueprints() for chunk in reader.stream(store=store)]

    def rows(self) -> int:
        """Return how many rows there are, without those in which the library describes the file itself."""
        chunks = self.recording + self.arrangement
        return sum(chunk.num_rows for chunk in chunks if not chunk.entity_path.startswith("/__properties"))

    def to_blueprint(self) -> _Ready:
        """Return this."""
        return self

    def _log_to_stream(self, stream: Any) -> None:
        stream.send_chunks(self.arrangement)


def _send(ready: _Ready, path: Path) -> Path:
    """Write chunks that are ready to a file, as the library does it by itself."""
    import rerun as rr

    arrangement: Any = ready
    stream = rr.RecordingStream("replay-bench")
    stream.save(path)
    stream.send_chunks(ready.recording)
    stream.send_blueprint(arrangement, make_active=False)
    stream.flush(timeout_sec=60.0)
    stream.disconnect()
    return path


def _judge_copy(ready: _Ready, path: Path) -> Check:
    lost = abs(ready.rows() - _Ready(path).rows())
    return Check(float(lost), lost)
