"""Damaged and cut recordings: an error or the numbers that were written, never others."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from replay.errors import RecordingError
from replay.recording.reader import read
from replay.recording.summary import summarize
from tests.recording import synthetic
from tests.recording.test_round_trip import assert_same, write

FRAMES = 600
BLOCKS = list(synthetic.blocks(FRAMES))


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    return write(tmp_path_factory.mktemp("whole") / "made_up.mcap", FRAMES).read_bytes()


def damaged(data: bytes, rng: random.Random) -> bytes:
    """Return data with one wound; places near the beginning and the end are as likely as all others together."""
    span = rng.choice([range(0, 6000), range(len(data)), range(len(data) - 4000, len(data))])
    at = rng.choice(span)
    kind = rng.choice(["flip", "flip", "byte", "cut", "zeros", "removed", "doubled"])
    if kind == "cut":
        return data[:at]
    wound = bytearray(data)
    size = rng.choice([1, 4, 9, 100])
    if kind == "flip":
        wound[at] ^= 1 << rng.randrange(8)
    elif kind == "byte":
        wound[at] = rng.randrange(256)
    elif kind == "zeros":
        wound[at : at + size] = bytes(min(size, len(data) - at))
    elif kind == "removed":
        del wound[at : at + size]
    else:
        wound[at:at] = wound[at : at + size]
    return bytes(wound)


def check(path: Path, whole: bytes, wound: bytes) -> str:
    """Read a damaged file both ways; return what became of it."""
    path.write_bytes(wound)
    if wound == whole:
        return "unchanged"
    try:
        found = read(path)
    except RecordingError as error:
        assert "\n" not in str(error)
    else:  # the wound has made a checksum 0, which means that there is none
        assert_same(found, BLOCKS)
        assert (found.files, found.provenance) == (synthetic.FILES, synthetic.described(FRAMES))
        return "unchecked"
    try:
        salvaged = read(path, salvage=True)
    except RecordingError as error:
        assert "\n" not in str(error)
        return "lost"
    assert salvaged.loss is not None
    assert salvaged.lost_frames == FRAMES - len(salvaged.time)
    assert_same(salvaged, BLOCKS)
    return "salvaged"


def fuzz(path: Path, whole: bytes, count: int, seed: int) -> None:
    rng = random.Random(seed)
    outcomes = [check(path, whole, damaged(whole, rng)) for _ in range(count)]
    assert outcomes.count("salvaged") > count / 4, "the sample must reach the part that can be salvaged"
    assert outcomes.count("lost") > count / 20
    assert outcomes.count("unchecked") <= count / 200


def test_a_wound_anywhere_is_an_error_or_salvaged_truthfully(tmp_path: Path, whole: bytes) -> None:
    fuzz(tmp_path / "wound.mcap", whole, 200, 7)


@pytest.mark.soak
def test_thousands_of_wounds(tmp_path: Path, whole: bytes) -> None:
    fuzz(tmp_path / "wound.mcap", whole, 4000, 11)


def test_a_cut_recording_keeps_its_whole_blocks(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "cut.mcap.part"
    kept = []
    for tenths in range(1, 10):
        path.write_bytes(whole[: len(whole) * tenths // 10])
        with pytest.raises(RecordingError, match="cut at byte"):
            read(path)
        salvaged = read(path, salvage=True)
        assert len(salvaged.time) in (0, 256, 512)
        assert salvaged.loss is not None and salvaged.loss.bytes >= 0
        assert all(event.frame < len(salvaged.time) for event in salvaged.events)
        kept.append(len(salvaged.time))
    assert kept == sorted(kept) and {0, 256, 512} == set(kept)
    path.write_bytes(whole)
    assert read(path, salvage=True).loss is None


def kill_at_random(tmp_path: Path, count: int, seed: int) -> None:
    """Kill writers at random moments: each leaves a whole file, or a `.part` that tells the truth, or nothing yet."""
    code = (
        "import sys, time; from pathlib import Path; from tests.recording import synthetic; "
        "from replay.recording.writer import McapWriter\n"
        "blocks = list(synthetic.blocks(600)); described = synthetic.described(600); print('ready', flush=True)\n"
        "w = McapWriter(Path(sys.argv[1]), described, synthetic.scene(), synthetic.FILES)\n"
        "for b in blocks: w.write(b); time.sleep(0.03)\n"
        "w.commit()\n"
    )
    rng = random.Random(seed)
    for k in range(count):
        path = tmp_path / f"run{k}.mcap"
        process = subprocess.Popen([sys.executable, "-c", code, str(path)], stdout=subprocess.PIPE)
        assert process.stdout is not None
        process.stdout.readline()
        time.sleep(rng.uniform(0.0, 0.2))
        process.send_signal(signal.SIGKILL)
        process.wait()
        process.stdout.close()
        part = path.with_name(path.name + ".part")
        if path.exists():
            assert_same(read(path), BLOCKS)
        elif part.exists():
            try:
                assert_same(read(part, salvage=True), BLOCKS)
            except RecordingError as error:
                assert part.stat().st_size < 20_000, error  # killed before the first block


def test_a_killed_writer_leaves_the_truth(tmp_path: Path) -> None:
    kill_at_random(tmp_path, 4, 3)


@pytest.mark.soak
def test_many_killed_writers(tmp_path: Path) -> None:
    kill_at_random(tmp_path, 50, 5)


def test_a_summary_tells_what_is_there_and_what_is_lost(tmp_path: Path, whole: bytes) -> None:
    path = tmp_path / "made_up.mcap"
    path.write_bytes(whole)
    summary = summarize(path)
    assert {topic.topic: topic.messages for topic in summary.topics}["/tf"] == FRAMES
    assert summary.provenance == synthetic.described(FRAMES)
    assert summary.files == {name: len(data) for name, data in synthetic.FILES.items()}
    assert summary.loss is None and summary.lost_frames == 0 and summary.bytes == len(whole)
    path.write_bytes(whole[: len(whole) * 3 // 4])
    with pytest.raises(RecordingError, match="cut at"):
        summarize(path)
    salvaged = summarize(path, salvage=True)
    assert salvaged.loss is not None and salvaged.lost_frames == FRAMES - 256 == read(path, salvage=True).lost_frames
    path.write_bytes(whole[:3000])
    for attempt in (read, summarize):
        with pytest.raises(RecordingError):
            attempt(path, salvage=True)
