"""What recording costs: the same run with and without, in turn, on every scene that is shipped.

Two files are opened, closed and made durable once a recording, however short it is; what a frame more costs is told
apart from that by the same motion with several times as many frames. How much is the rerun library's own is measured
too: it is given the same chunks, of the recording and of the viewer's arrangement, ready to be sent, nothing is
computed, and the file is made durable; alone, and while another thread writes the log of blocks that are there. And so
is what nobody can do without: files with nothing in them.
"""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from pathlib import Path
from typing import Any

from replay.bench.goals import PROMISES, Goal
from replay.bench.measure import Check, Contender, Row, absent, compete
from replay.bench.report import Grid, Report
from replay.bench.shipped import shipped
from replay.logs.part_file import write_file
from replay.recording.reader import read
from replay.recording.record import record_blocks
from replay.scenario.model import Scenario
from replay.scenario.scene import Scene, build
from replay.simulation import FrameBlock, Simulation

SCENES = (
    "carm_bodyguard",
    "carm_parking",
    "carm_parking_measured",
    "experiments/parallel_10cm",
    "doctor_walks_in",
    "panda_meets_person",
    "carm_near",
    "carm_head_contact",
    "carm_clear",
    "experiments/inclined_plate",
    "experiments/parallel_20cm",
    "experiments/parallel_30cm",
    "experiments/pivot_10cm",
    "experiments/pivot_20cm",
    "carm_bodyguard_stops",
    "carm_bodyguard_stops_late",
    "carm_bodyguard_stops_thesis",
)
"""All shipped scenes."""
GUARDED = SCENES[0]
"""The scene of the goal: its capacitive sensors are the most there is to compute."""
PLAIN, LOG, BOTH = "without recording", "MCAP", "MCAP and rerun"
LIBRARY, BESIDE = "the rerun library alone", "the rerun library beside the MCAP log"
MORE_PLAIN, MORE_BOTH = f"{PLAIN}, more frames", f"{BOTH}, more frames"
TABLE, COSTS, LEAST = "a frame of a run", "what recording adds", "what files with nothing in them cost"
_ALL, _MORE, _ONCE = f"{BOTH}, us a frame", "a frame more, us", "once a recording, ms"
_LEAST = f"{BESIDE}, us a frame"
_WITHIN = "frames from which it is met"
_GOAL = 1e-6 * PROMISES["recording.short"].required
"""Seconds a frame, all in all."""
FEW = 100
"""Frames below which a run is mostly opening and closing files; it has a goal of its own."""
MORE = 400
"""At least so many frames does the longer run of a scene have more, at a multiple of its rate."""


def run(*, quick: bool = False, rounds: int | None = None, scenes: Sequence[str] = SCENES) -> Report:
    """Run the benchmark.

    Args:
        quick: fewer scenes; about ten seconds.
        rounds: times that every run is timed; 11, or 4 when quick, if None.
        scenes: names of shipped scenarios.
    """
    rounds = rounds or (4 if quick else 11)
    report = Report("recording")
    rows: list[Row] = []
    for name in scenes[:3] if quick else scenes:
        found = shipped(name)
        rows += [absent(name, PLAIN, found)] if isinstance(found, str) else on(name, found, rounds)
    report.tables[TABLE] = rows
    costs = {row.case: cost(rows, row.case) for row in rows if row.method == BOTH}
    if costs:
        report.grids[COSTS] = Grid(list(costs.values()))
    failed = any(row.failed for row in rows)
    ratio = float(costs[GUARDED]["with over without"]) if GUARDED in costs else math.nan
    report.goals.append(Goal("recording.ratio", ratio, failed))
    adds = {
        "recording.frame": [float(cost[_MORE]) for cost in costs.values()],
        "recording.all": [float(cost[_ALL]) for cost in costs.values() if int(cost["frames"]) >= FEW],
        "recording.short": [float(cost[_ALL]) for cost in costs.values() if int(cost["frames"]) < FEW],
    }
    report.goals += [Goal(key, max(several, default=math.nan), failed) for key, several in adds.items()]
    report.tables[LEAST] = nothing(rounds)
    report.notes += _limits(report.tables[LEAST], list(costs.values()))
    return report


def _limits(empty: Sequence[Row], costs: Sequence[dict[str, str]]) -> list[str]:
    """Return what short recordings cannot be faster than."""
    once = sum(row.low for row in empty)
    notes = [
        f"Nobody can record fewer than {math.ceil(once / _GOAL)} frames within {1e6 * _GOAL:g} us a frame: "
        f"files with nothing in them take {1e3 * once:.1f} ms."
    ]
    short = [float(cost[_LEAST]) for cost in costs if int(cost["frames"]) < FEW]
    if short:
        notes.append(
            f"With all that is written ready, and both files written at once, scenes of fewer than {FEW} frames take "
            f"{min(short):.0f} to {max(short):.0f} us a frame: {BESIDE}."
        )
    return notes


