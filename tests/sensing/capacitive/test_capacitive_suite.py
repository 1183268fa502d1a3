"""Sensors over frames: sums over plates and bodies, sides, faces, contact, reuse, and independence of the place."""

import numpy as np
import pytest

from replay.errors import InvalidValue
from replay.geometry.primitives import cuboid, sphere
from replay.kinematics.linkage import POSE_ROUNDING, Joint, JointType, Link, Linkage
from replay.numerics import transforms
from replay.sensing.capacitive import CapacitiveSensor, CapacitiveSuite, Plate, output_voltage, plate_integral
from replay.sensing.target import make_target

_POSE = transforms.compose(
    transforms.from_translation(np.array([0.02, -0.01, 0.03])), transforms.from_rpy(np.array([0.2, -0.1, 0.4]))
)


def _linkage():
    links = [
        Link("base", None, transforms.identity(), Joint("base", JointType.FREE)),
        Link("body", "base", transforms.identity(), Joint("lift", JointType.PRISMATIC)),
        Link("guard", "base", transforms.identity(), Joint("guard")),
        Link("other", None, transforms.identity(), Joint("other", JointType.FREE)),
    ]
    return Linkage(links)


def _poses(linkage, lifts, base=None, other=(0.5, 0.2, 0.6)):
    free = np.empty((len(lifts), 2, 4, 4))
    free[:, 0] = transforms.identity() if base is None else base
    free[:, 1] = transforms.from_translation(np.array(other))
    return linkage.forward(np.array(lifts, dtype=float)[:, None], free)


def _scene(**options):
    linkage = _linkage()
    body, guard, other = (linkage.link_index(name) for name in ("body", "guard", "other"))
    targets = [
        make_target("body/ball", body, sphere(0.1, 0.004).triangles),
        make_target("guard/cover", guard, cuboid((0.3, 0.3, 0.01)).triangles),
        make_target("other/box", other, cuboid((0.2, 0.3, 0.4)).triangles),
    ]
    plates = (
        Plate("front", _POSE, np.array([0.05, 0.03])),
        Plate("edge", transforms.from_translation(np.array([0.2, 0.0, 0.0])), np.array([0.01, 0.1])),
    )
    sensor = CapacitiveSensor("guard", guard, plates, coupling=10e-12, **options)
    return linkage, targets, sensor


def _brute_force(linkage, targets, sensor, poses, frame):
    result = []
    for target in targets:
        total = 0.0
        for plate in sensor.plates:
            if target.link in (sensor.link, *sensor.ignored_links):
                continue
            T = transforms.compose(
                transforms.invert(plate.T_link_plate), poses.relative(sensor.link, target.link)[frame]
            )
            corners = transforms.apply(T, target.triangles)
            if sensor.faces == "facing":
                normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
                corners = corners[(normals * corners[:, 0]).sum(axis=1) < 0]
            total += plate_integral(corners, plate.half_size, side=sensor.side).sum()
        result.append(sensor.permittivity * total)
    return np.array(result)


@pytest.mark.parametrize("side", ["front", "both"])
@pytest.mark.parametrize("faces", ["all", "facing"])
def test_a_reading_is_the_sum_over_plates_and_triangles(side, faces):
    linkage, targets, sensor = _scene(side=side, faces=faces)
    poses = _poses(linkage, [0.15, 0.25, 0.6])
    exact = CapacitiveSuite([sensor], targets, method="exact").run(poses)
    tree = CapacitiveSuite([sensor], targets, rtol=1e-7).run(poses)
    for frame in range(3):
        expected = _brute_force(linkage, targets, sensor, poses, frame)
        np.testing.assert_allclose(exact.per_object[frame, 0], expected, rtol=1e-12)
    assert (exact.per_object[:, 0, 1] == 0.0).all()  # the own link
    np.testing.assert_allclose(exact.capacitance[:, 0], exact.per_object[:, 0].sum(axis=1), rtol=1e-15)
    np.testing.assert_allclose(tree.per_object, exact.per_object, rtol=1e-7)
    np.testing.assert_array_equal(exact.output_voltage, output_voltage(exact.capacitance, coupling=10e-12))
    np.testing.assert_array_equal(exact.delta_output, 2.5 - exact.output_voltage)
    assert not exact.saturated.any()
    assert not exact.touching.any()


