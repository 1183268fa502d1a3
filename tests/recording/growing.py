"""Writes many rerun recordings in one process, and says what it grew by: python -m tests.recording.growing KIND COUNT.

The growth is measured between a third of them and the last: threads, handles, and resident memory [MiB].
"""

import json
import sys
import tempfile
from pathlib import Path

import psutil

from replay.comparison.overlay import write_overlay
from replay.comparison.runs import Case, RecordingPair, diff_pair
from replay.recording.record import record_blocks
from replay.recording.rerun_log import RerunWriter
from replay.recording.side_by_side import write_side_by_side
from replay.scenario.load import load_sources
from replay.scenario.scene import build
from replay.simulation import Simulation
from tests.batch import scenes
from tests.comparison import made_up
from tests.comparison.changed import BASELINE, CANDIDATE
from tests.recording import moving


def recordings(folder):
    """Yield what writes a recording of its own."""
    scene, blocks = moving.scene(), list(moving.blocks(50))
    while True:
        writer = RerunWriter(folder / "a.rrd", moving.LAYOUT, scene, overwrite=True)
        for block in blocks:
            writer.write(block)
        writer.commit()
        yield


def discarded(folder):
    """As `recordings`, but each is given up."""
    while True:
        writer = RerunWriter(folder / "a.rrd", moving.LAYOUT, moving.scene(), overwrite=True)
        writer.write(next(moving.blocks(50)))
        writer.discard()
        yield


def overlays(folder):
    """Yield what writes a recording that shows two runs."""
    paths = [folder / name / "a.mcap" for name in ("one", "other")]
    made_up.write(BASELINE, paths[0])
    made_up.write(CANDIDATE, paths[1])
    from replay.recording.reader import read

    while True:
        pair = RecordingPair(read(paths[0]), read(paths[1]))
        write_overlay(folder / "a.rrd", Case("a", *paths, diff_pair(pair, rules=None)), pair)
        yield


def side_by_side(folder):
    """Yield what writes a recording of two others."""
    next(recordings(folder))
    (folder / "a.rrd").rename(folder / "b.rrd")
    next(recordings(folder))
    while True:
        write_side_by_side([folder / "a.rrd", folder / "b.rrd"], folder / "both.rrd")
        yield


def runs(folder):
    """Yield what records a whole scenario, as a worker does."""
    scene = build(load_sources("a.yaml", {"a.yaml": scenes.text("a").encode()}))
    while True:
        record_blocks(scene, Simulation(scene).blocks(), folder, overwrite=True)
        yield


def main(kind, count):
    process = psutil.Process()

    def state():
        return {
            "threads": process.num_threads(),
            "handles": process.num_fds(),
            "MiB": process.memory_info().rss / 2**20,
        }

    with tempfile.TemporaryDirectory() as folder:
        work = globals()[kind](Path(folder))
        for _ in range(count // 3):
            next(work)
        before = state()
        for _ in range(count - count // 3):
            next(work)
        print(json.dumps({name: value - before[name] for name, value in state().items()}))


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