def cost(rows: Sequence[Row], name: str) -> dict[str, str]:
    """Return what recording adds to a scene, from its fastest rounds."""
    found = {row.method: row for row in rows if row.case == name}
    times = {method: row.low * row.queries for method, row in found.items()}
    frames, longer = found[PLAIN].queries, found[MORE_PLAIN].queries
    adds = times[BOTH] - times[PLAIN]
    more = (times[MORE_BOTH] - times[MORE_PLAIN] - adds) / (longer - frames)
    return {
        "scene": name,
        "frames": f"{frames}",
        "with over without": f"{times[BOTH] / times[PLAIN]:.3f}",
        f"{LOG}, us a frame": f"{1e6 * (times[LOG] - times[PLAIN]) / frames:.1f}",
        _ALL: f"{1e6 * adds / frames:.1f}",
        f"{LIBRARY}, us a frame": f"{1e6 * times[LIBRARY] / frames:.1f}",
        _LEAST: f"{1e6 * times[BESIDE] / frames:.1f}",
        _MORE: f"{1e6 * more:.1f}",
        _ONCE: f"{1e3 * (adds - more * frames):.1f}",
        _WITHIN: f"{math.ceil((adds - more * frames) / (_GOAL - more))}" if more < _GOAL else "never",
    }


def on(name: str, scenario: Scenario, rounds: int) -> list[Row]:
    """Return the rows of one scenario; a recording that does not read back whole is wrong."""
    scene = build(scenario)
    finer = 1 + math.ceil(MORE / max(scene.frames - 1, 1))  # frames are at both ends
    longer = build(scenario.model_copy(update={"rate": finer * scenario.rate}))
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        made = _record(scene, folder, True).with_suffix(".rrd")
        ready, copy = _Ready(made), folder / "copy.rrd"
        blocks = list(Simulation(scene).blocks())
        contenders = [
            _without(PLAIN, scene),
            _with(LOG, scene, folder, False),
            _with(BOTH, scene, folder, True),
            Contender(LIBRARY, partial(_send, ready, copy), scene.frames, partial(_judge_copy, ready)),
            Contender(
                BESIDE, partial(_beside, ready, copy, scene, blocks, folder), scene.frames, partial(_judge_copy, ready)
            ),
            _without(MORE_PLAIN, longer),
            _with(MORE_BOTH, longer, folder, True),
        ]
        return compete(name, contenders, rounds=rounds)


def nothing(rounds: int) -> list[Row]:
    """Return what a file costs that has nothing in it: one of the rerun library's, and one that is made durable."""
    with tempfile.TemporaryDirectory() as place:
        rrd, durable = Path(place) / "nothing.rrd", Path(place) / "nothing"
        contenders = [
            Contender("opened and closed by the rerun library", partial(_open_and_close, rrd), 1, _judge_there),
            Contender("made durable, with its name", partial(write_file, durable, b""), 1, _judge_there),
        ]
        return compete("a file", contenders, rounds=rounds)


def _without(method: str, scene: Scene) -> Contender:
    return Contender(method, partial(_simulate, scene), scene.frames, lambda _: Check(0.0))


def _with(method: str, scene: Scene, folder: Path, rrd: bool) -> Contender:
    return Contender(method, partial(_record, scene, folder, rrd), scene.frames, lambda path: _judge(path, scene))


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


def _open_and_close(path: Path) -> Path:
    import rerun as rr

    stream = rr.RecordingStream("replay-bench")
    stream.save(path)
    stream.flush(timeout_sec=60.0)
    stream.disconnect()
    return path


def _judge_there(path: Path) -> Check:
    lost = int(not path.is_file())
    return Check(float(lost), lost)


def _send(ready: _Ready, path: Path) -> Path:
    """Write chunks that are ready to a file, as the library does it by itself, and make the file durable."""
    import rerun as rr

    arrangement: Any = ready
    stream = rr.RecordingStream("replay-bench")
    stream.save(path)
    stream.send_chunks(ready.recording)
    stream.send_blueprint(arrangement, make_active=False)
    stream.flush(timeout_sec=60.0)
    stream.disconnect()
    with path.open("rb+") as file:
        os.fsync(file.fileno())
    return path


def _beside(ready: _Ready, path: Path, scene: Scene, blocks: Sequence[FrameBlock], folder: Path) -> Path:
    """Write both files at once, each in a thread, the log from blocks that are there."""
    path.unlink(missing_ok=True)
    with ThreadPoolExecutor(1) as library:
        sent = library.submit(_send, ready, path)
        record_blocks(scene, blocks, folder, rrd=False, overwrite=True)
        return sent.result()


def _judge_copy(ready: _Ready, path: Path) -> Check:
    lost = abs(ready.rows() - _Ready(path).rows())
    return Check(float(lost), lost)
