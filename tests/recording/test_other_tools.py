"""Our MCAP recordings in rerun's own MCAP tools."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from rerun.chunk import RrdReader

from replay.recording import provenance
from replay.recording.viewer_process import viewer_binary
from replay.recording.writer import McapWriter
from tests.recording import moving

FRAMES = 300


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    target = tmp_path_factory.mktemp("tools") / "moving.mcap"
    described = provenance.describe("moving", "a.yaml", {}, frames=FRAMES, layout=moving.LAYOUT, model={})
    writer = McapWriter(target, described, moving.scene(), {})
    for block in moving.blocks(FRAMES):
        writer.write(block)
    writer.commit()
    return target


def rerun(*arguments: str) -> str:
    done = subprocess.run([str(viewer_binary()), *arguments], capture_output=True, text=True, check=True, timeout=60)
    return done.stdout


def test_its_check_finds_nothing_wrong(path: Path) -> None:
    lines = rerun("mcap", "check", "--full", str(path)).splitlines()
    topics = [line.split() for line in lines if "/" in line and line.startswith(("ok", "warn", "err", "fail"))]
    assert len(topics) == 8
    assert all(words[0] == "ok" for words in topics)


def test_its_import_shows_transforms_and_log_lines(path: Path, tmp_path: Path) -> None:
    target = tmp_path / "converted.rrd"
    rerun("mcap", "convert", str(path), "-o", str(target))
    rows: dict[tuple[str, str], list[object]] = {}
    for chunk in RrdReader(str(target)).stream():
        batch = chunk.to_record_batch()
        for name, column in zip(batch.schema.names, batch.columns, strict=True):
            if ":" in name:
                rows.setdefault((str(chunk.entity_path), name), []).extend(column.to_pylist())
    translations = rows["/tf", "Transform3D:translation"]
    assert len(translations) == FRAMES * len(moving.LAYOUT.links)
    children = rows["/tf", "Transform3D:child_frame"]
    assert {child[0] for child in children} == set(moving.LAYOUT.links)  # type: ignore[index]
    texts = [row[0] for row in rows["/events", "TextLog:text"]]  # type: ignore[index]
    assert "contact begins: head/housing|table/body" in texts