def test_ignored_links_contribute_nothing():
    linkage, targets, sensor = _scene()
    deaf = CapacitiveSensor(
        "deaf", sensor.link, sensor.plates, coupling=1e-12, ignored_links=frozenset({linkage.link_index("other")})
    )
    columns = CapacitiveSuite([sensor, deaf], targets).run(_poses(linkage, [0.3]))
    assert columns.per_object[0, 1, 2] == 0.0
    assert columns.per_object[0, 1, 0] == columns.per_object[0, 0, 0] > 0.0


@pytest.mark.parametrize("method", ["tree", "exact", "midpoint"])
def test_a_body_through_the_plate_saturates_and_one_that_rests_on_a_corner_only_touches(method):
    linkage = _linkage()
    guard, body = linkage.link_index("guard"), linkage.link_index("body")
    plate = Plate("front", transforms.identity(), np.array([0.05, 0.03]))
    sensor = CapacitiveSensor("guard", guard, (plate,), coupling=10e-12)
    tip = np.array([[[0.0, 0.0, 0.0], [-0.02, 0.0, 0.05], [0.02, 0.01, 0.05]]])
    suite = CapacitiveSuite([sensor], [make_target("body/tip", body, tip)], method=method, splits=2)
    columns = suite.run(_poses(linkage, [0.01, 0.0, -0.01]))
    assert columns.touching[:, 0].tolist() == [False, True, True]
    assert columns.saturated[:, 0].tolist() == [False, False, True]
    assert columns.output_voltage[2, 0] == 0.0
    assert columns.delta_output[2, 0] == 2.5
    assert np.isinf(columns.capacitance[2, 0])
    assert (columns.output_voltage[:2, 0] > 0.0).all()


@pytest.mark.parametrize("method", ["tree", "exact", "midpoint"])
def test_a_face_flush_with_the_plate_up_to_rounding_is_in_its_plane_whatever_carries_both(method):
    # its height came out as 0, or a last digit before or behind the plate: nothing, 1e15 times too much, or nothing
    rng = np.random.default_rng(6)
    block = cuboid((0.6, 0.8, 0.4)).triangles
    readings = []
    for turn in rng.uniform(-3.0, 3.0, (8, 3)).round(1):
        steps = rng.uniform(-2.0, 2.0, (3, 3)).round(1)
        first = transforms.compose(
            transforms.from_translation(steps[0]), transforms.from_axis_angle(np.array([0.0, 0.0, 1.0]), turn[0])
        )
        second = transforms.from_translation(steps[1])
        flush = transforms.compose(
            transforms.compose(first, second), transforms.from_translation(np.array([0.01, 0.02, -0.2]))
        )
        flush[:3, 3] -= steps[2]
        linkage = Linkage(
            [
                Link("arm", None, first, Joint("arm")),
                Link("block", "arm", second, Joint("block")),
                Link("stand", None, transforms.from_translation(steps[2]), Joint("stand")),
            ]
        )
        plates = (Plate("p", flush, np.array([0.1, 0.15])),)
        sensors = [CapacitiveSensor(side, 2, plates, coupling=10e-12, side=side) for side in ("both", "front")]
        suite = CapacitiveSuite(sensors, [make_target("block/skin", 1, block)], method=method, splits=3)
        columns = suite.run(linkage.forward(np.empty((1, 0)), np.empty((1, 0, 4, 4))))
        assert columns.touching.tolist() == [[True, True]]
        if method != "midpoint":
            assert columns.saturated.tolist() == [[True, False]]
        readings.append(columns.capacitance[0, 1])
    np.testing.assert_allclose(readings, readings[0], rtol=1e-6)


