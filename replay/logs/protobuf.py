"""Protobuf schemas as they stand in log files: descriptor sets to message classes and back."""

from __future__ import annotations

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.descriptor import Descriptor, FileDescriptor
from google.protobuf.message import DecodeError, Message

from replay.errors import RecordingError


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
        files = descriptor_pb2.FileDescriptorSet.FromString(schema)
        pool = descriptor_pool.DescriptorPool()
        for proto in files.file:
            pool.AddSerializedFile(proto.SerializeToString())
        return message_factory.GetMessageClass(pool.FindMessageTypeByName(name))
    except (DecodeError, TypeError, KeyError, ValueError) as error:
        raise RecordingError(file, f"schema {name!r} cannot be used: {error}") from None
