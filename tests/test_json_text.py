"""JSON of files that nobody vouches for: within bounds, as values of the types asked for, or one line why not."""

from __future__ import annotations

import json
import math
import os
import random
import struct
from decimal import Context, Decimal
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


ODD = (
    [b"NaN", b"-NaN", b"nan", b"Infinity", b"-Infinity", b"inf", b"-0", b"-0.0", b"1e999", b"-1e999", b"1e-999", b"01"]
    + [b"1.", b".5", b"1e", b"+1", b"0x1", b"1_0", b"5e-324", b"2.2250738585072011e-308", b"1.7976931348623159e308"]
    + [b"9007199254740993", b"9007199254740993.0", b"18446744073709551616", b"-9223372036854775809", b"9" * 4300]
    + [b"9" * 4301, b"9" * 5000 + b".5", b"0." + b"1" * 5000, b"1e" + b"0" * 5000 + b"5", b'{"a": 1, "b": 2, "a": []}']
    + [
        b'"\\ud800"',
        b'"\\udc00"',
        b'"\\ud83d\\u0041"',
        b'"\\ud83d\\ude00"',
        b'"\xed\xa0\x80"',
        b'"\xff"',
        b'"\xc0\x80"',
    ]
    + [
        b'"\t"',
        b'"\x7f"',
        b'"\\u0000"',
        b'"\\x41"',
        b'"\\/"',
        b"\xef\xbb\xbf1",
        b"\x0c1",
        b"1\x00",
        b"1 2",
        b"",
        b"[1,]",
    ]
    + [b"[,1]", b"{1:2}", b"'a'", b"1//", b"tru", b"[" * 150 + b"]" * 150, b"[" * 700 + b"]" * 700]
    + ["[1]".encode(code) for code in ("utf-16", "utf-16-le", "utf-32")]
)


def _numbers(count: int) -> list[bytes]:
    """Return numbers as texts: of any size and length, and half-way between two neighbours or nearly."""
    rng, exact = random.Random(1), Context(prec=1200)
    made = []
    for _ in range(count):
        digits = "".join(rng.choice("0123456789") for _ in range(rng.randint(1, 30)))
        made.append(f"{rng.randrange(10 ** rng.randint(1, 25))}.{digits}e{rng.randint(-330, 330)}")
        x = abs(struct.unpack("<d", rng.randbytes(8))[0])
        if 1e-300 < x < 1e300:
            between = exact.divide(exact.add(Decimal(x), Decimal(math.nextafter(x, math.inf))), Decimal(2))
            made += [f"{between:e}", f"{exact.next_minus(between):e}", f"{exact.next_plus(between):e}"]
        made.append(str(rng.randrange(10 ** rng.randint(1, 40))))
    return [text.encode() for text in made]


def test_json_is_what_pythons_own_reader_says_it_is() -> None:
    """To the last bit of each number and in the order of keys; what the one refuses the other does."""
    for text in [*ODD, *(b"[%s]" % odd for odd in ODD), *(b'{"k": %s}' % odd for odd in ODD), *_numbers(1000)]:
        try:
            expected = repr(json.loads(text))
        except (ValueError, RecursionError):
            with pytest.raises(ValueError, match=r"is no JSON|not UTF-8|too long|nested too deeply"):
                read_json(text)
        else:
            assert repr(read_json(text, surrogates=True)) == expected, text


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
