"""Values of options as people write them."""

from __future__ import annotations

from pathlib import Path

import click
import pytest

from replay.batch.shard import Shard
from replay.cli.values import Memory, PathName, Seconds, ShardOf, Workers


@pytest.mark.parametrize(
    ("kind", "text", "value"),
    [
        (Memory(), "1MB", 10**6),
        (Memory(), "2GB", 2 * 10**9),
        (Memory(), "1.5 MiB", 3 << 19),
        (Memory(), "3GiB", 3 << 30),
        (Seconds(), "90", 90.0),
        (Seconds(), "90s", 90.0),
        (Seconds(), "1.5 min", 90.0),
        (Seconds(), "2h", 7200.0),
        (Workers(), "1", 1),
        (Workers(), "007", 7),
        (Workers(), "999999", 999_999),
        (ShardOf(), "2/3", Shard(2, 3)),
        (PathName(), "a/b", Path("a/b")),
    ],
)
def test_what_is_meant_is_read(kind, text, value):
    found = kind.convert(text, None, None)
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize(
    ("kind", "texts", "rule"),
    [
        (
            Memory(),
            ["", "2", "GiB", "0GiB", "0.0MB", "-1GiB", "2TiB", "2 gib", ".5GiB"],
            "is no amount of memory; write",
        ),
        (Seconds(), ["", "s", "0", "0.0h", "-1", "1d", "1 S", ".5"], "is no time; write seconds"),
        (Workers(), ["", "0", "000", "-1", "1.5", "two", "10000000"], "is no number of processes; write 1 or more"),
        (ShardOf(), ["", "0/3", "4/3", "1", "1/0"], ""),
        (PathName(), [""], "the path is empty"),
    ],
)
def test_anything_else_is_told(kind, texts, rule):
    for text in texts:
        with pytest.raises(click.BadParameter) as caught:
            kind.convert(text, None, None)
        assert rule in caught.value.message and "\n" not in caught.value.message
