"""Writing in a thread: the same files, errors that surface, nothing half-written."""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from replay.errors import WriteError
from replay.recording.behind import WriteBehind
from replay.recording.rerun_log import RerunWriter
from replay.recording.writer import McapWriter
from replay.simulation import FrameBlock
from tests.recording import synthetic
from tests.recording.test_round_trip import write

FRAMES = 1000


def writers(folder: Path) -> tuple[RerunWriter, McapWriter]:
    rrd = RerunWriter(folder / "made_up.rrd", synthetic.LAYOUT, synthetic.scene())
    mcap = McapWriter(folder / "made_up.mcap", synthetic.described(FRAMES), synthetic.scene(), synthetic.FILES)
    return rrd, mcap


@pytest.mark.parametrize("threaded", [True, False])
def test_the_same_bytes_are_written_with_and_without_a_thread(threaded: bool, tmp_path: Path) -> None:
    with WriteBehind(writers(tmp_path), threaded=threaded) as behind:
        for block in synthetic.blocks(FRAMES, wild=False):
            behind.put(block)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["made_up.mcap", "made_up.rrd"]
    other = McapWriter(tmp_path / "b.mcap", synthetic.described(FRAMES), synthetic.scene(), synthetic.FILES)
    for block in synthetic.blocks(FRAMES, wild=False):
        other.write(block)
    other.commit()
    assert (tmp_path / "made_up.mcap").read_bytes() == (tmp_path / "b.mcap").read_bytes()


@pytest.mark.parametrize("threaded", [True, False])
def test_an_error_of_the_simulation_leaves_no_file(threaded: bool, tmp_path: Path) -> None:
    with pytest.raises(ZeroDivisionError), WriteBehind(writers(tmp_path), threaded=threaded) as behind:
        behind.put(next(synthetic.blocks(FRAMES, wild=False)))
        raise ZeroDivisionError
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("threaded", [True, False])
@pytest.mark.parametrize("blocks", [0, 1])
def test_after_an_error_of_the_simulation_nothing_is_finished(threaded: bool, blocks: int) -> None:
    log: list[str] = []
    writers = [Noting(name, log, lambda: True) for name in "ab"]
    with pytest.raises(ZeroDivisionError), WriteBehind(writers, threaded=threaded) as behind:
        for block in itertools.islice(synthetic.blocks(FRAMES, wild=False), blocks):
            behind.put(block)
        raise ZeroDivisionError
    assert not {"a finish", "b finish", "a commit", "b commit"} & set(log)
    assert log[-2:] == ["a discard", "b discard"]


class Failing:
    """A writer that fails at its third block."""

    def __init__(self) -> None:
        self.blocks = 0
        self.log: list[str] = []

    def prepare(self) -> None:
        pass

    def write(self, block: FrameBlock) -> None:
        self.blocks += 1
        if self.blocks == 3:
            raise WriteError("x.mcap", "No space left on device")

    def finish(self) -> None:
        self.log.append("finish")

    def commit(self) -> None:
        self.log.append("commit")

    def discard(self) -> None:
        self.log.append("discard")


def test_an_error_in_the_thread_stops_the_run(tmp_path: Path) -> None:
    failing = Failing()
    put = 0
    with pytest.raises(WriteError, match="No space left"), WriteBehind([failing, *writers(tmp_path)]) as behind:
        for block in synthetic.blocks(256 * 100, wild=False):
            behind.put(block)
            put += 1
    assert put < 20, "the run must stop soon after the disk is full"
    assert failing.blocks == 3 and failing.log == ["discard"]
    assert list(tmp_path.iterdir()) == []


class Noting:
    """A writer that notes what it is asked for; writing begins when something is there to wait for."""

    def __init__(self, name: str, log: list[str], ready: Callable[[], bool]) -> None:
        self.name, self.log, self.ready = name, log, ready

    def __getattr__(self, task: str) -> Callable[..., None]:
        def note(*_: object) -> None:
            self.log.append(f"{self.name} {task}")
            while task == "write" and not self.ready():
                time.sleep(0.001)

        return note


@pytest.mark.parametrize("blocks", [0, 1, 2])
def test_the_first_writer_finishes_while_the_next_has_to_write(blocks: int) -> None:
    log: list[str] = []
    behind = WriteBehind(
        [Noting(name, log, lambda: behind._queue.qsize() == waiting or "a write" in log[:-1]) for name in "ab"]
    )
    waiting = blocks  # the other blocks, and the end
    with behind:
        for block in itertools.islice(synthetic.blocks(FRAMES, wild=False), blocks):
            behind.put(block)
    tasks = [*["write"] * blocks, "finish"]
    expected = [
        "a prepare",
        "b prepare",
        *(f"{name} {task}" for name in "ab" for task in tasks),
        "a commit",
        "b commit",
    ]
    assert log == expected


def test_without_a_thread_each_file_is_closed_before_the_next_is_begun() -> None:
    log: list[str] = []
    with WriteBehind([Noting(name, log, lambda: True) for name in "ab"], threaded=False) as behind:
        behind.put(next(synthetic.blocks(FRAMES, wild=False)))
        assert log == []
    assert log == ["a write", "a finish", "b write", "b finish", "a commit", "b commit"]


@pytest.mark.parametrize("threaded", [True, False])
def test_a_full_disk_removes_the_unfinished_file(threaded: bool, tmp_path: Path) -> None:
    for name in ("made_up.mcap", "made_up.rrd"):
        (tmp_path / f"{name}.part").symlink_to("/dev/full")
    for writer in writers(tmp_path):
        with pytest.raises(WriteError), WriteBehind([writer], threaded=threaded) as behind:
            for block in synthetic.blocks(FRAMES, wild=False):
                behind.put(block)
    assert list(tmp_path.iterdir()) == []


def test_memory_does_not_grow_with_the_recording(tmp_path: Path) -> None:
    """What a writer keeps of a block is its place in the index, about a hundred bytes a chunk."""
    import tracemalloc

    writer = McapWriter(tmp_path / "a.mcap", synthetic.described(256 * 40), synthetic.scene(), synthetic.FILES)
    block = next(synthetic.blocks(256, wild=False))
    writer.write(block)
    tracemalloc.start()
    try:
        for _ in range(39):
            writer.write(block)
        kept, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    writer.discard()
    assert kept < 39 * 6 * 2000


def test_the_whole_file_is_there_only_at_the_end(tmp_path: Path) -> None:
    with WriteBehind(writers(tmp_path)) as behind:
        behind.put(next(synthetic.blocks(256, wild=False)))
        assert sorted(path.suffix for path in tmp_path.iterdir()) == [".part", ".part"]
    assert write(tmp_path / "again.mcap", 300).exists()
