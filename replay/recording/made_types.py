"""Message types made of the fields that they carry, as `protoc` makes them of the files in `schemas/`."""

from __future__ import annotations

from collections.abc import Sequence

from google.protobuf.descriptor_pb2 import DescriptorProto, FieldDescriptorProto, FileDescriptorProto

from replay.numerics.columns import Field

_TYPES = {
    "float64": FieldDescriptorProto.TYPE_DOUBLE,
    "int32": FieldDescriptorProto.TYPE_SFIXED32,  # of one length, whatever the value
    "uint8": FieldDescriptorProto.TYPE_UINT32,
    "bool": FieldDescriptorProto.TYPE_BOOL,
}


def message_file(name: str, fields: Sequence[Field]) -> FileDescriptorProto:
    """Return the file that declares a message type: of each field one value, a vector, or a list.

    Args:
        name: "replay.DistanceReading".
        fields: numbered in this order from 1 on.
    """
    package, _, title = name.rpartition(".")
    file = FileDescriptorProto(name=f"{title}.proto", package=package, syntax="proto3")
    message = file.message_type.add(name=title)
    for field in fields:
        _add(message, name, field)
    return file


def names_file(name: str, fields: Sequence[str]) -> FileDescriptorProto:
    """Return the file that declares a message type of lists of names, numbered from 1 on."""
    package, _, title = name.rpartition(".")
    file = FileDescriptorProto(name=f"{title}.proto", package=package, syntax="proto3")
    message = file.message_type.add(name=title)
    for number, field in enumerate(fields, start=1):
        entry = message.field.add(name=field, number=number, json_name=field)
        entry.label, entry.type = FieldDescriptorProto.LABEL_REPEATED, FieldDescriptorProto.TYPE_STRING
    return file


def _add(message: DescriptorProto, name: str, field: Field) -> None:
    words = field.name.split("_")
    entry = message.field.add(
        name=field.name,
        number=len(message.field) + 1,
        label=FieldDescriptorProto.LABEL_REPEATED if field.each else FieldDescriptorProto.LABEL_OPTIONAL,
        type=_TYPES[field.type.name],
        json_name=words[0] + "".join(map(str.capitalize, words[1:])),
    )
    if field.states is not None:
        title = field.name.title().replace("_", "")
        taken = {value.name for states in message.enum_type for value in states.value}
        prefix = f"{field.name.upper()}_" if taken & set(field.states.__members__) else ""  # names of a message differ
        states = message.enum_type.add(name=title)
        for state in field.states:
            states.value.add(name=prefix + state.name, number=state.value)
        entry.type, entry.type_name = FieldDescriptorProto.TYPE_ENUM, f".{name}.{title}"
    if field.letters:
        entry.type, entry.type_name = FieldDescriptorProto.TYPE_MESSAGE, f".{name}.Vector"
        if all(nested.name != "Vector" for nested in message.nested_type):
            vector = message.nested_type.add(name="Vector")
            for letter in field.letters:
                _add(vector, f"{name}.Vector", Field(letter, type=field.type))
    if not field.each:  # a value that is there although it is 0
        entry.oneof_index, entry.proto3_optional = len(message.oneof_decl), True
        message.oneof_decl.add(name=f"_{field.name}")
