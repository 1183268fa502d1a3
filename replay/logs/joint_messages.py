"""Messages with joint states or transforms, as `replay`, Foxglove and ROS write them, to samples by name."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from replay import limits
from replay.errors import RecordingError
from replay.json_text import read_json
from replay.logs.mcap_records import Channel, Schema
from replay.logs.protobuf import message_type
from replay.logs.ros_messages import ros_decoder
from replay.logs.ros_schema import long_name
from replay.logs.times import date_nanoseconds

Pose = tuple[float, ...]
"""x, y, z [m] and a quaternion x, y, z, w."""


@dataclass(frozen=True)
class Sample:
    """What a message says of one time.

    Attributes:
        stamp: [ns], 0 for none.
        frame_id: of its header; of a transform the frame that the pose is in; "" for none.
        names: joints, or the child frame.
        values: their positions, or its pose.
    """

    stamp: int
    frame_id: str
    names: tuple[str, ...]
    values: Sequence[float] | Sequence[Pose]

    @property
    def is_pose(self) -> bool:
        """Whether it tells a frame's pose, not joints' positions."""
        return bool(self.values) and isinstance(self.values[0], tuple)

    @property
    def positions(self) -> list[tuple[str, float]]:
        """The joints with their positions; none of a pose."""
        pairs = zip(self.names, self.values, strict=True)
        return [(name, value) for name, value in pairs if isinstance(value, float)]


Decoder = Callable[[bytes], list[Sample]]

JOINTS = ("foxglove.JointStates", "sensor_msgs/msg/JointState")
TRANSFORMS = (
    "foxglove.FrameTransforms",
    "foxglove.FrameTransform",
    "tf2_msgs/msg/TFMessage",
    "geometry_msgs/msg/TransformStamped",
)
_READ = "foxglove.JointStates and FrameTransforms (protobuf, json), sensor_msgs JointState and tf2_msgs TFMessage"
_ENCODINGS = "cdr with a definition in ros2msg or ros2idl, ros1 with ros1msg, json"
_LONG = {"tf/msg/tfMessage": "tf2_msgs/msg/TFMessage"}
_NOT_FINITE = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
"""How protobuf's JSON writes them."""
_SECONDS = ("sec", "seconds", "secs")
_NANOSECONDS = ("nanosec", "nanos", "nsec", "nsecs")


def kind_of(schema: Schema | None) -> str:
    """Return the type of a channel's messages, ROS ones in ROS 2's form; "" without a schema."""
    if schema is None or "/" not in schema.name.replace("::", "/"):
        return "" if schema is None else schema.name
    name = long_name(schema.name)
    return _LONG.get(name, name)


def decoder(name: str, channel: Channel, schema: Schema | None) -> Decoder:
    """Return what turns the messages of a channel into samples, and raises RecordingError for what is none.

    Args:
        name: of the file, for messages.
        channel: whose messages are to be decoded.
        schema: its schema.

    Raises:
        RecordingError: the channel's messages are of another kind, or their definition cannot be read.
    """
    decode = _decode_of(name, channel, schema)

    def checked(message: bytes) -> list[Sample]:
        try:
            if len(message) > limits.MESSAGE:
                raise ValueError(f"it has {len(message)} bytes; at most {limits.MESSAGE} are taken apart")
            return decode(message)
        except Exception as error:  # each format's library fails in ways of its own on bytes that are not its messages
            reason = str(error).partition("\n")[0] or type(error).__name__
            raise RecordingError(
                name, f"topic {channel.topic!r} holds a message that is no joint state or transform: {reason}"
            ) from None

    return checked


def _decode_of(name: str, channel: Channel, schema: Schema | None) -> Decoder:
    kind, encoding = kind_of(schema), channel.encoding
    if encoding == "json":
        whole = {"foxglove.JointStates": "joints", "foxglove.FrameTransforms": "transforms"}.get(kind, "")
        return lambda data: _json(data, whole)
    if schema is not None and encoding == "protobuf" and kind.startswith("foxglove.") and kind in JOINTS + TRANSFORMS:
        type_ = message_type(name, schema.name, schema.data)
        return lambda data: _protobuf(type_.FromString(data))
    decode = ros_decoder(name, channel, schema) if "/" in kind and kind in JOINTS + TRANSFORMS else None
    if decode is not None:
        return _of_ros(decode, kind)
    text = schema.encoding if schema is not None else ""
    described = f" with a schema in {text}" if text else ""
    raise RecordingError(
        name,
        f"topic {channel.topic!r} holds {kind or 'messages without schema'} as {encoding or 'bytes'}{described};"
        f" read are {_READ} ({_ENCODINGS})",
    )


def _of_ros(decode: Callable[[bytes], dict[str, Any]], kind: str) -> Decoder:
    if kind == "sensor_msgs/msg/JointState":
        return lambda data: [_joint_state(decode(data))]
    if kind == "geometry_msgs/msg/TransformStamped":
        return lambda data: [_transform_stamped(decode(data))]
    return lambda data: [_transform_stamped(item) for item in decode(data)["transforms"]]


