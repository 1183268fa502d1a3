"""The shipped scenarios: each runs once, and what it shows is checked against other people's geometry.

The phantoms are read here by trimesh from their files, the detector's panel is written out again, and only the poses
come from the recordings: a mistake in how the package reads, places or collides shapes cannot hide in both.
"""

import importlib.util
import json
from pathlib import Path

import fcl
import jsonschema
import numpy as np
import pytest
import trimesh
from ruamel.yaml import YAML

import replay
from replay.batch.select import find_scenarios
from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.collision.columns import Level
from replay.sensing.distance.columns import Detection

pytestmark = pytest.mark.compiled  # phantoms of thousands of triangles

SCENARIOS = Path(__file__).parents[2] / "scenarios"
BASELINES = Path(__file__).parents[1] / "baselines"
NAMES = (
    "carm_bodyguard",
    "carm_clear",
    "carm_head_contact",
    "carm_near",
    "carm_parking",
    "doctor_walks_in",
    "panda_meets_person",
)
REACTING = {f"carm_bodyguard_{what}" for what in ("reaction", "stops", "stops_late", "stops_thesis")}
"""Those with guards, which `test_guards.py` is about."""
MEASURED = {"carm_parking_measured"}
"""Those with a log of the machine, which `test_measured_log.py` is about."""
FILES = sorted(SCENARIOS.rglob("*.yaml"))

PANEL = (np.array([0.42, 0.42, 0.12]), np.array([0.0, 0.0, 0.06]))  # size, middle in the detector's frame [m]
PANEL_ON_PATIENT = "detector/panel|patient/body"


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """Return the exit code of a regression of all shipped scenarios, and its folder."""
    folder = tmp_path_factory.mktemp("shipped")
    return run(["regress", str(SCENARIOS), "--baseline", str(BASELINES), "-o", str(folder)]), folder


@pytest.fixture(scope="module")
def runs(night):
    """Return the result, as it is written, and the recording of each scenario, by name."""
    results = {name: json.loads((night[1] / name / "result.json").read_text()) for name in NAMES}
    return {name: (result, replay.read(night[1] / name / f"{name}.mcap")) for name, result in results.items()}


def recording_of(runs, name):
    return runs[name][1]


def poses(recording, link):
    """T_world_link of all frames."""
    return recording.link_poses[:, recording.layout.links.index(link)]


def moved(pose, points):
    return points @ pose[:3, :3].T + pose[:3, 3]


def patient_triangles():
    """The man's triangles in the frame of link `patient`: x to the crown, z out of the chest [m]."""
    package = Path(importlib.util.find_spec("pyskindose").origin).parent
    mesh = trimesh.load_mesh(package / "phantom_data" / "adult_male_reduced_1000t.stl")
    standing = np.asarray(mesh.triangles, dtype=np.float64) * 0.01
    return np.stack([standing[..., 2], -standing[..., 0], -standing[..., 1]], axis=-1)


def distances_to(triangles, points):
    """Distance of each point to the nearest triangle, by trimesh, every triangle for every point."""
    result = []
    for point in points:
        closest = trimesh.triangles.closest_point(triangles, np.broadcast_to(point, (len(triangles), 3)))
        result.append(np.sqrt(((closest - point) ** 2).sum(axis=1)).min())
    return np.array(result)


def fcl_mesh(triangles):
    mesh = fcl.BVHModel()
    mesh.beginModel(len(triangles), 3 * len(triangles))
    mesh.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    mesh.endModel()
    return mesh


def fcl_contacts(recording):
    """Contact points of the detector's panel and the patient in each frame, in the patient's frame, by python-fcl."""
    size, middle = PANEL
    panel = fcl_mesh(np.asarray(trimesh.creation.box(size).triangles) + middle)
    patient = fcl_mesh(patient_triangles())
    to_patient = np.linalg.inv(poses(recording, "patient")) @ poses(recording, "detector")
    found = []
    for pose in to_patient:
        result = fcl.CollisionResult()
        a = fcl.CollisionObject(panel, fcl.Transform(pose[:3, :3], pose[:3, 3]))
        b = fcl.CollisionObject(patient, fcl.Transform())
        fcl.collide(a, b, fcl.CollisionRequest(num_max_contacts=100, enable_contact=True), result)
        found.append(np.array([contact.pos for contact in result.contacts]).reshape(-1, 3))
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_editors_can_check_every_file(path):
    """The first line names the schema that the whole file obeys."""
    marker, _, schema = path.read_text().partition("\n")[0].partition("$schema=")
    assert marker == "# yaml-language-server: "
    written = YAML(typ="safe", pure=True).load(path)
    jsonschema.Draft202012Validator(json.loads((path.parent / schema).read_text())).validate(written)


