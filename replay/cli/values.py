"""Values of options as people write them: amounts of memory, times, shards, numbers of processes."""

from __future__ import annotations

import errno
import math
import re
from pathlib import Path
from typing import Any

import click

_MEMORY_UNITS = {"MB": 10**6, "GB": 10**9, "MiB": 2**20, "GiB": 2**30}
_TIME_UNITS = {"": 1.0, "s": 1.0, "min": 60.0, "h": 3600.0}


class PathName(click.Path):
    """A path; an empty one, as a variable of the shell that is not set makes it, is refused.

    So is one that cannot be asked for: its name is too long, it leads through links that go in a circle, or through a
    folder that may not be looked into.
    """

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path."""
        if str(value) == "":
            self.fail("the path is empty")
        try:
            Path(value).stat()
        except OSError as error:
            if error.errno not in (errno.ENOENT, errno.ENOTDIR):
                self.fail(f"{str(value)[:200]!r} leads nowhere: {error.strerror}")
        return super().convert(value, param, ctx)


class Workers(click.ParamType[int]):
    """A number of processes."""

    name = "N"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number."""
        if re.fullmatch("0*[1-9][0-9]{0,5}", str(value)) is None:
            self.fail(f"{value!r} is no number of processes; write 1 or more")
        return int(value)


class Memory(click.ParamType[int]):
    """An amount of memory with its unit, as bytes."""

    name = "SIZE"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return bytes."""
        found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*([A-Za-z]+)", str(value))
        if found is None or found[2] not in _MEMORY_UNITS or float(found[1]) == 0.0:
            self.fail(f"{value!r} is no amount of memory; write one such as 2GiB ({', '.join(_MEMORY_UNITS)})")
        return int(float(found[1]) * _MEMORY_UNITS[found[2]])


class Seconds(click.ParamType[float]):
    """A time, as seconds."""

    name = "TIME"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return seconds."""
        found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)\s*([a-z]*)", str(value))
        if found is None or found[2] not in _TIME_UNITS or float(found[1]) == 0.0:
            self.fail(f"{value!r} is no time; write seconds, or one such as 90s, 10min, 1h")
        return float(found[1]) * _TIME_UNITS[found[2]]


class ShardOf(click.ParamType[Any]):
    """One of several parts of the scenarios."""

    name = "i/n"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the shard."""
        from replay.batch.shard import Shard
        from replay.errors import InvalidValue

        try:
            return Shard.parse(str(value))
        except InvalidValue as error:
            self.fail(str(error))


class RrdOf(click.ParamType[Any]):
    """`failing`, `failing:20`, `all` or `none`."""

    name = "rrd"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return it as `batch.regress.Rrd`."""
        from replay.batch.regress import Rrd

        found = re.fullmatch(r"(failing|all|none)|failing:([1-9][0-9]{0,8})", value) if isinstance(value, str) else None
        if isinstance(value, str) and found is None:
            self.fail(f"{value!r} is none of failing, failing:N, all, none", param, ctx)
        if found is None:
            return value
        kind: Any = found[1] or "failing"
        return Rrd(kind, int(found[2])) if found[2] else Rrd(kind)


class Size(click.ParamType[Any]):
    """A width and a height."""

    name = "WxH"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return both."""
        if not isinstance(value, str):
            return value
        found = re.fullmatch(r"([1-9][0-9]{1,3})x([1-9][0-9]{1,3})", value)
        if found is None or not all(_SMALLEST <= int(length) <= _LARGEST for length in found.groups()):
            self.fail(f"{value!r} is no size; write one such as 1280x800, {_SMALLEST} to {_LARGEST} each")
        return int(found[1]), int(found[2])


class CameraAt(click.ParamType[Any]):
    """Where a camera stands and, if it is said, where it looks to."""

    name = "X,Y,Z[,TX,TY,TZ]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return both as triples [m], None for a target that is not said."""
        try:
            numbers = tuple(float(number) for number in str(value).split(","))
        except ValueError:
            numbers = ()
        if len(numbers) not in (3, 6) or not all(math.isfinite(number) for number in numbers):
            self.fail(f"{value!r} is no place; write X,Y,Z or X,Y,Z,TX,TY,TZ in metres, such as 3,-2,1.5")
        if numbers[:3] == numbers[3:]:
            self.fail("a camera cannot look to where it stands")
        return numbers[:3], numbers[3:] or None


_SMALLEST, _LARGEST = 100, 4000
"""Points of a picture's width and height."""
