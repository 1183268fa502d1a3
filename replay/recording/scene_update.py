"""The scene as one foxglove.SceneUpdate: an entity for each body, in its link's frame."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from replay.logs.wire import MessageShape, shape_of
from replay.numerics.arrays import Floats, Integers
from replay.recording import messages
from replay.recording.scene_view import BodyView, SceneView


def scene_message(scene: SceneView) -> bytes:
    """Return the serialised foxglove.SceneUpdate of a scene."""
    update = messages.message_class(messages.SCENE)()
    for body, (vertices, index) in zip(scene.bodies, map(scene.meshes.body, range(len(scene.bodies))), strict=True):
        _add(update, body, scene.links[body.link], vertices, index)
    data: bytes = update.SerializeToString(deterministic=True)
    return data


def _add(update: Any, body: BodyView, link: str, vertices: Floats, index: Integers) -> None:
    entity = update.entities.add(id=body.name, frame_id=link, frame_locked=True)
    entity.timestamp.SetInParent()
    mesh = entity.triangles.add()
    mesh.pose.position.SetInParent()
    mesh.pose.orientation.w = 1.0
    for channel, value in zip("rgba", body.color, strict=True):
        setattr(mesh.color, channel, value / 255)
    mesh.MergeFromString(_points(mesh, vertices))
    mesh.indices.extend(index.ravel().tolist())


def _points(mesh: Any, vertices: Floats) -> bytes:
    """Return the encoding of a mesh that has nothing but points: fields of merged messages are joined."""
    kind: Any = type(mesh)
    head, shape = _point(kind)
    rows = np.empty((len(vertices), len(head) + shape.length), dtype=np.uint8)
    rows[:, : len(head)] = np.frombuffer(head, dtype=np.uint8)
    points = rows[:, len(head) :]
    shape.fill(points)
    for axis, letter in enumerate("xyz"):
        shape.slots[letter].write(points, vertices[:, axis])
    return rows.tobytes()


@functools.cache
def _point(mesh: Any) -> tuple[bytes, MessageShape]:
    """Return what begins each point in the encoding of a mesh, and the shape of the point itself."""
    example = mesh(points=[{"x": 1.0, "y": 1.0, "z": 1.0}])
    shape = shape_of(example.points[0].DESCRIPTOR, example.points[0].SerializeToString())
    assert shape is not None
    return example.SerializeToString()[: -shape.length], shape