@pytest.mark.parametrize("method", ["tree", "exact"])
def test_a_face_whose_plane_holds_the_plate_centre_up_to_rounding_does_not_face_it(method):
    rng = np.random.default_rng(8)
    block = cuboid((0.2, 0.4, 0.3)).triangles
    readings = []
    for steps in rng.uniform(-2.0, 2.0, (12, 3, 3)).round(2):
        edge_on = transforms.from_translation(
            steps[0] + steps[1] + [0.1, 0.4, -0.05] - steps[2]
        )  # in the plane of the side +x
        linkage = Linkage(
            [
                Link("arm", None, transforms.from_translation(steps[0]), Joint("arm")),
                Link("block", "arm", transforms.from_translation(steps[1]), Joint("block")),
                Link("stand", None, transforms.from_translation(steps[2]), Joint("stand")),
            ]
        )
        plates = (Plate("p", edge_on, np.array([0.1, 0.15])),)
        sensor = CapacitiveSensor("s", 2, plates, coupling=10e-12, side="both", faces="facing")
        suite = CapacitiveSuite([sensor], [make_target("block/skin", 1, block)], method=method)
        readings.append(suite.run(linkage.forward(np.empty((1, 0)), np.empty((1, 0, 4, 4)))).capacitance[0, 0])
    np.testing.assert_allclose(readings, readings[0], rtol=1e-6)


@pytest.mark.parametrize("method", ["tree", "exact"])
def test_a_wall_that_a_plate_abuts_on_up_to_rounding_saturates_it(method):
    # the wall stood a last digit inside the plate, on its edge, or beyond it: then the reading was finite
    rng = np.random.default_rng(9)
    wall = cuboid((0.2, 0.8, 0.6)).triangles
    for steps in rng.uniform(-2.0, 2.0, (12, 3, 3)).round(2):
        beside = transforms.from_translation(steps[0] + steps[1] + [-0.3, 0.05, 0.1] - steps[2])
        linkage = Linkage(
            [
                Link("arm", None, transforms.from_translation(steps[0]), Joint("arm")),
                Link("stand", None, transforms.from_translation(steps[2]), Joint("stand")),
                Link("wall", "arm", transforms.from_translation(steps[1]), Joint("wall")),
            ]
        )
        sensor = CapacitiveSensor("s", 1, (Plate("p", beside, np.array([0.2, 0.1])),), coupling=10e-12)
        suite = CapacitiveSuite([sensor], [make_target("wall/skin", 2, wall)], method=method)
        columns = suite.run(linkage.forward(np.empty((1, 0)), np.empty((1, 0, 4, 4))))
        assert columns.saturated.all() and columns.touching.all()


@pytest.mark.parametrize("method", ["tree", "exact", "midpoint"])
def test_a_body_that_does_not_touch_leaves_the_touch_of_another(method):
    linkage = _linkage()
    guard, body, other = (linkage.link_index(name) for name in ("guard", "body", "other"))
    sensor = CapacitiveSensor("s", guard, (Plate("p", transforms.identity(), np.array([0.05, 0.03])),), coupling=1e-12)
    tip = np.array([[[0.0, 0.0, 0.0], [-0.02, 0.0, 0.05], [0.02, 0.01, 0.05]]])
    near, away = make_target("body/tip", body, tip), make_target("other/box", other, cuboid((0.2, 0.3, 0.4)).triangles)
    for targets in ([near, away], [away, near], [near, near], [away]):
        suite = CapacitiveSuite([sensor], targets, method=method, splits=1)
        columns = suite.run(_poses(linkage, [0.01, 0.0, 0.02]))
        assert columns.touching[:, 0].tolist() == [False, near in targets, False]


def test_rounding_counts_the_way_the_plate_s_place_and_the_body_s_size():
    linkage, targets, _ = _scene()

    def rounding(*places, way=0.0, size=1.0):
        plates = tuple(
            Plate(f"p{k}", transforms.from_translation(np.array(place)), np.array([0.1, 0.1]))
            for k, place in enumerate(places)
        )
        sensor = CapacitiveSensor("s", linkage.link_index("guard"), plates, coupling=1e-12)
        body = make_target("body/box", targets[0].link, cuboid((size, 0.5, 0.25)).triangles)
        return CapacitiveSuite([sensor], [body])._rounding(0, 0, np.array([way, 2.0 * way])) / POSE_ROUNDING

    assert rounding([0.0, 0.0, 0.0]).tolist() == [0.5, 0.5]
    assert rounding([3.0, -4.0, 1.0]).tolist() == [8.5, 8.5]
    assert rounding([3.0, -4.0, 1.0], [0.0, 20.0, 0.0], [1.0, 0.0, 0.0]).tolist() == [20.5, 20.5]
    assert rounding([3.0, -4.0, 1.0], way=16.0).tolist() == [24.5, 40.5]
    assert rounding([3.0, -4.0, 1.0], way=16.0, size=64.0).tolist() == [56.0, 72.0]


