"""Joint positions over time from a log: MCAP as `replay`, Foxglove or ROS 2 write it, or CSV."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass
from typing import Any

import mcap.records
import numpy as np
from numpy.typing import NDArray

from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import Channel, Schema
from replay.logs.protobuf import message_type

DEFAULT_TOPIC = "/joint_states"

MAX_TIME = 1 << 62
"""Largest time [ns], before or after 0: 146 years, so that the difference of two fits in 64 bits."""


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
        RecordingError: the file is not a whole MCAP file, has no such topic, or the topic is of another kind; or a
            time is beyond 146 years.
    """
    found: dict[str, tuple[list[int], list[float]]] = {}
    with McapLog(name, data=data) as log:
        decoders = {
            channel.id: _decoder(name, channel, log.schemas.get(channel.schema_id))
            for channel in log.channels.values()
            if channel.topic == topic
        }
        for chunk in log.chunks if decoders else ():
            for run in log.runs(chunk):
                if run.channel not in decoders:
                    continue
                for time, message in zip(run.time.tolist(), run.messages(), strict=True):
                    stamp, joints = _decode(name, topic, decoders[run.channel], message)
                    for joint, position in joints:
                        times, positions = found.setdefault(joint, ([], []))
                        times.append(stamp or time)
                        positions.append(position)
        topics = sorted({channel.topic for channel in log.channels.values()})
    if not found:
        raise RecordingError(name, f"has no joint states on topic {topic!r}; its topics are {topics}")
    return {joint: JointTrack(_times(name, t), np.array(p)) for joint, (t, p) in sorted(found.items())}


def _times(name: str, times: list[int]) -> NDArray[np.int64]:
    for time in times:
        if not -MAX_TIME <= time <= MAX_TIME:
            raise RecordingError(name, f"has a sample at {time / 1e9:.6g} s; times are read up to 146 years from 0")
    return np.array(times, dtype=np.int64)


Sample = tuple[int, list[tuple[str, float]]]
"""Stamp [ns], 0 for none, and the joints with a position."""
Decoder = Callable[[bytes], Sample]


def _decoder(name: str, channel: Channel, schema: Schema | None) -> Decoder:
    """Return what turns the messages of a channel into samples."""
    kind, encoding = schema.name if schema is not None else "", channel.encoding
    if encoding == "json":
        return _json
    if schema is not None and encoding == "protobuf" and kind == "foxglove.JointStates":
        type_ = message_type(name, schema.name, schema.data)
        return lambda data: _foxglove(type_.FromString(data))
    if schema is not None and encoding == "cdr" and kind in ("sensor_msgs/msg/JointState", "sensor_msgs/JointState"):
        return _ros_decoder(mcap.records.Schema(channel.schema_id, schema.data, schema.encoding, schema.name))
    raise RecordingError(
        name,
        f"topic {channel.topic!r} holds {kind or 'messages without schema'} as {encoding or 'bytes'}; read are"
        " foxglove.JointStates (protobuf, json) and sensor_msgs/msg/JointState (cdr, json)",
    )


def _ros_decoder(schema: mcap.records.Schema) -> Decoder:
    from mcap_ros2.decoder import DecoderFactory

    decode: Any = None

    def sample(data: bytes) -> Sample:
        nonlocal decode
        decode = decode or DecoderFactory().decoder_for("cdr", schema)
        return _ros(decode(data))

    return sample


def _decode(name: str, topic: str, decoder: Decoder, message: bytes) -> Sample:
    try:
        return decoder(message)
    except Exception as error:  # each format's library fails in ways of its own on bytes that are not its messages
        reason = f"topic {topic!r} holds a message that is no joint state: {str(error) or type(error).__name__}"
        raise RecordingError(name, reason) from None


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
