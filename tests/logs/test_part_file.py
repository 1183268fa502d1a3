"""Files that appear whole: also where several write one at once, where it is taken away, and beside left-over ones."""

import os
import subprocess
import sys
import threading

import pytest

from replay.errors import RecordingExistsError, WriteError
from replay.logs.part_file import PartFile, append_lines, write_file


def names(folder):
    return sorted(file.name for file in folder.iterdir())


def test_two_that_write_one_file_each_write_a_file_of_their_own(tmp_path):
    path = tmp_path / "log.mcap"
    first, second = PartFile(path, overwrite=True), PartFile(path, overwrite=True)
    assert first.part.name == "log.mcap.part"
    assert second.part.name.endswith(".mcap.part") and second.part != first.part
    for file, data in ((first, b"1" * 100_000), (second, b"2" * 100_000)):
        file.write(data)
        file.flush()
    first.commit()
    assert path.read_bytes() == b"1" * 100_000
    second.commit()
    assert path.read_bytes() == b"2" * 100_000
    assert names(tmp_path) == ["log.mcap"]


def test_one_that_gives_up_takes_nothing_from_the_other(tmp_path):
    path = tmp_path / "x"
    first, second = PartFile(path, overwrite=True), PartFile(path, overwrite=True)
    first.write(b"1")
    first.discard()
    second.write(b"2")
    third = PartFile(path, overwrite=True)
    second.commit()
    third.discard()
    assert path.read_bytes() == b"2"
    assert names(tmp_path) == ["x"]


def test_what_stands_in_the_place_of_the_unfinished_file_is_never_taken_for_it(tmp_path):
    path = tmp_path / "x"
    file = PartFile(path, overwrite=True)
    file.write(b"ours")
    file.part.unlink()
    file.part.write_bytes(b"another's")
    with pytest.raises(WriteError, match=r"x.part was removed or replaced"):
        file.commit()
    file.discard()
    assert not path.exists()
    assert (tmp_path / "x.part").read_bytes() == b"another's"
    gone = PartFile(tmp_path / "y", overwrite=True)
    gone.part.unlink()
    with pytest.raises(WriteError, match="removed or replaced"):
        gone.commit()
    gone.discard()


def test_what_a_killed_process_left_is_replaced_and_links_are_not_followed(tmp_path):
    (tmp_path / "x.part").write_bytes(b"left over")
    file = PartFile(tmp_path / "x", overwrite=True)
    assert file.part == tmp_path / "x.part"
    file.write(b"new")
    file.commit()
    (tmp_path / "precious").write_text("text")
    (tmp_path / "y.part").symlink_to(tmp_path / "precious")
    write_file(tmp_path / "y", b"new")
    assert (tmp_path / "precious").read_text() == "text"
    assert names(tmp_path) == ["precious", "x", "y"]


def test_a_file_that_may_not_be_replaced_is_not_either_when_it_came_meanwhile(tmp_path):
    first, second = (PartFile(tmp_path / "x", overwrite=False) for _ in range(2))
    first.write(b"1")
    first.commit()
    with pytest.raises(RecordingExistsError):
        second.commit()
    second.discard()
    assert (tmp_path / "x").read_bytes() == b"1"


WRITE = """
import sys
from pathlib import Path
from replay.logs.part_file import append_lines, write_file
for k in range(60):
    write_file(Path(sys.argv[1]) / "whole", sys.argv[2] * 5000)
    append_lines(Path(sys.argv[1]) / "lines", [sys.argv[2] * 3000])
"""


def test_processes_that_write_and_append_at_once_leave_whole_files(tmp_path):
    processes = [subprocess.Popen([sys.executable, "-c", WRITE, tmp_path, letter]) for letter in "abc"]
    ended = threading.Event()

    def look():
        while not ended.is_set():
            if (tmp_path / "whole").exists():
                text = (tmp_path / "whole").read_text()
                assert text == text[0] * 5000

    reader = threading.Thread(target=look)
    reader.start()
    assert [process.wait() for process in processes] == [0, 0, 0]
    ended.set()
    reader.join()
    lines = (tmp_path / "lines").read_text().splitlines()
    assert sorted(lines) == [letter * 3000 for letter in "abc" for _ in range(60)]
    assert names(tmp_path) == ["lines", "whole"]
    append_lines(tmp_path / "lines", [])


def test_what_need_not_last_waits_for_no_disk(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", synced.append)
    assert write_file(tmp_path / "a", "x", lasting=False).read_text() == "x"
    assert synced == []
    write_file(tmp_path / "a", "y")
    assert len(synced) == 2  # the file and its folder