def test_the_folder_holds_these_scenarios():
    found = [replay.load(path) for path in find_scenarios([SCENARIOS])]
    assert {scenario.name for scenario in found} >= set(NAMES)
    for scenario in found:
        assert scenario.main_source.endswith(f"{scenario.name}.yaml"), "a scenario is called like its file"
        assert scenario.description
        assert scenario.tags
        assert scenario.expect or "nightly" not in scenario.tags
    assert {scenario.name for scenario in found if "nightly" in scenario.tags} == {*NAMES, *REACTING, *MEASURED}


def test_all_are_as_accepted(night):
    code, folder = night
    assert code is ExitCode.FINE, json.loads((folder / "run.json").read_text())["verdicts"]


@pytest.mark.parametrize("name", NAMES)
def test_expectations_hold(runs, name):
    result, recording = runs[name]
    assert result["error"] == ""
    assert result["status"] == "passed", [held for held in result["expectations"] if not held["passed"]]
    assert not recording.collision.undecided.any()
    assert len(recording.time) == result["frames"]


def test_clear_is_clear(runs):
    recording = recording_of(runs, "carm_clear")
    assert (recording.collision.level == Level.CLEAR).all()
    assert PANEL_ON_PATIENT in recording.layout.pairs
    turned = recording.joint_positions[:, recording.layout.joints.index("rotation")]
    assert np.ptp(turned) > np.radians(45.0), "it is no picture: the machine moves"


def test_near_reaches_bounds_and_never_contact(runs):
    recording = recording_of(runs, "carm_near")
    levels = recording.collision.level
    near = levels[:, recording.layout.pairs.index(PANEL_ON_PATIENT)] == Level.BOUNDS
    assert near.any()
    assert not near.all()
    assert (levels < Level.CONTACT).all()
    assert not any(len(points) for points in fcl_contacts(recording))


def test_head_contact_begins_where_fcl_finds_it(runs):
    recording = recording_of(runs, "carm_head_contact")
    ours = np.flatnonzero(recording.collision.level[:, recording.layout.pairs.index(PANEL_ON_PATIENT)] == Level.CONTACT)
    contacts = fcl_contacts(recording)
    theirs = np.flatnonzero([len(points) > 0 for points in contacts])
    assert abs(int(ours[0]) - int(theirs[0])) <= 1
    assert abs(int(ours[-1]) - int(theirs[-1])) <= 1
    assert np.array_equal(np.diff(ours), np.ones(len(ours) - 1)), "one contact, without a gap"
    head = contacts[theirs[0]][:, 0]
    assert ((head > -0.25) & (head < 0.0)).all(), "the head is the first 25 cm from the crown"
    begun = [event for event in recording.events if event.kind == "contact" and event.begins]
    assert [event.frame for event in begun] == [ours[0]]
    assert recording.time[ours[0] - 1] < begun[0].earliest <= begun[0].time <= recording.time[ours[0]]


def test_parking_sensors_point_at_the_patient(runs):
    """Every detected point lies on the patient, inside its cone, as far as it is read, with no corner nearer.

    1e-9 m: coordinates of a few metres are rounded to 4e-16 m, and the rotation that a recorded quaternion is turned
    into again is off by a few 1e-16; a miss of a triangle or a frame would be off by 1e-4 m and more.
    """
    recording = recording_of(runs, "carm_parking")
    readings = recording.distance
    triangles = patient_triangles()
    seen = readings.status == Detection.DETECTED
    corners = {"left": -0.19, "right": 0.19, "foot": -0.19, "head": 0.19}
    for column, name in enumerate(recording.layout.distance_sensors):
        _, along, across = name.split("_")
        apex = np.array([corners[along], corners[across], 0.0])
        frames = np.flatnonzero(seen[:, column])
        assert 0 < len(frames) < len(seen)
        assert np.ptp(readings.distance[frames, column]) > 0.05, "readings vary"
        in_patient = np.linalg.inv(poses(recording, "patient")[frames])
        points = np.array([moved(a, p) for a, p in zip(in_patient, readings.point[frames, column], strict=True)])
        assert distances_to(triangles, points).max() < 1e-9
        for frame, to_patient, point in zip(frames, in_patient, points, strict=True):
            detector = to_patient @ poses(recording, "detector")[frame]
            tip, axis = moved(detector, apex), -detector[:3, 2]
            reach = np.linalg.norm(point - tip)
            assert readings.distance[frame, column] == pytest.approx(reach, abs=1e-9)
            assert (point - tip) @ axis >= reach * np.cos(np.radians(20.0)) - 1e-9
            away = triangles.reshape(-1, 3) - tip
            lengths = np.sqrt((away**2).sum(axis=1))
            inside = away @ axis > lengths * np.cos(np.radians(20.0)) + 1e-9
            assert not (lengths[inside] < reach - 1e-9).any()


