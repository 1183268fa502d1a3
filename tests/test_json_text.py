"""JSON of files that nobody vouches for: within bounds, as values of the types asked for, or one line why not."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from replay import limits
from replay.json_text import read_json, read_json_file, typed
from replay.lfs_pointer import is_lfs_pointer


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"[" * 100_000, "nested too deeply"),
        (b'{"a": ' + b"1" * 5_000 + b"}", "too long"),
        (b'["\\ud800"]', "surrogate"),
        (b"[" + b"[]," * 1_100_000 + b"1]", "at most 1000000 are read"),
        (b"\xff", "UTF-8"),
        (b"{", "line 1, column 2"),
    ],
)
def test_json_is_read_within_bounds_or_is_one_line(data, words) -> None:
    with pytest.raises(ValueError, match=words) as caught:
        read_json(data)
    assert "\n" not in str(caught.value)


def test_values_of_json_are_of_the_types_that_are_asked_for() -> None:
    assert typed({"a": [1]}, dict[str, list[int]]) == {"a": [1]}
    for value, place in (({"a": [True]}, "a.0"), ({"a": 1}, "a"), ([], "Input")):
        with pytest.raises(ValueError, match=place):
            typed(value, dict[str, list[int]])


def test_a_text_may_be_as_long_as_is_said_and_no_longer() -> None:
    assert read_json(b"[1]", most=3) == read_json("[1]", most=3) == [1]
    for text in (b"[1]", "[1]"):
        with pytest.raises(ValueError, match="has 3 bytes; at most 2 are read"):
            read_json(text, most=2)


def test_halves_of_pairs_are_read_where_they_may_be() -> None:
    """Names of files that are no text hold them; whole pairs are one character."""
    assert read_json(b'["\\ud800"]', surrogates=True) == ["\ud800"]
    assert read_json(b'["\\ud83d\\ude00"]') == ["\U0001f600"]


def test_a_file_is_read_if_it_is_one_and_no_larger_than_is_read(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "run.json"
    for made in (lambda: None, path.mkdir):
        made()
        with pytest.raises(FileNotFoundError):
            read_json_file(path)
    path.rmdir()
    os.mkfifo(path)
    with pytest.raises(FileNotFoundError):
        read_json_file(path)
    path.unlink()
    path.write_bytes(b'{"a": 1}')
    assert read_json_file(path) == {"a": 1}
    monkeypatch.setattr(limits, "RECORD_JSON", 7)
    with pytest.raises(ValueError, match="more than 7 bytes"):
        read_json_file(path)


@pytest.mark.parametrize(
    ("data", "is_one"),
    [
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 9\n", True),
        (b"version https://hawser.github.com/spec/v1\noid sha256:0\n", True),
        (b"version https://git-lfs.github.com/spec/v1\n", False),
        (b"version https://git-lfs.github.com/spec/v1\n" + b" " * 976 + b"\noid ", True),  # its last four bytes
        (b"version https://git-lfs.github.com/spec/v1\n" + b" " * 977 + b"\noid ", False),
        (b"version 2\n", False),
        (b"solid version https://git-lfs.github.com/spec/v1", False),
        (b"", False),
    ],
)
def test_a_pointer_of_git_lfs_is_told_by_how_it_begins(data: bytes, is_one: bool) -> None:
    assert is_lfs_pointer(data) is is_one
