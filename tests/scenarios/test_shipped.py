"""The shipped scenarios show what they say, by checks that share no code with what computed them."""

from pathlib import Path

import fcl
import numpy as np
import pytest
import trimesh

import replay
from replay.batch.run import run_all
from replay.batch.select import load_all
from replay.collision.columns import Level
from replay.scenario.scene import build
from replay.sensing.columns import Detection

FOLDER = Path(replay.__file__).parents[1] / "scenarios"
NAMES = ("carm_clear", "carm_near", "carm_head_contact", "carm_parking", "carm_bodyguard", "doctor_walks_in")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Each scenario as run by the command, and its recording read back."""
    folder = tmp_path_factory.mktemp("runs")
    run = run_all(load_all([FOLDER / f"{name}.yaml" for name in NAMES]), folder, rrd=False)
    assert run.passed, run.results
    return {result.name: replay.read(result.recordings.mcap) for result in run.results}


def triangles(scenario: str, shape: str) -> np.ndarray:
    scene = build(replay.load(FOLDER / f"{scenario}.yaml"))
    return next(entry.solid.triangles for entry in scene.shapes if entry.name == shape)


def bvh(corners: np.ndarray) -> fcl.BVHModel:
    model = fcl.BVHModel()
    model.beginModel(3 * len(corners), len(corners))
    model.addSubModel(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
    model.endModel()
    return model


def test_every_scenario_expects_something_and_belongs_to_the_night():
    for scenario in load_all([FOLDER / f"{name}.yaml" for name in NAMES]):
        assert scenario.expect, scenario.name
        assert "nightly" in scenario.tags
        assert 4 <= scenario.duration <= 8
        assert scenario.rate == 60


def test_clear_near_and_contact_are_the_three_states(runs):
    worst = {name: runs[name].collision.level.max() for name in ("carm_clear", "carm_near", "carm_head_contact")}
    assert worst == {"carm_clear": Level.CLEAR, "carm_near": Level.BOUNDS, "carm_head_contact": Level.CONTACT}
    assert not any(recording.collision.undecided.any() for recording in runs.values())


def test_head_contact_begins_where_fcl_finds_it(runs):
    recording = runs["carm_head_contact"]
    pair = recording.layout.pairs.index("detector/panel|patient/body")
    ours = recording.collision.level[:, pair] == Level.CONTACT
    bodies = {"detector": "detector/panel", "patient": "patient/body"}
    objects = {link: fcl.CollisionObject(bvh(triangles("carm_head_contact", shape))) for link, shape in bodies.items()}
    theirs = np.zeros(len(ours), dtype=bool)
    for frame, poses in enumerate(recording.link_poses):
        for link, body in objects.items():
            T = poses[recording.layout.links.index(link)]
            body.setTransform(fcl.Transform(T[:3, :3], T[:3, 3]))
        theirs[frame] = fcl.collide(*objects.values(), fcl.CollisionRequest(), fcl.CollisionResult()) > 0
    assert ours.any()
    assert abs(int(np.argmax(ours)) - int(np.argmax(theirs))) <= 1
    # the panel is convex and comes from outside, so surfaces meet whenever the bodies do
    assert np.count_nonzero(ours != theirs) <= 2  # a frame at the beginning, a frame at the end


def test_parking_readings_lie_on_the_patient(runs):
    recording = runs["carm_parking"]
    patient = recording.layout.links.index("patient")
    corners = triangles("carm_parking", "patient/body")
    mesh = trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), process=False)
    status = recording.distance.status == Detection.DETECTED
    assert status.any(axis=0).all()
    assert not status.all(axis=0).any()
    frames, sensors = np.nonzero(status)
    T = recording.link_poses[frames, patient]
    points = recording.distance.point[frames, sensors]
    local = np.einsum("nji,nj->ni", T[:, :3, :3], points - T[:, :3, 3])
    _, off, _ = trimesh.proximity.closest_point(mesh, local)
    assert off.max() <= 1e-12  # coordinates of a metre, a dozen roundings on the way to the world and back
    # and the reading is the way from the apex to that point
    for s, name in enumerate(recording.layout.distance_sensors):
        mine = sensors == s
        length = np.linalg.norm(recording.distance.point_sensor[frames[mine], s], axis=1)
        np.testing.assert_allclose(length, recording.distance.distance[frames[mine], s], atol=1e-14, err_msg=name)


def test_the_bodyguard_nearest_the_head_reads_lowest(runs):
    recording = runs["carm_bodyguard"]
    scene = build(replay.load(FOLDER / "carm_bodyguard.yaml"))
    patient = triangles("carm_bodyguard", "patient/body").reshape(-1, 3)
    T_patient = recording.link_poses[-1, recording.layout.links.index("patient")]
    body = patient @ T_patient[:3, :3].T + T_patient[:3, 3]
    head = body[body[:, 0] > body[:, 0].max() - 0.25]  # the last 25 cm towards the crown
    distance = {}
    for sensor in scene.capacitive_sensors:
        T = recording.link_poses[-1, sensor.link]
        in_front = []
        for plate in sensor.plates:
            T_plate = T @ plate.T_link_plate
            local = (head - T_plate[:3, 3]) @ T_plate[:3, :3]
            local = local[local[:, 2] > 0.0]  # a plate sees what is in front of it
            beyond = np.maximum(np.abs(local) - [*plate.half_size, 0.0], 0.0)
            in_front.append(np.linalg.norm(beyond, axis=1).min(initial=np.inf))
        distance[sensor.name] = min(in_front)
    nearest = min(distance, key=distance.get)
    lowest = recording.layout.capacitive_sensors[int(np.argmin(recording.capacitive.output_voltage[-1]))]
    assert lowest == nearest
    assert len(distance) == 6
    assert all(len(sensor.plates) == 3 for sensor in scene.capacitive_sensors)


def test_the_doctor_comes_nearer_and_touches_nothing(runs):
    recording = runs["doctor_walks_in"]
    guard = recording.distance.distance[:, 0]
    seen = np.flatnonzero(~np.isnan(guard))
    assert seen.size > 60
    assert guard[seen].min() < 0.5 < guard[seen].max()
    assert recording.collision.level.max() < Level.CONTACT
