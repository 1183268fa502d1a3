"""Protobuf schemas as they stand in log files: descriptor sets to message classes and back."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import Descriptor, FieldDescriptor, FileDescriptor
from google.protobuf.message import DecodeError, Message

from replay import limits
from replay.errors import LimitError, RecordingError


def descriptor_set(descriptor: Descriptor) -> bytes:
    """Return the serialised FileDescriptorSet that describes a message type and everything it refers to."""
    result = descriptor_pb2.FileDescriptorSet()
    seen: set[str] = set()

    def add(file: FileDescriptor) -> None:
        if file.name in seen:
            return
        seen.add(file.name)
        for dependency in file.dependencies:
            add(dependency)
        file.CopyToProto(result.file.add())

    add(descriptor.file)
    return result.SerializeToString(deterministic=True)


def message_type(file: str, name: str, schema: bytes) -> type[Message]:
    """Return the class of message `name` that the FileDescriptorSet `schema`, found in `file`, describes.

    Raises:
        RecordingError: the schema is not a FileDescriptorSet, is inconsistent, or does not describe that message.
    """
    try:
        return _message_type(name, schema)
    except ValueError as error:
        raise RecordingError(file, f"schema {name!r} cannot be used: {error}") from None


@functools.lru_cache(maxsize=128)  # topics share schemas, and both files of a comparison have the same
def _message_type(name: str, schema: bytes) -> type[Message]:
    try:
        files = descriptor_pb2.FileDescriptorSet.FromString(schema)
        pool = descriptor_pool.DescriptorPool()
        for proto in files.file:
            pool.AddSerializedFile(proto.SerializeToString())
        return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
    except (DecodeError, TypeError, KeyError) as error:
        raise ValueError(" ".join(str(error).split())[:200]) from None


def fields_of(file: str, descriptor: Any) -> Iterator[tuple[str, FieldDescriptor]]:
    """Yield the path and description of each field of a message type, with those of the messages in it.

    A type within itself is named there and not gone into again.

    Raises:
        LimitError: there are more than are read.
    """
    found = 0
    waiting: list[tuple[Any, str, frozenset[str]]] = [(descriptor, "", frozenset())]
    while waiting:
        type_, prefix, around = waiting.pop()
        inside = around | {type_.full_name}
        deeper = []
        for field in type_.fields:
            found += 1
            if found > limits.SCHEMA_FIELDS:
                rule = f"more than {limits.SCHEMA_FIELDS} fields, with those of the messages in it"
                raise LimitError(file, f"schema {descriptor.full_name!r} has {rule}")
            yield f"{prefix}{field.name}", field
            if field.message_type is not None and field.message_type.full_name not in inside:
                deeper.append((field.message_type, f"{prefix}{field.name}.", inside))
        waiting.extend(reversed(deeper))
