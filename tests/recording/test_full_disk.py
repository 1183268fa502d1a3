"""A disk that becomes full anywhere in a file: one clear error, soon, and nothing that looks like a result.

The system refuses to let a file of this process grow beyond a limit (RLIMIT_FSIZE), as a full disk does.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from replay.errors import RecordingExistsError, WriteError
from replay.logs.part_file import append_lines, json_line, write_file
from replay.recording.behind import WriteBehind, Writer
from replay.recording.export import FORMATS, export
from replay.recording.reader import read
from replay.recording.rerun_log import RerunWriter
from replay.recording.writer import McapWriter
from tests.recording import synthetic
from tests.recording.test_round_trip import write

FRAMES = 3000


@contextlib.contextmanager
def room_for(size: int) -> Iterator[None]:
    """Let no file of this process grow beyond a size [bytes]."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    handler = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
        signal.signal(signal.SIGXFSZ, handler)


def mcap(folder: Path) -> Writer:
    return McapWriter(folder / "a.mcap", synthetic.described(FRAMES), synthetic.scene(), synthetic.FILES)


def rrd(folder: Path) -> Writer:
    return RerunWriter(folder / "a.rrd", synthetic.LAYOUT, synthetic.scene())


def record(make: Callable[[Path], Writer], folder: Path) -> int:
    """Return how many blocks were put before the run ended."""
    put = 0
    with WriteBehind([make(folder)]) as behind:
        for block in synthetic.blocks(FRAMES, wild=False):
            behind.put(block)
            put += 1
    return put


@pytest.mark.parametrize(("make", "short"), [(mcap, 1), (rrd, 5000)])  # the size of an .rrd is not always the same
def test_a_recording_is_whole_or_not_there(make: Callable[[Path], Writer], short: int, tmp_path: Path) -> None:
    (tmp_path / "whole").mkdir()
    record(make, tmp_path / "whole")
    (whole,) = (tmp_path / "whole").iterdir()
    size = whole.stat().st_size
    for room in (0, 1, 1000, *(size * k // 10 for k in range(1, 10)), size - short):
        folder = tmp_path / str(room)
        folder.mkdir()
        with room_for(room), pytest.raises(WriteError) as caught:
            record(make, folder)
        assert str(caught.value) == f"{folder / whole.name}: cannot be written: File too large"
        assert list(folder.iterdir()) == []


def test_other_files_are_whole_or_as_they_were(tmp_path: Path) -> None:
    report = tmp_path / "report.html"
    write_file(report, "before")
    with room_for(1000), pytest.raises(WriteError, match=r"report.html: cannot be written: File too large"):
        write_file(report, "after" * 1000)
    assert report.read_text() == "before"
    write_file(report, "after")
    assert report.read_text() == "after"
    with pytest.raises(RecordingExistsError):
        write_file(report, "never", overwrite=False)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    recording = read(write(tmp_path / "in" / "a.mcap", 600))
    for form in FORMATS:
        (tmp_path / form).mkdir()
        with room_for(2000), pytest.raises(WriteError):
            export(recording, tmp_path / form, format=form, topics=["/tf"])
        assert list((tmp_path / form).iterdir()) == []


def test_lines_are_appended_all_or_none(tmp_path: Path) -> None:
    log = tmp_path / "sub" / "log.jsonl"
    append_lines(log, ["one", "zwei ä"])
    with room_for(500), pytest.raises(WriteError, match="File too large"):
        append_lines(log, ["x" * 100] * 20)
    append_lines(log, ["three"])
    assert log.read_text(encoding="utf-8") == "one\nzwei ä\nthree\n"


def test_links_and_devices_that_the_user_names_are_written_in_place(tmp_path: Path) -> None:
    (tmp_path / "report").write_text("before")
    (tmp_path / "link").symlink_to(tmp_path / "report")
    assert write_file(tmp_path / "link", "after", named=True).is_symlink()
    append_lines(tmp_path / "link", ["more"], named=True)
    assert (tmp_path / "report").read_text() == "aftermore\n"
    (tmp_path / "full").symlink_to("/dev/full")
    with pytest.raises(WriteError, match="No space left"):
        write_file(tmp_path / "full", "x", named=True)
    assert (tmp_path / "full").is_symlink()


def test_other_links_are_replaced_or_refused_and_never_written_through(tmp_path: Path) -> None:
    (tmp_path / "kept").write_text("precious")
    for name in ("link", "lines"):
        (tmp_path / name).symlink_to(tmp_path / "kept")
    (tmp_path / "pipe").symlink_to("/dev/full")
    for name in ("link", "pipe"):
        assert not write_file(tmp_path / name, "new").is_symlink()
        assert (tmp_path / name).read_text() == "new"
    with pytest.raises(WriteError, match="it is a link, and nothing is written through links here"):
        append_lines(tmp_path / "lines", ["more"])
    (tmp_path / "other").hardlink_to(tmp_path / "kept")
    append_lines(tmp_path / "other", ["!"])
    assert (tmp_path / "other").read_text() == "precious!\n"
    assert (tmp_path / "kept").read_text() == "precious"


def test_lines_of_json_hold_no_character_that_shows_nothing(tmp_path: Path) -> None:
    value = {"näher": "a\u202eb\x9bc\x7f\udcff\U000e0001d", "is": ["fine", "ß"]}
    text = json_line(value)
    assert json.loads(text) == value
    assert text.isprintable()
    assert "näher" in text


def test_an_unfinished_file_is_replaced_whatever_has_its_name(tmp_path: Path) -> None:
    kept = tmp_path / "kept"
    kept.write_text("precious")
    (tmp_path / "a.part").symlink_to(kept)
    os.mkfifo(tmp_path / "b.part")  # whoever opens it waits for a reader
    for name in ("a", "b"):
        assert write_file(tmp_path / name, "new").is_file() and not (tmp_path / name).is_symlink()
        assert (tmp_path / name).read_text() == "new"
    assert kept.read_text() == "precious"


def test_a_file_where_a_folder_is_needed_is_named(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(WriteError, match=r"x.html: cannot be written: .*/file is a file where a folder is needed"):
        write_file(tmp_path / "file" / "sub" / "x.html", "")
    with pytest.raises(WriteError, match="Is a directory"):
        write_file(tmp_path, "")
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
    assert not tmp_path.with_name(tmp_path.name + ".part").exists()
