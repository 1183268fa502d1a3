"""Messages of any log as plain values: protobuf, JSON and ROS 1 or 2, by the schema that the log carries."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from google.protobuf.descriptor import FieldDescriptor

from replay import limits
from replay.json_text import read_json
from replay.logs.mcap_records import Channel, Schema
from replay.logs.protobuf import message_type
from replay.logs.ros_messages import ros_decoder

Values = Mapping[str, Any]
"""Numbers, texts, bytes, and lists and mappings of them, by field."""


def value_decoder(file: str, channel: Channel, schema: Schema | None) -> Callable[[bytes], Values] | None:
    """Return what turns the messages of a channel into values; None where their encoding is not one that is read.

    What is returned raises whatever its format's library does on bytes that are not its messages.

    Raises:
        RecordingError: a schema cannot be used.
    """
    if channel.encoding == "json":
        return _json
    if schema is None:
        return None
    if channel.encoding == "protobuf" and schema.encoding == "protobuf":
        type_ = message_type(file, schema.name, schema.data)
        return lambda data: _Values().of(type_.FromString(data))
    return ros_decoder(file, channel, schema)


def _json(data: bytes) -> Values:
    values = read_json(data, most=limits.MESSAGE)
    return values if isinstance(values, dict) else {"value": values}


class _Values:
    """Takes one message apart, up to the number of values that are read of one."""

    def __init__(self) -> None:
        self._left = limits.MESSAGE_VALUES

    def of(self, message: Any) -> Values:
        """Return a message's fields; those of messages inside it only where they are set.

        Raises:
            ValueError: there are too many.
        """
        values: dict[str, Any] = {}
        for field in message.DESCRIPTOR.fields:
            value = getattr(message, field.name)
            self._count(len(value) if field.is_repeated else 1)
            if field.type != FieldDescriptor.TYPE_MESSAGE:
                values[field.name] = list(value) if field.is_repeated else value
            elif field.message_type.GetOptions().map_entry:
                values[field.name] = {str(key): self._in_map(value[key]) for key in value}
            elif field.is_repeated:
                values[field.name] = [self.of(item) for item in value]
            elif message.HasField(field.name):
                values[field.name] = self.of(value)
        return values

    def _in_map(self, value: Any) -> Any:
        return self.of(value) if hasattr(value, "DESCRIPTOR") else value

    def _count(self, values: int) -> None:
        self._left -= values
        if self._left < 0:
            raise ValueError(f"a message holds more than the {limits.MESSAGE_VALUES} values that are taken apart")
