"""Sensors on moving links: the block's columns are the exact readings of every frame, whoever moves and wherever."""

import itertools
import math

import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.numerics import transforms
from replay.sensing.distance import DistanceSensor, DistanceSuite, closest_in_cone
from replay.sensing.distance.columns import Detection
from replay.sensing.target import make_target
from tests.sensing.distance.meshes import grid_of_cubes, torus

HERE = transforms.identity()
FRAMES = 40


def at(x, y, z, angle=0.0, axis=(0.0, 1.0, 0.0)):
    return transforms.compose(
        transforms.from_translation(np.array([x, y, z])), transforms.from_axis_angle(np.array(axis), np.array(angle))
    )


def machine(origin=(0.0, 0.0, 0.0)):
    """Links sorted by name: arm (0, revolute on base), base (1), box (2, free), ring (3, prismatic on base)."""
    return Linkage(
        [
            Link("base", None, transforms.from_translation(np.array(origin)), Joint("base")),
            Link("arm", "base", at(0, 0, 3.0, 0.1), Joint("arm", JointType.REVOLUTE, axis=(0.0, 0.6, 0.8))),
            Link("ring", "base", at(0.2, 0, 0), Joint("ring", JointType.PRISMATIC)),
            Link("box", None, HERE, Joint("box", JointType.FREE)),
        ]
    )


def moving(linkage, frames=FRAMES):
    time = np.linspace(0.0, 1.0, frames)
    time[10:15] = time[10]  # a dwell
    positions = np.stack([6.0 * time, 0.5 * time], axis=-1)
    free = transforms.compose(
        transforms.from_translation(np.stack([0.5 - time, 0 * time, 0.9 + 0 * time], axis=-1)),
        transforms.from_axis_angle(np.array([1.0, 0.0, 0.0]), 2.0 * time),
    )
    return linkage.forward(positions, free[:, None])


TARGETS = [
    make_target("ring/skin", 3, torus(30, 16)),
    make_target("box/side", 2, 0.2 * grid_of_cubes(2)),
    make_target("arm/own", 0, grid_of_cubes(1) - 0.5),
]
DOWN = math.pi
SENSORS = [
    DistanceSensor("down", 0, at(0, 0, 0, DOWN), 0.7),
    DistanceSensor("needle", 0, at(0.9, 0, 0, DOWN), 1e-6),
    DistanceSensor("wide", 0, at(0.1, 0, 0, DOWN), 4.0),
    DistanceSensor("ground", 1, at(0, 0, -2.0), 0.9, range=2.2, min_range=1.8),
    DistanceSensor("no_ring", 0, at(0, 0, 0, DOWN), 0.9, ignored_links=frozenset({3})),
]


@pytest.mark.parametrize("method", ["exact", "rays"])
@pytest.mark.parametrize("savings", [True, False])
def test_an_apex_on_a_face_up_to_rounding_reads_zero_whatever_carries_both(method, savings):
    # the room's far walls are what was read where rounding put the face behind the apex
    rng = np.random.default_rng(4)
    turns = rng.uniform(-3.0, 3.0, (12, 3)).round(1)
    room = make_target("room/walls", 0, 30.0 * grid_of_cubes(1) - 15.0)
    for turn, face in itertools.product(turns, range(3)):
        steps = rng.uniform(-2.0, 2.0, (5, 3)).round(1)
        size = rng.uniform(0.01, 0.5, 3).round(2)
        plate = make_target("plate/skin", 2, size * (2.0 * grid_of_cubes(1) - 1.0))
        spot = size * rng.uniform(-0.9, 0.9, 3)
        spot[face] = size[face]
        first, second = at(*steps[0], *turn[:1]), at(*steps[1], *turn[1:2], axis=(1.0, 0.0, 0.0))
        apex = transforms.apply(transforms.compose(first, second), spot)
        linkage = Linkage(
            [
                Link("a_room", None, HERE, Joint("a_room")),
                Link("arm", None, first, Joint("arm")),
                Link("plate", "arm", second, Joint("plate")),
                Link("stand", None, at(*steps[2]), Joint("stand")),
                Link("top", "stand", at(*(apex - steps[2]), turn[2]), Joint("top")),
            ]
        )
        sensor = DistanceSensor("s", 4, HERE, 0.6)
        suite = DistanceSuite([sensor], [plate, room], method=method, count=61, savings=savings)
        columns = suite.run(linkage.forward(np.empty((1, 0)), np.empty((1, 0, 4, 4))))
        assert (columns.distance[0, 0], columns.shape[0, 0]) == (0.0, 0)


