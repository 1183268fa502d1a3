"""The message types of a recording: our own, made of the fields that they carry, and Foxglove's.

Foxglove's Log has one field more in a recording, far behind its own: `earliest`, from when on [ns] an event may have
been.
"""

from __future__ import annotations

import functools
from typing import Any

from google.protobuf import descriptor_pool, message_factory
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorSet

from replay.collision.columns import CollisionColumns
from replay.guarding.columns import GuardColumns
from replay.logs.mcap_records import Schema
from replay.logs.protobuf import descriptor_set
from replay.numerics.columns import Columns
from replay.recording.made_types import message_file, names_file
from replay.sensing.kinds import KINDS

COLLISION = "replay.CollisionStates"
GUARDS = "replay.GuardStates"
JOINTS = "foxglove.JointStates"
TRANSFORMS = "foxglove.FrameTransforms"
SCENE = "foxglove.SceneUpdate"
LOG = "foxglove.Log"
LAYOUT = "replay.Layout"
LAYOUT_NAMES = ("links", "joints", "pairs", "shapes", "objects", "sensors", "guards")
"""Fields of Layout, lists of names, in the order of their numbers from 1 on."""
EARLIEST = 1000
"""Number of the field `earliest` of Log."""


@functools.cache
def message_class(name: str) -> Any:
    """Return the class of the message type `name`: one of the constants of this module, or that of a sensor kind."""
    if name.startswith("foxglove."):
        return _foxglove(name)
    return message_factory.GetMessageClass(_own_types().FindMessageTypeByName(name))


@functools.cache
def schema(name: str) -> Schema:
    """Return the schema record that describes the message type `name` to any reader."""
    return Schema(name, "protobuf", descriptor_set(message_class(name).DESCRIPTOR))


@functools.cache
def _own_types() -> Any:
    types: dict[str, type[Columns]] = {COLLISION: CollisionColumns, GUARDS: GuardColumns}
    types |= {kind.message: kind.columns for kind in KINDS.values()}
    pool = descriptor_pool.DescriptorPool()
    for name, columns in types.items():
        pool.AddSerializedFile(message_file(name, columns.fields()).SerializeToString())
    pool.AddSerializedFile(names_file(LAYOUT, LAYOUT_NAMES).SerializeToString())
    return pool


def _foxglove(name: str) -> Any:
    from foxglove_schemas_protobuf import FrameTransforms_pb2, JointStates_pb2, Log_pb2, SceneUpdate_pb2

    return {
        JOINTS: JointStates_pb2.JointStates,
        TRANSFORMS: FrameTransforms_pb2.FrameTransforms,
        SCENE: SceneUpdate_pb2.SceneUpdate,
        LOG: _with_earliest(Log_pb2.Log),
    }[name]


@functools.cache
def _with_earliest(log: Any) -> Any:
    files = FileDescriptorSet.FromString(descriptor_set(log.DESCRIPTOR))
    message = files.file[-1].message_type[0]
    message.field.add(
        name="earliest",
        json_name="earliest",
        number=EARLIEST,
        type=FieldDescriptorProto.TYPE_SFIXED64,
        label=FieldDescriptorProto.LABEL_OPTIONAL,
        oneof_index=len(message.oneof_decl),
        proto3_optional=True,
    )
    message.oneof_decl.add(name="_earliest")
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.AddSerializedFile(file.SerializeToString())
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(log.DESCRIPTOR.full_name))
