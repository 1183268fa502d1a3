"""Messages with joint states, as `replay`, Foxglove and ROS 2 write them, to a stamp and positions by name."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import mcap.records

from replay.errors import RecordingError
from replay.logs.mcap_records import Channel, Schema
from replay.logs.protobuf import message_type

Sample = tuple[int, list[tuple[str, float]]]
"""Stamp [ns], 0 for none, and the joints with a position."""
Decoder = Callable[[bytes], Sample]

_READ = "foxglove.JointStates (protobuf, json) and sensor_msgs/msg/JointState (cdr with a ros2msg schema, json)"
_NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
"""How protobuf's JSON writes them."""
_SECONDS = ("sec", "seconds", "secs")
_NANOSECONDS = ("nanosec", "nanos", "nsec", "nsecs")


def decoder(name: str, channel: Channel, schema: Schema | None) -> Decoder:
    """Return what turns the messages of a channel into samples, and raises RecordingError for what is none.

    Raises:
        RecordingError: the channel's messages are of another kind.
    """
    decode = _decode_of(name, channel, schema)

    def checked(message: bytes) -> Sample:
        try:
            return decode(message)
        except Exception as error:  # each format's library fails in ways of its own on bytes that are not its messages
            reason = str(error) or type(error).__name__
            raise RecordingError(
                name, f"topic {channel.topic!r} holds a message that is no joint state: {reason}"
            ) from None

    return checked


def _decode_of(name: str, channel: Channel, schema: Schema | None) -> Decoder:
    kind, encoding = schema.name if schema is not None else "", channel.encoding
    if encoding == "json":
        return _json
    if schema is not None and encoding == "protobuf" and kind == "foxglove.JointStates":
        type_ = message_type(name, schema.name, schema.data)
        return lambda data: _foxglove(type_.FromString(data))
    ros = kind in ("sensor_msgs/msg/JointState", "sensor_msgs/JointState")
    if schema is not None and encoding == "cdr" and ros and schema.encoding == "ros2msg":
        return _ros_decoder(mcap.records.Schema(channel.schema_id, schema.data, schema.encoding, schema.name))
    described = f" with a schema in {schema.encoding}" if schema is not None and schema.encoding else ""
    raise RecordingError(
        name,
        f"topic {channel.topic!r} holds {kind or 'messages without schema'} as {encoding or 'bytes'}{described};"
        f" read are {_READ}",
    )


def _ros_decoder(schema: mcap.records.Schema) -> Decoder:
    from mcap_ros2.decoder import DecoderFactory

    decode: Any = None

    def sample(data: bytes) -> Sample:
        nonlocal decode
        decode = decode or DecoderFactory().decoder_for("cdr", schema)
        return _ros(decode(data))

    return sample


def _foxglove(message: Any) -> Sample:
    stamp = message.timestamp.seconds * 1_000_000_000 + message.timestamp.nanos
    return stamp, [(joint.name, joint.position) for joint in message.joints if joint.HasField("position")]


def _ros(message: Any) -> Sample:
    stamp = message.header.stamp
    nanoseconds = stamp.nanosec if hasattr(stamp, "nanosec") else stamp.nanosecond
    return stamp.sec * 1_000_000_000 + nanoseconds, _pairs(message.name, [float(p) for p in message.position])


def _json(data: bytes) -> Sample:
    message = _object(json.loads(data), "it")
    if "joints" in message:
        joints = [_object(joint, "a joint") for joint in message["joints"]]
        stamp = message.get("timestamp")
        return _stamp(stamp), [(_text(j.get("name")), _number(j["position"])) for j in joints if "position" in j]
    if "name" not in message or "position" not in message:
        raise ValueError(f"it has neither joints nor name and position, but {', '.join(map(repr, message))}")
    header = _object(message.get("header") or {}, "its header")
    return _stamp(header.get("stamp")), _pairs(message["name"], [_number(value) for value in message["position"]])


def _pairs(names: Sequence[Any], positions: Sequence[float]) -> list[tuple[str, float]]:
    """Return the joints by name; none where a publisher gives names and no positions, as ROS allows."""
    if positions and len(names) != len(positions):
        raise ValueError(f"it names {len(names)} joints and gives {len(positions)} positions")
    return [(_text(name), position) for name, position in zip(names, positions, strict=False)]


def _stamp(value: Any) -> int:
    stamp = _object(value or {}, "its time stamp")
    unknown = [key for key in stamp if key not in _SECONDS + _NANOSECONDS]
    if unknown:
        raise ValueError(f"its time stamp has {', '.join(map(repr, unknown))} where 'sec' and 'nanosec' are read")
    seconds, nanoseconds = (
        next((_whole(stamp[key]) for key in keys if key in stamp), 0) for keys in (_SECONDS, _NANOSECONDS)
    )
    return seconds * 1_000_000_000 + nanoseconds


def _object(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ValueError(f"{what} is {json.dumps(value)[:60]}, no JSON object")
    return value


def _whole(value: Any) -> int:
    """Return a whole number; 64-bit ones are texts in protobuf's JSON."""
    if (
        isinstance(value, bool)
        or not isinstance(value, int | float | str)
        or (isinstance(value, float) and not value.is_integer())
    ):
        raise ValueError(f"its time stamp has {json.dumps(value)[:60]}, no whole number")
    return int(value)


def _number(value: Any) -> float:
    if isinstance(value, str) and value in _NOT_FINITE:
        return _NOT_FINITE[value]
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"a position is {json.dumps(value)[:60]}, no number")
    return float(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ValueError(f"the name of a joint is {json.dumps(value)[:60]}, no text")
    return value
