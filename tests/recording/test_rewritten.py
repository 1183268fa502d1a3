"""A recording that another tool has written anew is the same recording."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from mcap.writer import CompressionType, IndexType

import replay
from replay.batch.select import load_all
from replay.comparison.difference import DiffVerdict
from replay.errors import RecordingError
from replay.recording.reader import read
from replay.recording.slim import attached_files, write_slim
from replay.recording.summary import summarize
from tests.cli.swing import SCENARIO
from tests.recording import synthetic
from tests.recording.rewritten import rewritten
from tests.recording.test_round_trip import assert_same, write

FRAMES = 300
BLOCKS = list(synthetic.blocks(FRAMES))
WAYS: list[dict[str, Any]] = [
    {},
    {"compression": CompressionType.LZ4, "chunk_size": 3000},
    {"compression": CompressionType.NONE, "order": "reversed"},
    {"order": "shuffled", "enable_data_crcs": True},
    {"use_chunking": False, "order": "shuffled"},
    {"use_chunking": False, "enable_crcs": False, "use_statistics": False},
    {"repeat_channels": False, "repeat_schemas": False, "chunk_size": 500},
    {"repeat_schemas": False, "index_types": IndexType.NONE, "use_statistics": False, "use_summary_offsets": False},
    {"repeat_channels": False, "repeat_schemas": False, "index_types": IndexType.NONE, "order": "reversed"},
]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("whole") / "made_up.mcap", FRAMES)


@pytest.mark.parametrize("way", WAYS, ids=str)
def test_it_reads_and_compares_as_the_one_that_was_recorded(tmp_path: Path, whole: Path, way: dict[str, Any]) -> None:
    path = tmp_path / "anew.mcap"
    path.write_bytes(rewritten(whole.read_bytes(), **way))
    recording, original = read(path), read(whole)
    assert_same(recording, BLOCKS)
    assert recording.events == original.events
    assert recording.files == synthetic.FILES and recording.provenance == original.provenance
    assert attached_files(path) == attached_files(whole)
    assert replay.diff(whole, path).verdict is replay.diff(path, whole).verdict is DiffVerdict.SAME
    assert summarize(path, salvage=True).topics == summarize(whole).topics
    tail = read(path, topics=["/tf", "/events"])
    assert tail.events == original.events and len(tail.time) == FRAMES
    write_slim(path, tmp_path / "slim" / "slim.mcap", tmp_path / "objects")
    assert replay.diff(whole, tmp_path / "slim" / "slim.mcap").verdict is DiffVerdict.SAME


def test_a_change_in_it_is_found(tmp_path: Path, whole: Path) -> None:
    other = write(tmp_path / "made_up.mcap", FRAMES + 1)
    path = tmp_path / "anew.mcap"
    path.write_bytes(rewritten(other.read_bytes(), chunk_size=5000))
    assert replay.diff(whole, path).verdict is DiffVerdict.DIFFERENT


def test_cut_it_is_not_trusted(tmp_path: Path, whole: Path) -> None:
    data = rewritten(whole.read_bytes())
    path = tmp_path / "anew.mcap"
    path.write_bytes(data[: len(data) * 3 // 4])
    with pytest.raises(RecordingError, match="cut at byte"):
        read(path)
    with pytest.raises(RecordingError, match=r"nothing can be salvaged|no metadata record"):
        read(path, salvage=True)


def test_it_can_be_run_again(tmp_path: Path) -> None:
    (tmp_path / "swing.yaml").write_text(SCENARIO.replace("EXPECTED", "never"))
    recorded = replay.record(replay.load(tmp_path / "swing.yaml"), tmp_path / "first", rrd=False).mcap
    anew = tmp_path / "anew.mcap"
    anew.write_bytes(rewritten(recorded.read_bytes(), compression=CompressionType.LZ4))
    (scenario,) = load_all([anew])
    again = replay.record(scenario, tmp_path / "second", rrd=False).mcap
    assert again.read_bytes() == recorded.read_bytes()
