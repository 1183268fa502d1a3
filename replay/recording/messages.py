"""The message types of a recording: our own, from the compiled `schemas/*.proto`, and Foxglove's."""

from __future__ import annotations

import functools
from importlib import resources
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from replay.logs.mcap_records import Schema
from replay.logs.protobuf import descriptor_set

COLLISION = "replay.CollisionStates"
DISTANCE = "replay.DistanceReading"
CAPACITIVE = "replay.CapacitiveReading"
JOINTS = "foxglove.JointStates"
TRANSFORMS = "foxglove.FrameTransforms"
SCENE = "foxglove.SceneUpdate"
LOG = "foxglove.Log"


@functools.cache
def message_class(name: str) -> Any:
    """Return the class of the message type `name`, one of the constants of this module."""
    if name.startswith("foxglove."):
        return _foxglove(name)
    return message_factory.GetMessageClass(_own_types().FindMessageTypeByName(name))


@functools.cache
def schema(name: str) -> Schema:
    """Return the schema record that describes the message type `name` to any reader."""
    return Schema(name, "protobuf", descriptor_set(message_class(name).DESCRIPTOR))


@functools.cache
def _own_types() -> Any:
    compiled = resources.files("replay.recording").joinpath("replay.binpb").read_bytes()
    pool = descriptor_pool.DescriptorPool()
    for file in descriptor_pb2.FileDescriptorSet.FromString(compiled).file:
        pool.AddSerializedFile(file.SerializeToString())
    return pool


def _foxglove(name: str) -> Any:
    from foxglove_schemas_protobuf import FrameTransforms_pb2, JointStates_pb2, Log_pb2, SceneUpdate_pb2

    return {
        JOINTS: JointStates_pb2.JointStates,
        TRANSFORMS: FrameTransforms_pb2.FrameTransforms,
        SCENE: SceneUpdate_pb2.SceneUpdate,
        LOG: Log_pb2.Log,
    }[name]
