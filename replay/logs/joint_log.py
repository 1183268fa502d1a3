"""Joint positions over time from a log: MCAP as `replay`, Foxglove or ROS 2 write it, or CSV."""

from __future__ import annotations

import csv
import io
import itertools
import math
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.errors import RecordingError
from replay.logs.joint_messages import decoder
from replay.logs.mcap_reader import McapLog

DEFAULT_TOPIC = "/joint_states"

MAX_TIME = 1 << 62
"""Largest time [ns], before or after 0: 146 years, so that the difference of two fits in 64 bits."""


@dataclass(frozen=True, eq=False)
class JointTrack:
    """One joint of a log.

    Attributes:
        time: (n,) int64 [ns] as the log counts it, in the order of the log; channel by channel if there are several.
        position: (n,) in the log's unit.
        by_turns: whether several channels of the topic give samples of it at the same time: several publishers.
    """

    time: NDArray[np.int64]
    position: NDArray[np.float64]
    by_turns: bool = False


def read_mcap(name: str, data: bytes, *, topic: str = DEFAULT_TOPIC) -> dict[str, JointTrack]:
    """Return the joints of an MCAP log by name.

    Understood are `foxglove.JointStates` (protobuf or JSON) and `sensor_msgs/msg/JointState` (CDR or JSON). The time of
    a sample is its message's own stamp or, where no message of its channel has one (all are zero), the log time.

    Args:
        name: of the file, for messages.
        data: its bytes; every checksum it carries is verified.
        topic: where the joint states are.

    Raises:
        RecordingError: the file is not a whole MCAP file, has no such topic, or the topic is of another kind; or a
            time is beyond 146 years.
    """
    found: dict[str, dict[int, _Samples]] = {}
    stamped: set[int] = set()  # a simulated clock begins at zero: one such stamp is no missing one
    with McapLog(name, data=data) as log:
        decoders = {
            channel.id: decoder(name, channel, log.schemas.get(channel.schema_id))
            for channel in log.channels.values()
            if channel.topic == topic
        }
        for chunk in log.chunks if decoders else ():
            for run in log.runs(chunk):
                if run.channel not in decoders:
                    continue
                for time, message in zip(run.time.tolist(), run.messages(), strict=True):
                    stamp, joints = decoders[run.channel](message)
                    if stamp:
                        stamped.add(run.channel)
                    for joint, position in joints:
                        channels = found.setdefault(joint, {})
                        channels.setdefault(run.channel, _Samples()).add(stamp, time, position)
        topics = sorted({channel.topic for channel in log.channels.values()})
    if topic not in topics:
        raise RecordingError(name, f"has no topic {topic!r}; its topics are {topics}")
    if not found:
        raise RecordingError(name, f"has no message with positions of joints on topic {topic!r}")
    return {
        joint: _joined(samples.track(name, channel in stamped) for channel, samples in channels.items())
        for joint, channels in sorted(found.items())
    }


def _times(name: str, times: list[int]) -> NDArray[np.int64]:
    for time in times:
        if not -MAX_TIME <= time <= MAX_TIME:
            raise RecordingError(name, f"has a sample at {time / 1e9:.6g} s; times are read up to 146 years from 0")
    return np.array(times, dtype=np.int64)


class _Samples:
    """The samples of one joint from one channel, in the order of the log."""

    def __init__(self) -> None:
        self._stamps: list[int] = []
        self._times: list[int] = []
        self._positions: list[float] = []

    def add(self, stamp: int, time: int, position: float) -> None:
        """Take the next one: stamp [ns], log time [ns] and position."""
        self._stamps.append(stamp)
        self._times.append(time)
        self._positions.append(position)

    def track(self, name: str, stamped: bool) -> JointTrack:
        """Return the samples of log `name` at their stamps, or at their log times."""
        return JointTrack(_times(name, self._stamps if stamped else self._times), np.array(self._positions))


def _joined(tracks: Iterable[JointTrack]) -> JointTrack:
    """Return what several channels say of one joint, one channel after the other."""
    parts = sorted(tracks, key=lambda track: int(track.time.min()))
    by_turns = any(later.time.min() <= earlier.time.max() for earlier, later in itertools.pairwise(parts))
    return JointTrack(
        np.concatenate([part.time for part in parts]), np.concatenate([part.position for part in parts]), by_turns
    )


def read_csv(
    name: str, data: bytes, *, time_column: str, nanoseconds: float, needed: Collection[str]
) -> dict[str, JointTrack]:
    """Return the columns of a CSV log by their headings.

    Args:
        name: of the file, for messages.
        data: its bytes: UTF-8, comma separated, headings in the first line; an empty cell is no sample.
        time_column: heading of the column with the times.
        nanoseconds: that one unit of this column is [ns].
        needed: headings of columns that must hold numbers; any other one that holds something else is passed over.

    Raises:
        RecordingError: the file is empty or not UTF-8, there is no such column, a line has another number of cells, or
            a cell is no finite number, or a time beyond 146 years.
    """
    try:
        rows = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True)
        headings = [heading.strip() for heading in next(rows, [])]
        if not headings:
            raise RecordingError(name, "has no headings in its first line, such as time,joint")
        if time_column not in headings:
            raise RecordingError(name, f"has no column {time_column!r}; its columns are {headings}")
        if len(set(headings)) != len(headings):
            raise RecordingError(name, f"has a heading twice; its columns are {headings}")
        tracks: dict[str, tuple[list[int], list[float]]] = {k: ([], []) for k in headings if k != time_column}
        for line, cells in _lines(rows):
            if len(cells) != len(headings):
                raise RecordingError(name, f"line {line} has {len(cells)} cells, its headings are {len(headings)}")
            values = {heading: cell.strip() for heading, cell in zip(headings, cells, strict=True)}
            time = _nanoseconds(name, line, time_column, values[time_column], nanoseconds)
            for heading, (times, positions) in list(tracks.items()):
                if not values[heading]:
                    continue
                try:
                    positions.append(_number(name, line, heading, values[heading]))
                    times.append(time)
                except RecordingError:
                    if heading in needed:
                        raise
                    del tracks[heading]
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RecordingError(
            name, f"line {line}: byte 0x{data[error.start]:02x} is not UTF-8; save it as UTF-8"
        ) from None
    except csv.Error as error:
        raise RecordingError(name, f"cannot be read as CSV: {error}") from None
    return {
        heading: JointTrack(np.array(times, dtype=np.int64), np.array(positions))
        for heading, (times, positions) in tracks.items()
        if positions
    }


def _lines(rows: Any) -> Iterator[tuple[int, list[str]]]:
    for cells in rows:
        if cells:
            yield rows.line_num, cells


def _nanoseconds(name: str, line: int, heading: str, cell: str, unit: float) -> int:
    exact = _number(name, line, heading, cell) * unit
    if not abs(exact) <= MAX_TIME:
        raise RecordingError(name, f"line {line}, column {heading!r}: {cell} is beyond 146 years")
    return round(exact)


def _number(name: str, line: int, heading: str, cell: str) -> float:
    try:
        value = math.nan if "_" in cell else float(cell)  # 1_000 is a number to Python only
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RecordingError(name, f"line {line}, column {heading!r}: {cell!r} is not a finite number")
    return value
