"""Joint positions over time from a log: MCAP as `replay`, Foxglove or ROS 2 write it, or CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from replay.errors import RecordingError

DEFAULT_TOPIC = "/joint_states"


@dataclass(frozen=True, eq=False)
class JointTrack:
    """One joint of a log.

    Attributes:
        time: (n,) int64 [ns] as the log counts it, in the order of the log.
        position: (n,) in the log's unit.
    """

    time: NDArray[np.int64]
    position: NDArray[np.float64]


def read_mcap(name: str, data: bytes, *, topic: str = DEFAULT_TOPIC) -> dict[str, JointTrack]:
    """Return the joints of an MCAP log by name.

    Understood are `foxglove.JointStates` (protobuf or JSON) and `sensor_msgs/msg/JointState` (CDR or JSON). The time of
    a sample is its message's own stamp or, where that is zero, the log time.

    Args:
        name: of the file, for messages.
        data: its bytes; every checksum it carries is verified.
        topic: where the joint states are.

    Raises:
        RecordingError: the file is not a whole MCAP file, has no such topic, or the topic is of another kind.
    """
    from mcap.exceptions import McapError
    from mcap.reader import make_reader

    found: dict[str, tuple[list[int], list[float]]] = {}
    topics: set[str] = set()
    try:
        reader = make_reader(io.BytesIO(data), validate_crcs=True)
        summary = reader.get_summary()
        topics = {channel.topic for channel in summary.channels.values()} if summary else set()
        decode: dict[int, Any] = {}
        for schema, channel, message in reader.iter_messages(topics=[topic], log_time_order=False):
            topics.add(channel.topic)
            if channel.id not in decode:
                decode[channel.id] = _decoder(name, topic, schema, channel.message_encoding)
            stamp, joints = decode[channel.id](message.data)
            time = stamp or message.log_time
            for joint, position in joints:
                times, positions = found.setdefault(joint, ([], []))
                times.append(time)
                positions.append(position)
    except (McapError, ValueError, KeyError, TypeError, EOFError, AttributeError, IndexError, OverflowError) as error:
        raise RecordingError(name, f"cannot be read as a log of joint states: {error or type(error).__name__}") from None
    if not found:
        raise RecordingError(name, f"has no joint states on topic {topic!r}; its topics are {sorted(topics)}")
    return {joint: JointTrack(np.array(t, dtype=np.int64), np.array(p)) for joint, (t, p) in sorted(found.items())}


Sample = tuple[int, list[tuple[str, float]]]
"""Stamp [ns], 0 for none, and the joints with a position."""


def _decoder(name: str, topic: str, schema: Any, encoding: str) -> Any:
    """Return what turns a message's bytes into a `Sample`."""
    kind = schema.name if schema is not None else ""
    if encoding == "json":
        return _json
    if encoding == "protobuf" and kind == "foxglove.JointStates":
        from replay.logs.protobuf import message_type

        type_ = message_type(name, schema.name, schema.data)
        return lambda data: _foxglove(type_.FromString(data))
    if encoding == "cdr" and kind in ("sensor_msgs/msg/JointState", "sensor_msgs/JointState"):
        from mcap_ros2.decoder import DecoderFactory

        factory = DecoderFactory().decoder_for(encoding, schema)
        if factory is not None:
            return lambda data: _ros(factory(data))
    raise RecordingError(
        name,
        f"topic {topic!r} holds {kind or 'messages without schema'} as {encoding or 'bytes'}; read are"
        " foxglove.JointStates (protobuf, json) and sensor_msgs/msg/JointState (cdr, json)",
    )


def _foxglove(message: Any) -> Sample:
    stamp = message.timestamp.seconds * 1_000_000_000 + message.timestamp.nanos
    return stamp, [(joint.name, joint.position) for joint in message.joints if joint.HasField("position")]


def _ros(message: Any) -> Sample:
    stamp = message.header.stamp
    nanoseconds = stamp.nanosec if hasattr(stamp, "nanosec") else stamp.nanosecond
    positions = [float(position) for position in message.position]
    return stamp.sec * 1_000_000_000 + nanoseconds, list(zip(message.name, positions, strict=bool(positions)))


def _json(data: bytes) -> Sample:
    message = json.loads(data)
    if "joints" in message:
        stamp = message.get("timestamp") or {}
        joints = [(joint["name"], float(joint["position"])) for joint in message["joints"] if "position" in joint]
    else:
        stamp = (message.get("header") or {}).get("stamp") or {}
        joints = list(zip(message["name"], map(float, message["position"]), strict=bool(message["position"])))
    fraction = next((stamp[key] for key in ("nsec", "nanosec", "nanos") if key in stamp), 0)
    return int(stamp.get("sec", stamp.get("seconds", 0))) * 1_000_000_000 + int(fraction), joints


def read_csv(name: str, data: bytes, *, time_column: str, nanoseconds: float) -> dict[str, JointTrack]:
    """Return the columns of a CSV log by their headings.

    Args:
        name: of the file, for messages.
        data: its bytes: UTF-8, comma separated, headings in the first line; an empty cell is no sample.
        time_column: heading of the column with the times.
        nanoseconds: that one unit of this column is [ns].

    Raises:
        RecordingError: there is no such column, or a line has another number of cells, or a cell is not a finite number.
    """
    try:
        rows = csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True)
        headings = [heading.strip() for heading in next(rows, [])]
        if time_column not in headings:
            raise RecordingError(name, f"has no column {time_column!r}; its columns are {headings}")
        if len(set(headings)) != len(headings):
            raise RecordingError(name, f"has a heading twice; its columns are {headings}")
        tracks: Mapping[str, tuple[list[int], list[float]]] = {heading: ([], []) for heading in headings}
        for line, cells in _lines(rows):
            if len(cells) != len(headings):
                raise RecordingError(name, f"line {line} has {len(cells)} cells, its headings are {len(headings)}")
            values = {heading: cell.strip() for heading, cell in zip(headings, cells, strict=True)}
            time = round(_number(name, line, time_column, values[time_column]) * nanoseconds)
            for heading, (times, positions) in tracks.items():
                if heading != time_column and values[heading]:
                    times.append(time)
                    positions.append(_number(name, line, heading, values[heading]))
    except (UnicodeDecodeError, csv.Error) as error:
        raise RecordingError(name, f"cannot be read as CSV: {error}") from None
    return {
        heading: JointTrack(np.array(times, dtype=np.int64), np.array(positions))
        for heading, (times, positions) in tracks.items()
        if heading != time_column and positions
    }


def _lines(rows: Any) -> Iterator[tuple[int, list[str]]]:
    for cells in rows:
        if cells:
            yield rows.line_num, cells


def _number(name: str, line: int, heading: str, cell: str) -> float:
    try:
        value = float(cell)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise RecordingError(name, f"line {line}, column {heading!r}: {cell!r} is not a finite number")
    return value
