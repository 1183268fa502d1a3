"""A rerun recording as a file that is there whole, or not at all."""

import os
import time
from pathlib import Path

import pytest

from replay.recording.rerun_file import RerunFile


def test_a_file_is_made_durable_in_the_background_before_it_gets_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    durable = []
    sync = os.fsync

    def noted(descriptor: int) -> None:
        sync(descriptor)
        durable.append(os.fstat(descriptor).st_ino)

    monkeypatch.setattr(os, "fsync", noted)
    file = RerunFile(tmp_path / "a.rrd", overwrite=True)
    file.open("made").send_recording_name("a")
    file.finish()
    deadline = time.monotonic() + 60.0
    while not durable and time.monotonic() < deadline:
        time.sleep(0.01)
    (part,) = tmp_path.iterdir()
    assert part.name != "a.rrd" and durable == [part.stat().st_ino]
    file.commit()
    assert [path.name for path in tmp_path.iterdir()] == ["a.rrd"] and (tmp_path / "a.rrd").stat().st_size > 0


def test_a_file_that_is_given_up_leaves_nothing(tmp_path: Path) -> None:
    file = RerunFile(tmp_path / "a.rrd", overwrite=True)
    file.open("made").send_recording_name("a")
    file.finish()
    file.discard()
    assert list(tmp_path.iterdir()) == []