def test_a_machine_far_from_the_origin_reads_the_same():
    linkage, targets, sensor = _scene()
    deaf = CapacitiveSensor(
        "near", sensor.link, sensor.plates, coupling=1e-12, ignored_links=frozenset({linkage.link_index("other")})
    )
    suite = CapacitiveSuite([deaf], targets)
    here = suite.run(_poses(linkage, [0.2, 0.4]))
    away = transforms.compose(transforms.from_translation(np.array([1e3, -2e6, 5.0])), _POSE)
    there = suite.run(_poses(linkage, [0.2, 0.4], base=away))
    np.testing.assert_array_equal(here.capacitance, there.capacitance)


@pytest.mark.parametrize("method", ["tree", "exact", "midpoint"])
@pytest.mark.parametrize("faces", ["all", "facing"])
def test_a_scene_of_any_size_reads_in_proportion(method, faces):
    linkage = _linkage()
    guard, body = linkage.link_index("guard"), linkage.link_index("body")

    def run(size):
        plate = Plate("front", transforms.identity(), size * np.array([0.05, 0.03]))
        sensor = CapacitiveSensor("guard", guard, (plate,), coupling=1e-12, faces=faces)
        target = make_target("body/ball", body, size * sphere(0.1, 0.004).triangles)
        suite = CapacitiveSuite([sensor], [target], method=method, splits=1)
        free = transforms.identity()[None, None].repeat(2, axis=1)
        return suite.run(linkage.forward(size * np.array([[0.11]]), free)).capacitance[0, 0] / size

    for size in (2.0**-400, 2.0**200):
        assert run(size) == run(1.0) > 0.0
    # squares of lengths vanish there, so the body's tree may be another one
    assert run(2.0**-600) == pytest.approx(run(1.0), rel=1e-6)


def test_frames_do_not_depend_on_each_other_and_a_dwell_repeats_the_reading():
    linkage, targets, sensor = _scene()
    suite = CapacitiveSuite([sensor], targets)
    lifts = [0.3, 0.3, 0.2, 0.3, 0.4]
    together = suite.run(_poses(linkage, lifts)).per_object
    alone = np.concatenate([suite.run(_poses(linkage, [lift])).per_object for lift in lifts])
    np.testing.assert_array_equal(together, alone)
    assert suite.run(_poses(linkage, [])).capacitance.shape == (0, 1)


def test_midpoint_is_the_sum_of_the_thesis_and_comes_near_exact():
    linkage, targets, sensor = _scene()
    poses = _poses(linkage, [0.3])
    exact = CapacitiveSuite([sensor], targets, method="exact").run(poses).capacitance
    coarse, fine = (
        CapacitiveSuite([sensor], targets, method="midpoint", splits=n).run(poses).capacitance for n in (0, 4)
    )
    assert abs(fine - exact) < abs(coarse - exact)
    np.testing.assert_allclose(fine, exact, rtol=1e-3)


@pytest.mark.parametrize(
    "options", [{"method": "sum"}, {"rtol": 0.0}, {"rtol": np.nan}, {"rtol": 2.0}, {"splits": -1}, {"splits": 99}]
)
def test_bad_options_are_refused(options):
    with pytest.raises(InvalidValue):
        CapacitiveSuite([], [], **options)


def test_bad_sensors_and_plates_are_refused():
    plate = Plate("p", transforms.identity(), np.array([0.1, 0.1]))
    for options in (
        {"plates": ()},
        {"coupling": 0.0},
        {"coupling": 1e-12, "permittivity": -1.0},
        {"coupling": 1e-12, "supply": np.inf},
        {"coupling": 1e-12, "side": "back"},
        {"coupling": 1e-12, "faces": "none"},
    ):
        with pytest.raises(InvalidValue):
            CapacitiveSensor("s", 0, **{"plates": (plate,), "coupling": 1e-12, **options})
    with pytest.raises(InvalidValue):
        Plate("p", np.eye(3), np.array([0.1, 0.1]))
    with pytest.raises(InvalidValue):
        Plate("p", 2.0 * np.eye(4), np.array([0.1, 0.1]))
    with pytest.raises(InvalidValue):
        Plate("p", transforms.identity(), np.array([0.1, -0.1]))
