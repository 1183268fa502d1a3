"""What recording costs: the same run with and without, in turn, on scenes with much and with little to compute."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path

from replay.bench.goals import Goal
from replay.bench.measure import Check, Contender, Row, absent, compete
from replay.bench.report import Grid, Report
from replay.bench.shipped import shipped
from replay.recording.reader import read
from replay.recording.record import record_blocks
from replay.scenario.model import Scenario
from replay.scenario.scene import Scene, build
from replay.simulation import Simulation

SCENES = ("carm_bodyguard", "carm_parking", "carm_clear", "doctor_walks_in")
GUARDED = SCENES[0]
"""The scene of the goal: its capacitive sensors are the most there is to compute."""
PLAIN, LOG, BOTH = "without recording", "MCAP", "MCAP and rerun"
TABLE, COSTS = "a frame of a run", "what recording adds, MCAP and rerun"
LONG = "us a frame, four times as many"
TIMES, FINER = 4, " at four times the rate"


def run(*, quick: bool = False, rounds: int | None = None, scenes: Sequence[str] = SCENES) -> Report:
    """Run the benchmark.

    Args:
        quick: fewer scenes; about ten seconds.
        rounds: times that every run is timed; 3 if None.
        scenes: names of shipped scenarios.
    """
    report = Report("recording")
    rows: list[Row] = []
    for name in scenes[:2] if quick else scenes:
        found = shipped(name)
        if isinstance(found, str):
            rows.append(absent(name, PLAIN, found))
            continue
        for part in (found, finer(found)):
            rows += on(part, rounds or 3)
    report.tables[TABLE] = rows
    times = {(row.case, row.method): row for row in rows if row.rounds}
    costs = [cost(times, name) for name in scenes if (name, BOTH) in times]
    ratios = {cost["scene"]: float(cost["with over without"]) for cost in costs}
    longer = [float(cost[LONG]) for cost in costs]
    if costs:
        report.grids[COSTS] = Grid(costs)
    failed = any(row.failed for row in rows)
    report.goals.append(Goal("recording.ratio", ratios.get(GUARDED, math.nan), failed))
    report.goals.append(Goal("recording.frame", max(longer, default=math.nan), failed))
    return report


def cost(times: Mapping[tuple[str, str], Row], name: str) -> dict[str, str]:
    """Return what recording adds to a scene, opening and closing the files included."""
    long = f"{name}{FINER}"
    plain, both = times[name, PLAIN], times[name, BOTH]
    return {
        "scene": name,
        "with over without": f"{both.low / plain.low:.3f}",
        "us a frame, as it is": f"{1e6 * (both.low - plain.low):.1f}",
        LONG: f"{1e6 * (times[long, BOTH].low - times[long, PLAIN].low):.1f}",
    }


def finer(scenario: Scenario) -> Scenario:
    """Return the same motion in more frames."""
    result = scenario.model_copy(update={"rate": TIMES * scenario.rate, "name": f"{scenario.name}{FINER}"})
    result._provenance = scenario.provenance
    return result


def on(scenario: Scenario, rounds: int) -> list[Row]:
    """Return the rows of one scenario; a recording that does not read back whole is wrong."""
    scene = build(scenario)
    with tempfile.TemporaryDirectory() as folder:
        contenders = [Contender(PLAIN, partial(_simulate, scene), scene.frames, lambda _: Check(0.0))]
        for name, rrd in ((LOG, False), (BOTH, True)):
            task = partial(_record, scene, Path(folder), rrd)
            contenders.append(Contender(name, task, scene.frames, lambda path: _judge(path, scene)))
        return compete(scenario.name, contenders, rounds=rounds)


def _simulate(scene: Scene) -> None:
    for _ in Simulation(scene).blocks():
        pass


def _record(scene: Scene, folder: Path, rrd: bool) -> Path:
    return record_blocks(scene, Simulation(scene).blocks(), folder, rrd=rrd, overwrite=True).mcap


def _judge(path: Path, scene: Scene) -> Check:
    found = read(path)
    lost = scene.frames - len(found.time) + found.lost_frames
    return Check(float(lost), lost)