def test_every_frame_is_the_closest_of_all_targets():
    linkage = machine()
    poses = moving(linkage)
    columns = DistanceSuite(SENSORS, TARGETS).run(poses)
    seen = set()
    for column, sensor in enumerate(SENSORS):
        for frame in range(FRAMES):
            T_world_sensor = transforms.compose(poses.world[frame, sensor.link], sensor.T_link_sensor)
            hits = []
            for index, target in enumerate(TARGETS):
                if target.link == sensor.link or target.link in sensor.ignored_links:
                    continue
                world = transforms.apply(poses.world[frame, target.link], target.triangles)
                hit = closest_in_cone(
                    world, T_world_sensor[:3, 3], T_world_sensor[:3, 2], sensor.aperture, range=sensor.range
                )
                hits.append((hit.distance if hit.detected else math.inf, index, hit))
            distance, index, hit = min(hits, key=lambda item: item[0])
            row = (frame, column)
            seen.add((sensor.name, int(columns.shape[row])))
            if not hit.detected:
                assert columns.status[row] == Detection.NOTHING
                assert np.isnan(columns.distance[row])
                assert columns.shape[row] == columns.triangle[row] == -1
                continue
            assert columns.status[row] == (Detection.TOO_CLOSE if distance < sensor.min_range else Detection.DETECTED)
            assert columns.distance[row] == pytest.approx(distance, abs=1e-13)
            assert columns.shape[row] == index
            np.testing.assert_allclose(columns.point[row], hit.point, atol=1e-12)
            local = transforms.apply(transforms.invert(T_world_sensor), hit.point)
            np.testing.assert_allclose(columns.point_sensor[row], local, atol=1e-12)
            corners = transforms.apply(
                poses.world[frame, TARGETS[index].link], TARGETS[index].triangles[columns.triangle[row]]
            )
            normal = np.cross(corners[1] - corners[0], corners[2] - corners[0])
            np.testing.assert_allclose(columns.normal[row], normal / np.linalg.norm(normal), atol=1e-12)
    assert {("down", 0), ("down", 1), ("needle", -1), ("no_ring", 1), ("ground", -1), ("ground", 0)} <= seen
    assert not {("no_ring", 0), ("down", 2)} & seen
    assert {int(status) for status in columns.status[:, 3]} == set(Detection)


@pytest.mark.parametrize("method", ["exact", "rays", "thesis"])
def test_readings_do_not_depend_on_blocks_or_on_the_frames_before(method):
    poses = moving(machine())
    suite = DistanceSuite(SENSORS, TARGETS, method=method, count=61)
    whole = suite.run(poses)
    single = [suite.run(poses.slice(frame, frame + 1)) for frame in range(FRAMES)]
    for name in (field.name for field in whole.present()):
        parts = np.concatenate([getattr(columns, name) for columns in single])
        np.testing.assert_array_equal(getattr(whole, name), parts)


def test_a_machine_far_from_the_origin_reads_the_same():
    near, far = moving(machine()), moving(machine(origin=(1e6, -1e6, 1e3)))
    sensors = [sensor for sensor in SENSORS if sensor.name == "down"]
    suite = DistanceSuite(sensors, [TARGETS[0]])
    here, there = suite.run(near), suite.run(far)
    np.testing.assert_array_equal(here.distance, there.distance)
    np.testing.assert_array_equal(here.point_sensor, there.point_sensor)


def test_the_first_of_equally_close_targets_is_named():
    twins = [make_target("ring/a", 3, torus(8, 6)), make_target("ring/b", 3, torus(8, 6))]
    shape = DistanceSuite(SENSORS[:1], twins).run(moving(machine())).shape
    assert set(np.unique(shape)) == {-1, 0}


def test_flat_target_has_a_normal_towards_the_sensor():
    point = make_target("ring/dot", 3, np.zeros((1, 3, 3)))
    sensor = DistanceSensor("down", 1, at(0.2, 0, 2.0, DOWN), 0.7)
    columns = DistanceSuite([sensor], [point]).run(moving(machine()))
    np.testing.assert_allclose(columns.normal[0, 0], [0, 0, 1], atol=1e-15)


def test_no_sensors_and_no_targets_are_fine():
    poses = moving(machine())
    assert DistanceSuite([], TARGETS).run(poses).distance.shape == (FRAMES, 0)
    assert (DistanceSuite(SENSORS, []).run(poses).status == Detection.NOTHING).all()


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("aperture", {"aperture": 7.0}),
        ("range", {"range": math.nan}),
        ("min_range", {"min_range": -1.0}),
        ("min_range", {"min_range": 3.0, "range": 2.0}),
        ("T_link_sensor", {"T_link_sensor": np.zeros((4, 4))}),
        ("T_link_sensor", {"T_link_sensor": np.eye(3)}),
    ],
)
def test_bad_sensors_are_refused(name, arguments):
    with pytest.raises(InvalidValue) as error:
        DistanceSensor(**({"name": "s", "link": 0, "T_link_sensor": HERE, "aperture": 1.0} | arguments))
    assert error.value.name == name


@pytest.mark.parametrize(("name", "value"), [("method", "sonar"), ("engine", "optix"), ("count", 0)])
def test_bad_methods_are_refused(name, value):
    with pytest.raises(InvalidValue) as error:
        DistanceSuite([], [], **{"method": "rays", name: value})
    assert error.value.name == name


@pytest.mark.parametrize("method", ["exact", "rays", "thesis"])
def test_the_minimum_range_itself_is_not_too_close(method):
    wall = make_target("wall/slab", 0, grid_of_cubes(1) - [0.5, 0.5, 0.0])
    linkage = Linkage([Link("wall", None, at(0, 0, 0.75), Joint("wall")), Link("x_eye", None, HERE, Joint("x_eye"))])
    least = {0.75: Detection.DETECTED, math.nextafter(0.75, 0.0): Detection.DETECTED, 0.5: Detection.DETECTED}
    least |= {math.nextafter(0.75, 1.0): Detection.TOO_CLOSE, 1.0: Detection.TOO_CLOSE}
    sensors = [DistanceSensor(f"s{k}", 1, HERE, 0.6, min_range=value) for k, value in enumerate(least)]
    columns = DistanceSuite(sensors, [wall], method=method, count=61).run(
        linkage.forward(np.empty((1, 0)), np.empty((1, 0, 4, 4)))
    )
    assert columns.distance[0].tolist() == [0.75] * len(least)
    assert columns.status[0].tolist() == list(least.values())
