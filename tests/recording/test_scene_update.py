"""The scene's message: every field that a viewer asks for is written, and each body is where it belongs."""

from __future__ import annotations

import numpy as np

from replay.recording import messages
from replay.recording.scene_update import scene_message
from tests.recording import synthetic


def test_a_body_is_an_entity_of_its_link_with_its_triangles_and_its_colour():
    scene = synthetic.scene()
    update = messages.message_class(messages.SCENE).FromString(scene_message(scene))
    assert [entity.id for entity in update.entities] == [body.name for body in scene.bodies]
    assert [entity.frame_id for entity in update.entities] == [scene.links[body.link] for body in scene.bodies]
    for entity, body in zip(update.entities, scene.bodies, strict=True):
        assert entity.frame_locked and entity.HasField("timestamp") and entity.timestamp.seconds == 0
        assert not entity.HasField("lifetime")
        (mesh,) = entity.triangles
        assert mesh.pose.HasField("position") and mesh.pose.position.x == 0.0
        turn = mesh.pose.orientation
        assert (turn.x, turn.y, turn.z, turn.w) == (0.0, 0.0, 0.0, 1.0)
        color = (mesh.color.r, mesh.color.g, mesh.color.b, mesh.color.a)
        np.testing.assert_allclose(color, np.array(body.color) / 255, rtol=1e-15)
        points = np.array([(point.x, point.y, point.z) for point in mesh.points])
        np.testing.assert_array_equal(points[np.array(mesh.indices).reshape(-1, 3)], body.triangles)
        assert len(points) == 4  # corners that triangles share are there once


def test_the_message_is_the_same_bytes_each_time():
    assert scene_message(synthetic.scene()) == scene_message(synthetic.scene())