def test_the_nearest_body_guard_reads_lowest(runs):
    """At the end, with the distance of plates and patient taken from points 1 cm apart on the plates."""
    recording = recording_of(runs, "carm_bodyguard")
    scenario = replay.load(SCENARIOS / "carm_bodyguard.yaml")
    triangles = patient_triangles()
    to_patient = np.linalg.inv(poses(recording, "patient")[-1]) @ poses(recording, "detector")[-1]
    nearest = []
    for name in recording.layout.capacitive_sensors:
        plates = scenario.sensors.capacitive[name].plates
        assert len(plates) == 3
        on_plates = [plate_points(name, plate, spacing=0.01) for plate in plates.values()]
        nearest.append(distances_to(triangles, moved(to_patient, np.concatenate(on_plates))).min())
    output = recording.capacitive.output_voltage
    names = recording.layout.capacitive_sensors
    assert len(names) == 6
    assert names[int(np.argmin(nearest))] == names[int(np.argmin(output[-1]))] == "side_foot"
    second = np.sort(nearest)[1]
    assert min(nearest) < second - 0.01, "the points on the plates are 1 cm apart: nearer than that decides nothing"
    side_foot = output[:, names.index("side_foot")]
    assert side_foot[-1] < side_foot[0] - 0.2, "it sinks as the head comes near"


def plate_points(sensor, plate, *, spacing):
    """Points of a plate in the detector's frame; which way its sides lie is said here once more."""
    x_of, y_of = {
        "side_foot": ([0, 0, 1], [0, 1, 0]),
        "side_head": ([0, 0, -1], [0, 1, 0]),
        "side_left": ([1, 0, 0], [0, 0, 1]),
        "side_right": ([1, 0, 0], [0, 0, -1]),
        "front_left": ([1, 0, 0], [0, -1, 0]),
        "front_right": ([1, 0, 0], [0, -1, 0]),
    }[sensor]
    x, y = (np.linspace(-edge / 2, edge / 2, round(edge / spacing) + 1) for edge in plate.size)
    offsets = x[:, None, None] * np.array(x_of) + y[None, :, None] * np.array(y_of)
    return (np.array(plate.pose.xyz) + offsets).reshape(-1, 3)


def test_the_guard_sees_the_doctor_come_nearer(runs):
    recording = recording_of(runs, "doctor_walks_in")
    seen = recording.distance.status[:, 0] == Detection.DETECTED
    shapes = recording.distance.shape[seen, 0]
    assert {recording.layout.shapes[index] for index in shapes} == {"doctor/body"}
    walking = seen & (recording.time <= 4_500_000_000)
    assert (np.diff(recording.distance.distance[walking, 0]) < 0.0).all()
    doctor = [index for index, pair in enumerate(recording.layout.pairs) if "doctor/" in pair]
    assert (recording.collision.level[:, doctor] < Level.CONTACT).all()
    path = poses(recording, "doctor")[:, :3, 3]
    assert path[0, 1] - path[-1, 1] > 2.0, "she walks from the door to the table"


def test_the_arm_and_its_skin_feel_the_person_come_nearer(runs):
    recording = recording_of(runs, "panda_meets_person")
    seen = recording.distance.status == Detection.DETECTED
    assert {recording.layout.shapes[index] for index in recording.distance.shape[seen]} == {"doctor/body"}
    assert seen[-1].all()
    wrist = list(recording.layout.distance_sensors).index("wrist")
    path = poses(recording, "doctor")[:, :2, 3]
    reach = np.linalg.norm(path - poses(recording, "panda_link5")[:, :2, 3], axis=1)
    near = recording.distance.distance[:, wrist] < reach  # she holds her arms out, towards the arm
    assert near[seen[:, wrist]].all()
    output = recording.capacitive.output_voltage[:, 0]
    assert output[0] - output.min() > 0.1, "the skin's output falls"
