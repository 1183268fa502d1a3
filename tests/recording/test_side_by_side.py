"""Two recordings in one: everything of both is there, below their names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from rerun.chunk import RrdReader

from replay.errors import ViewerError
from replay.recording.rerun_log import RerunWriter
from replay.recording.side_by_side import Contents, one_recording, side_names
from tests.recording import moving


def write(path: Path, frames: int) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    writer = RerunWriter(path, moving.LAYOUT, moving.scene())
    for block in moving.blocks(frames):
        writer.write(block)
    writer.commit()
    return path


def contents(path: Path, below: str = "") -> dict[tuple[str, str], list[object]]:
    """Return what is logged for each entity and component, by time; below a folder, and named from there."""
    found: dict[tuple[str, str], list[tuple[object, object]]] = {}
    for chunk in RrdReader(str(path)).stream():
        entity, batch = str(chunk.entity_path), chunk.to_record_batch()
        if entity.startswith(f"{below}/") and not entity.startswith("/__"):
            names = batch.schema.names
            times = batch.column("frame").to_pylist() if "frame" in names else [-1] * len(batch)
            for name in names:
                if ":" in name:
                    rows = found.setdefault((entity.removeprefix(below), name), [])
                    rows.extend(zip(times, batch.column(name).to_pylist(), strict=True))
    return {key: sorted(rows, key=lambda row: row[0]) for key, rows in found.items()}  # type: ignore[type-var,misc]


def test_everything_of_both_is_there(tmp_path: Path) -> None:
    files = [write(tmp_path / name / "moving.rrd", frames) for name, frames in (("old", 300), ("new ä", 200))]
    with one_recording(files) as both:
        for file, side in zip(files, ("/old", "/new\\ ä"), strict=True):
            alone = contents(file)
            assert len(alone) > 20
            beside = contents(both, side)
            assert beside.keys() == alone.keys()
            assert all(repr(beside[key]) == repr(alone[key]) for key in alone)  # by text: NaN is not NaN
        assert len(RrdReader(str(both)).blueprints()) == 1
    assert not both.exists()
    with one_recording(files[:1]) as one:
        assert one == files[0]


def eyes(path: Path) -> np.ndarray:
    """Return position and target (views, 2, 3) [m] of the eyes of a recording's views."""
    found = Contents()
    found.look_from(RrdReader(str(path)))
    return np.array(found.eyes)


def test_both_are_seen_as_each_is_seen_alone(tmp_path: Path) -> None:
    files = [write(tmp_path / name / "moving.rrd", 10) for name in ("old", "new")]
    alone = eyes(files[0])
    assert alone.shape == (1, 2, 3) and np.isfinite(alone).all()
    with one_recording(files) as both:
        views = eyes(both)
    assert len(views) == 2
    np.testing.assert_allclose(views, np.repeat(alone, 2, axis=0), rtol=0, atol=1e-5 * np.abs(alone).max())


def test_sides_are_named_by_what_tells_them_apart() -> None:
    def names(*paths: str) -> list[str]:
        return side_names([Path(path) for path in paths])

    assert names("/r/a/a.rrd", "/r/b/b.rrd") == ["a", "b"]
    assert names("/r/old/a/a.rrd", "/r/new/a/a.rrd") == ["old", "new"]
    assert names("/r/a.rrd", "/r/a.rrd") == ["1 a", "2 a"]
    assert names("/x/1/a.rrd", "/x/2/a.rrd", "/x/2/b.rrd") == ["1 a", "2 a", "3 b"]


def test_what_is_no_recording_is_named(tmp_path: Path) -> None:
    file = write(tmp_path / "a.rrd", 10)
    (tmp_path / "b.rrd").write_text("nothing")
    with pytest.raises(ViewerError, match=r"b\.rrd: cannot be read"), one_recording([file, tmp_path / "b.rrd"]):
        pass
    whole = file.read_bytes()
    for name, data in {"cut": whole[: len(whole) // 2], "empty": b""}.items():
        (tmp_path / f"{name}.rrd").write_bytes(data)
        with (
            pytest.raises(ViewerError, match=rf"{name}\.rrd: cannot be read"),
            one_recording([tmp_path / f"{name}.rrd"]),
        ):
            pass
    with one_recording([file]) as shown:
        assert shown == file
