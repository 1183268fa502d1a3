"""Messages of a ROS channel to values by field, whatever ROS and whatever definition wrote them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from replay import limits
from replay.errors import RecordingError
from replay.logs.mcap_records import Channel, Schema
from replay.logs.ros_schema import long_name, standard_types, types_of
from replay.logs.ros_wire import Memo, decode_cdr, decode_ros1

_DEFINITIONS = {"cdr": ("ros2msg", "ros2idl", "omgidl"), "ros1": ("ros1msg",)}
"""Languages of definitions by message encoding."""


def ros_decoder(name: str, channel: Channel, schema: Schema | None) -> Callable[[bytes], dict[str, Any]] | None:
    """Return what turns the messages of a channel into values, or None where they are not ROS's.

    What is returned raises ValueError for bytes that are no such message. A channel whose definition is empty has ROS's
    own one of that name.

    Args:
        name: of the file, for messages.
        channel: whose messages are to be decoded.
        schema: its schema.

    Raises:
        RecordingError: the definition cannot be read.
    """
    if schema is None or schema.encoding not in _DEFINITIONS.get(channel.encoding, ()):
        return None
    if len(schema.data) > limits.DEFINITION_TEXT:
        rule = f"has a definition of {len(schema.data)} bytes; at most {limits.DEFINITION_TEXT} are read"
        raise RecordingError(name, f"topic {channel.topic!r} {rule}")
    ros1 = channel.encoding == "ros1"
    decode, text = decode_ros1 if ros1 else decode_cdr, schema.data.decode(errors="replace")
    try:
        types = types_of(schema.name, text, ros1=ros1) if text.strip() else standard_types(ros1=ros1)
    except ValueError as error:
        raise RecordingError(name, f"topic {channel.topic!r}: {error}") from None
    own, memo = long_name(schema.name), Memo()
    return lambda data: decode(types, own, data, memo)
