"""A scenario's run as files: what they are called, what they say, and that they can be run again from themselves."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from replay.collision.columns import CollisionColumns
from replay.errors import RecordingExistsError
from replay.kinematics.motion import sample
from replay.recording.provenance import code_identity, sha256
from replay.recording.reader import read
from replay.recording.record import record_blocks
from replay.recording.scene_view import view
from replay.recording.writer import McapWriter
from replay.scenario.load import load, load_sources
from replay.scenario.scene import Scene, build
from replay.simulation import BLOCK_FRAMES, FrameBlock

SCENARIO = """
version: 1
name: two_boxes
description: One box slides beside another.
rate: 60 Hz
duration: 5 s
include: [parts/sensors.yaml]
links:
  rail: {shapes: {bar: {type: cuboid, size: [2, 0.1, 0.1], color: "#102030"}}}
  slider:
    parent: rail
    joint: {name: slide, type: prismatic, axis: [1, 0, 0], velocity: 1, acceleration: 2}
    shapes: {box: {type: cube, size: 10 cm, pose: {xyz: [0, 0, 0.2]}}}
  post: {pose: {xyz: [0.5, 0, 0]}, shapes: {box: {type: cube, size: 10 cm}}}
motion: {moves: [{to: {slide: 50 cm}, start: 1 s}]}
"""
SENSORS = """
sensors:
  distance: {ahead: {link: slider, aperture: 30 deg, range: 1 m}}
  capacitive: {skin: {link: slider, plates: {left: {size: [5 cm, 20 cm]}}, coupling: 10 pF}}
"""


@pytest.fixture
def scene(tmp_path: Path) -> Scene:
    (tmp_path / "scenarios" / "parts").mkdir(parents=True)
    (tmp_path / "scenarios" / "two_boxes.yaml").write_text(SCENARIO)
    (tmp_path / "scenarios" / "parts" / "sensors.yaml").write_text(SENSORS)
    return build(load(tmp_path / "scenarios" / "two_boxes.yaml"))


def blocks(scene: Scene) -> Iterator[FrameBlock]:
    """Yield true motion with made-up results."""
    for begin in range(0, scene.frames, BLOCK_FRAMES):
        end = min(begin + BLOCK_FRAMES, scene.frames)
        states = sample(scene.linkage, scene.script, scene.seconds(begin, end))
        poses = scene.linkage.forward(states.positions, states.free_poses)
        shape = (end - begin, len(scene.pairs))
        collision = CollisionColumns(
            np.ones(shape, dtype=np.uint8), np.ones(shape), np.ones(shape, dtype=bool), np.zeros(shape, dtype=bool)
        )
        yield FrameBlock(
            scene.layout,
            begin,
            scene.time_ns(begin, end),
            states.positions,
            states.velocities,
            poses.world,
            collision,
        )


def test_a_run_becomes_two_files_that_say_where_they_come_from(scene: Scene, tmp_path: Path) -> None:
    seen: list[tuple[int, int]] = []
    paths = record_blocks(scene, blocks(scene), tmp_path / "out", progress=lambda done, all_: seen.append((done, all_)))
    assert seen == [(256, 301), (301, 301)]
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == ["two_boxes.mcap", "two_boxes.rrd"]
    recording = read(paths.mcap)
    found = recording.provenance
    assert (found.scenario, found.root, found.frames) == ("two_boxes", "two_boxes.yaml", 301)
    assert found.code == code_identity() and found.block_frames == BLOCK_FRAMES
    assert dict(found.model) == scene.model.identity()
    assert dict(found.files) == {name: sha256(data) for name, data in recording.files.items()}
    assert set(recording.files) == {"two_boxes.yaml", "parts/sensors.yaml"}
    with pytest.raises(RecordingExistsError):
        record_blocks(scene, blocks(scene), tmp_path / "out")


def test_it_runs_again_from_itself_to_the_same_bytes(scene: Scene, tmp_path: Path) -> None:
    first = record_blocks(scene, blocks(scene), tmp_path / "first", rrd=False)
    assert first.rrd is None
    shutil.rmtree(tmp_path / "scenarios")
    recording = read(first.mcap)
    again = build(load_sources(recording.provenance.root, recording.files))
    second = record_blocks(again, blocks(again), tmp_path / "elsewhere" / "second", rrd=False)
    assert second.mcap.read_bytes() == first.mcap.read_bytes()


def test_an_error_keeps_the_recordings_of_before(scene: Scene, tmp_path: Path) -> None:
    paths = record_blocks(scene, blocks(scene), tmp_path)
    before = paths.mcap.read_bytes()

    def failing() -> Iterator[FrameBlock]:
        yield next(blocks(scene))
        raise ArithmeticError

    with pytest.raises(ArithmeticError):
        record_blocks(scene, failing(), tmp_path, overwrite=True)
    assert paths.mcap.read_bytes() == before
    assert not list(tmp_path.glob("*.part"))


def test_the_log_of_record_is_the_last_to_get_its_name(
    scene: Scene, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    there: list[bool] = []

    class Looking(McapWriter):
        def commit(self) -> None:
            there.append((tmp_path / "two_boxes.rrd").is_file())
            super().commit()

    monkeypatch.setattr("replay.recording.record.McapWriter", Looking)
    record_blocks(scene, blocks(scene), tmp_path)
    assert there == [True]


def test_a_rerun_recording_of_another_run_is_not_left_beside_the_log(scene: Scene, tmp_path: Path) -> None:
    paths = record_blocks(scene, blocks(scene), tmp_path)
    assert paths.rrd is not None
    paths.mcap.unlink()
    with pytest.raises(RecordingExistsError, match=r"two_boxes\.rrd"):
        record_blocks(scene, blocks(scene), tmp_path, rrd=False)
    assert paths.rrd.is_file()
    record_blocks(scene, blocks(scene), tmp_path, rrd=False, overwrite=True)
    assert [path.name for path in tmp_path.glob("two_boxes*")] == [paths.mcap.name]


def test_the_view_shows_every_shape_cone_and_plate(scene: Scene) -> None:
    shown = view(scene)
    assert [body.name for body in shown.bodies] == ["post/box", "rail/bar", "slider/box"]
    bar = shown.bodies[1]
    assert bar.color == (0x10, 0x20, 0x30, 255) and shown.links[bar.link] == "rail"
    assert np.allclose(np.ptp(bar.triangles.reshape(-1, 3), axis=0), [2, 0.1, 0.1])
    cone, skin = shown.sensors
    assert (cone.kind, cone.name, skin.kind, skin.name) == ("distance", "ahead", "capacitive", "skin")
    rim = cone.drawing.strips[-1] - cone.drawing.extent[0]
    assert not cone.drawing.faces and np.allclose(np.linalg.norm(rim, axis=1), 1.0)
    assert list(skin.drawing.faces) == ["left"] and len(skin.drawing.strips) == 1
    assert np.allclose(np.linalg.norm(np.diff(skin.drawing.faces["left"], axis=0), axis=1), [0.05, 0.2, 0.05])
    assert set(shown.texts) == {"two_boxes.yaml", "parts/sensors.yaml"}