def _protobuf(message: Any) -> list[Sample]:
    if hasattr(message, "joints"):
        stamp = message.timestamp.seconds * 1_000_000_000 + message.timestamp.nanos
        told = [joint for joint in message.joints if joint.HasField("position")]
        return [Sample(stamp, "", tuple(joint.name for joint in told), [joint.position for joint in told])]
    return [
        Sample(
            item.timestamp.seconds * 1_000_000_000 + item.timestamp.nanos,
            item.parent_frame_id,
            (item.child_frame_id,),
            [_pose(item.translation, item.rotation)],
        )
        for item in (message.transforms if hasattr(message, "transforms") else [message])
    ]


def _pose(translation: Any, rotation: Any) -> Pose:
    t, q = translation, rotation
    return t.x, t.y, t.z, q.x, q.y, q.z, q.w


def _joint_state(message: Mapping[str, Any]) -> Sample:
    header = message["header"]
    return Sample(_header_stamp(header), header["frame_id"], *_told(message["name"], message["position"]))


def _header_stamp(header: Mapping[str, Any]) -> int:
    stamp = header["stamp"]
    seconds, nanoseconds = stamp.values()  # ROS 2 has called the second one nanosec and nanosecond
    return int(seconds) * 1_000_000_000 + int(nanoseconds)


def _transform_stamped(message: Mapping[str, Any]) -> Sample:
    header, transform = message["header"], message["transform"]
    pose = _numbers(transform["translation"], "xyz") + _numbers(transform["rotation"], "xyzw")
    return Sample(_header_stamp(header), header["frame_id"], (message["child_frame_id"],), [pose])


def _json(data: bytes, whole: str) -> list[Sample]:
    """Return the samples of a message; `whole` is the list that its type has, which may be left out when empty."""
    message = _object(read_json(data, most=limits.MESSAGE), "it")
    message = {whole: [], **message} if whole else message
    if "transforms" in message:
        return [_json_transform(_object(item, "a transform")) for item in message["transforms"]]
    if "child_frame_id" in message or "childFrameId" in message:
        return [_json_transform(message)]
    if "joints" in message:
        joints = [_object(joint, "a joint") for joint in message["joints"]]
        told = [joint for joint in joints if "position" in joint]
        names = tuple(_text(joint.get("name")) for joint in told)
        return [Sample(time_stamp(message.get("timestamp")), "", names, [_number(joint["position"]) for joint in told])]
    if "name" not in message or "position" not in message:
        raise ValueError(f"it has neither joints nor name and position, but {', '.join(map(repr, message))}")
    header = _object(message.get("header") or {}, "its header")
    pairs = _told([_text(name) for name in message["name"]], [_number(value) for value in message["position"]])
    return [Sample(time_stamp(header.get("stamp")), _text(header.get("frame_id", "")), *pairs)]


def _json_transform(message: Mapping[str, Any]) -> Sample:
    """Return a transform; protobuf's JSON leaves out what is 0 and writes names in camel case."""
    header = _object(message.get("header") or {}, "its header")
    stamp = message["timestamp"] if "timestamp" in message else header.get("stamp")
    parent = message.get("parent_frame_id", message.get("parentFrameId", header.get("frame_id", "")))
    child = message.get("child_frame_id", message.get("childFrameId", ""))
    body = _object(message.get("transform", message), "its transform")
    translation, rotation = (_object(body.get(key) or {}, key) for key in ("translation", "rotation"))
    axes = [(translation, axis) for axis in "xyz"] + [(rotation, axis) for axis in "xyzw"]
    pose = tuple(_number(part.get(axis, 0.0)) for part, axis in axes)
    return Sample(time_stamp(stamp), _text(parent), (_text(child),), [pose])


def _numbers(values: Mapping[str, Any], axes: str) -> tuple[float, ...]:
    return tuple(float(values[axis]) for axis in axes)


def _told(names: Sequence[str], positions: Sequence[float]) -> tuple[tuple[str, ...], Sequence[float]]:
    """Return the joints that are told; none where a publisher gives names and no positions, as ROS allows."""
    if positions and len(names) != len(positions):
        raise ValueError(f"it names {len(names)} joints and gives {len(positions)} positions")
    return tuple(names[: len(positions)]), positions


def time_stamp(value: Any) -> int:
    """Return a time stamp of a message [ns]: seconds and nanoseconds, a date, or 0 for none; ValueError for others."""
    if isinstance(value, str):  # protobuf's JSON writes a time as a date
        moment = date_nanoseconds(value)
        if moment is None:
            raise ValueError(f"its time stamp is {json.dumps(value)[:60]}, no date such as 2024-05-01T12:00:00.5Z")
        return moment[0]
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
