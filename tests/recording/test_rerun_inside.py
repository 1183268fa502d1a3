"""Recordings made by the way into rerun and by its public functions: the same, and it is said which."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import Chunk, RrdReader

from replay.numerics import remarks
from replay.recording import rerun_inside
from replay.recording.blueprint_parts import recording_blueprint
from replay.recording.rerun_inside import ChunkBlueprint
from replay.recording.rerun_log import RerunWriter
from tests.recording import moving
from tests.recording.test_rerun_columns import contents


def test_the_rerun_of_the_tests_is_one_that_was_tried() -> None:
    where = "see the text of replay/recording/rerun_inside.py"
    assert rerun_inside.available(), f"rerun {rr.__version__} is not tried: {where}"


def written(path: Path) -> list[str]:
    """Write a recording and return what is in it, all but when it began and the identities of chunks and rows."""
    writer = RerunWriter(path, moving.LAYOUT, moving.scene())
    for block in moving.blocks(40):
        writer.write(block)
    writer.commit()
    lines = []
    for chunk in RrdReader(str(path)).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if not name.startswith("rerun.") and name != "RecordingInfo:start_time":
                values = column.cast("int64") if pa.types.is_duration(column.type) else column
                lines.append(f"{chunk.entity_path} {chunk.is_static} {name} {column.type} {values.to_pylist()}")
    return sorted(lines)


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Any:
    """What is said while the library is asked for anew what it is."""
    texts: list[str] = []
    monkeypatch.setattr(remarks, "_tell", texts.append)
    monkeypatch.setattr(remarks, "_said", set())
    rerun_inside.available.cache_clear()
    yield texts
    rerun_inside.available.cache_clear()


def test_a_name_that_is_gone_closes_the_way_in(said: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delattr(rr.blueprint.Blueprint, "_log_to_stream")
    assert not rerun_inside.available()
    assert len(said) == 1


def test_the_public_way_makes_the_same_recording_and_says_so(
    said: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    fast = written(tmp_path / "fast.rrd")
    assert said == []
    monkeypatch.setattr(rr, "__version__", "0.99.0")
    rerun_inside.available.cache_clear()
    calls: list[str] = []
    public = Chunk.from_columns
    monkeypatch.setattr(Chunk, "from_columns", lambda path, *rest: calls.append(path) or public(path, *rest))
    slow = written(tmp_path / "slow.rrd")
    assert slow == fast
    assert len(fast) > 50
    assert len(calls) > 20, "chunks were made by the public function"
    (text,) = said
    assert text.startswith("rerun 0.99.0 is not known from within")


@pytest.mark.parametrize("charts", [(), ("joints", "distance")])
def test_the_public_way_arranges_the_same(
    said: list[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path, charts: tuple[str, ...]
) -> None:
    corners = np.random.default_rng(3).normal(size=(5, 3))
    mine = recording_blueprint(charts, corners, 2_000_000_000)
    assert isinstance(mine, ChunkBlueprint)
    fast = contents(tmp_path / "fast.rrd", mine)
    monkeypatch.setattr(rr, "__version__", "0.99.0")
    rerun_inside.available.cache_clear()
    theirs = recording_blueprint(charts, corners, 2_000_000_000)
    assert isinstance(theirs, rr.blueprint.Blueprint)
    assert contents(tmp_path / "slow.rrd", theirs) == fast
    assert len(said) == 1
