"""The message types of a recording: our own, made of the fields that they carry, and Foxglove's."""

from __future__ import annotations

import functools
from typing import Any

from google.protobuf import descriptor_pool, message_factory

from replay.collision.columns import CollisionColumns
from replay.logs.mcap_records import Schema
from replay.logs.protobuf import descriptor_set
from replay.numerics.columns import Columns
from replay.recording.made_types import message_file
from replay.sensing.kinds import KINDS

COLLISION = "replay.CollisionStates"
JOINTS = "foxglove.JointStates"
TRANSFORMS = "foxglove.FrameTransforms"
SCENE = "foxglove.SceneUpdate"
LOG = "foxglove.Log"


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
    types: dict[str, type[Columns]] = {COLLISION: CollisionColumns}
    types |= {kind.message: kind.columns for kind in KINDS.values()}
    pool = descriptor_pool.DescriptorPool()
    for name, columns in types.items():
        pool.AddSerializedFile(message_file(name, columns.fields()).SerializeToString())
    return pool


def _foxglove(name: str) -> Any:
    from foxglove_schemas_protobuf import FrameTransforms_pb2, JointStates_pb2, Log_pb2, SceneUpdate_pb2

    return {
        JOINTS: JointStates_pb2.JointStates,
        TRANSFORMS: FrameTransforms_pb2.FrameTransforms,
        SCENE: SceneUpdate_pb2.SceneUpdate,
        LOG: Log_pb2.Log,
    }[name]
