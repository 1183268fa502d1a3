"""The other models of the sensor: right where they should be, and wrong where they are known to be."""

import math
import sys

import numpy as np
import pytest

from replay.errors import MissingPackageError
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.numerics import transforms
from replay.sensing.distance import DistanceSensor, DistanceSuite
from replay.sensing.distance.columns import Detection
from replay.sensing.distance.rays import cap_directions
from replay.sensing.target import make_target
from tests.sensing.distance.cone_families import FAMILIES
from tests.sensing.distance.meshes import torus


def readings(triangles, axes, aperture, **model):
    """Read n single triangles, one a frame: frame i turns the sensor to axis i and only triangle i is in the scene."""
    linkage = Linkage([Link("body", None, transforms.identity(), Joint("body")), _free("sensor")])
    columns = []
    for triangle, axis, opening in zip(triangles, axes, aperture, strict=True):
        poses = linkage.forward(np.empty((1, 0)), facing(axis)[None, None])
        sensor = DistanceSensor("s", 1, transforms.identity(), opening)
        columns.append(DistanceSuite([sensor], [make_target("body/t", 0, triangle[None])], **model).run(poses))
    distance = np.concatenate([column.distance[:, 0] for column in columns])
    return distance, np.concatenate([column.case[:, 0] for column in columns])


def _free(name):
    return Link(name, None, transforms.identity(), Joint(name, JointType.FREE))


def facing(axis):
    """A pose at the origin whose z axis is the given unit vector."""
    pose = transforms.identity()
    side = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    pose[:3, 0] = side / np.linalg.norm(side)
    pose[:3, 1] = np.cross(axis, pose[:3, 0])
    pose[:3, 2] = axis
    return pose


def orbit(frames):
    """Sensors looking at the origin from all around, and a body at the origin."""
    linkage = Linkage([Link("body", None, transforms.identity(), Joint("body")), _free("sensor")])
    rng = np.random.default_rng(5)
    poses = np.empty((frames, 1, 4, 4))
    for frame in range(frames):
        away = rng.normal(size=3)
        away /= np.linalg.norm(away)
        poses[frame, 0] = facing(-away)
        poses[frame, 0, :3, 3] = 3.0 * away
    return linkage.forward(np.empty((frames, 0)), poses)


def test_thesis_agrees_with_exact_where_its_steps_hold():
    triangles, axes, apertures = FAMILIES["random"](np.random.default_rng(3), 150)
    exact, exact_case = readings(triangles, axes, apertures)
    thesis, case = readings(triangles, axes, apertures, method="thesis")
    wrong = ~np.isclose(thesis, exact, rtol=1e-9, equal_nan=True)
    assert np.mean(wrong) < 0.1
    assert (exact_case[wrong] == 2).all()  # S behind the apex: step 2 is what fails
    np.testing.assert_array_equal(case[~wrong], exact_case[~wrong])


def test_thesis_fails_as_documented_and_never_reads_nonsense():
    wrong = {}
    for name, family in FAMILIES.items():
        triangles, axes, apertures = family(np.random.default_rng(4), 40)
        exact, _ = readings(triangles, axes, apertures)
        thesis, case = readings(triangles, axes, apertures, method="thesis")
        assert (np.isnan(thesis) == (case == 0)).all()
        assert not (thesis < 0.0).any()
        wrong[name] = np.mean(~np.isclose(thesis, exact, rtol=1e-6, atol=1e-9, equal_nan=True))
    assert wrong["parallel"] > 0.1  # S at infinity
    assert wrong["behind_s"] > 0.1

    triangles, axes, _ = FAMILIES["narrow"](np.random.default_rng(4), 60)
    needles, _ = readings(triangles, axes, np.full(60, 1e-9), method="thesis")
    assert 0.1 < np.mean(np.isnan(needles)) < 0.6  # cos h is 1, and rounding says whether there is a root


@pytest.mark.parametrize("aperture", [1e-8, 0.5, math.pi, 5.0, 2.0 * math.pi])
def test_rays_fill_the_cap_evenly(aperture):
    rays = cap_directions(aperture, 1000)
    np.testing.assert_allclose(np.sum(rays * rays, axis=1), 1.0, atol=1e-15)
    np.testing.assert_array_equal(rays[0], [0, 0, 1])
    angle = np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])
    assert angle.max() == pytest.approx(0.5 * aperture, rel=1e-7)
    assert (np.diff(angle) > -1e-12).all()
    within = np.mean(angle <= 0.25 * aperture)  # the share of the cap's area within half its half angle
    assert within == pytest.approx((math.sin(0.125 * aperture) / math.sin(0.25 * aperture)) ** 2, abs=2e-3)
    np.testing.assert_array_equal(cap_directions(aperture, 1), [[0, 0, 1]])


def test_rays_are_never_too_near_and_close_in_with_their_number():
    poses = orbit(60)
    sensor = DistanceSensor("s", 1, transforms.identity(), 0.3)
    target = make_target("body/torus", 0, torus(60, 30))
    exact = DistanceSuite([sensor], [target]).run(poses).distance[:, 0]
    errors = []
    for count in (1, 61, 1000):
        columns = DistanceSuite([sensor], [target], method="rays", count=count).run(poses)
        rays = columns.distance[:, 0]
        assert not (rays < exact - 1e-12).any()
        hit = np.isfinite(rays)
        assert (columns.case == 0).all()
        np.testing.assert_array_equal(columns.status[:, 0] == Detection.DETECTED, hit)
        errors.append(np.mean(np.where(hit, rays - exact, 1.0)[np.isfinite(exact)]))
    assert errors[0] > 3.0 * errors[1] > 9.0 * errors[2] > 0.0


def test_a_ray_in_the_plane_of_a_triangle_hits_nothing():
    # the sensor stands in the triangles' plane beside them and looks along it: rays met the plane at noise
    rng = np.random.default_rng(2)
    places = 0.1 * rng.integers(-3, 4, (300, 3, 2)) - 0.025 * rng.integers(-12, 13, (300, 1, 2))
    triangles = np.stack([places[..., 0] * math.cos(0.6), places[..., 1], places[..., 0] * math.sin(0.6)], axis=-1)
    down = np.tile([0.0, -1.0, 0.0], (300, 1))
    beside = readings(triangles, down, np.full(300, 2.0 * math.pi))[0] > 0.0
    assert beside.sum() > 200
    assert np.isnan(readings(triangles, down, np.full(300, 0.17), method="rays", count=7)[0][beside]).all()


def test_rays_meet_a_wall_across_the_axis_where_it_is():
    for reach in (0.1, 0.3, 0.7, 1.1, 1.0 / 3.0):
        wall = np.array([[-0.3, -0.7, reach], [0.25, -0.7, reach], [0.2, 0.9, reach]])
        assert readings([wall], [[0.0, 0.0, 1.0]], [0.2], method="rays", count=7)[0] == reach


def test_thesis_reads_nothing_on_an_edge_along_the_border():
    # the first edges run along the border of a cone of 90 deg about z: their leading coefficient was rounding, not 0
    triangles = [
        [[0.4, 0.5, 0.5], [0.7, 0.5, 0.2], [0.6, 1.0, -0.2]],
        [[-0.8, 0.1, -0.5], [-0.2, 0.1, 0.1], [-0.1, 0.9, -1.2]],
        [[0.2, -0.2, 0.2], [-0.1, -0.2, 0.5], [1.0, -1.0, -0.5]],
    ]
    axes, apertures = np.tile([0.0, 0.0, 1.0], (3, 1)), np.full(3, 0.5 * math.pi)
    thesis, _ = readings(np.array(triangles), axes, apertures, method="thesis")
    assert np.isnan(thesis[:2]).all()
    assert thesis[2] > readings(np.array(triangles), axes, apertures)[0][2]  # too far, as documented


def test_own_rays_and_embree_shoot_the_same_bundle():
    poses = orbit(40)
    sensor = DistanceSensor("s", 1, transforms.identity(), 0.5, range=3.5)
    targets = [make_target("body/torus", 0, torus(50, 24)), make_target("body/knob", 0, 0.5 * torus(12, 8))]
    own = DistanceSuite([sensor], targets, method="rays", count=217).run(poses)
    embree = DistanceSuite([sensor], targets, method="rays", count=217, engine="embree").run(poses)
    np.testing.assert_array_equal(own.status, embree.status)
    np.testing.assert_allclose(own.distance, embree.distance, rtol=1e-5)
    np.testing.assert_allclose(own.point, embree.point, atol=1e-3)
    assert np.mean(own.shape == embree.shape) > 0.9


def test_a_missing_engine_is_an_error(monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.mesh_construction", None)
    with pytest.raises(MissingPackageError, match="embreex"):
        DistanceSuite([], [make_target("a/b", 0, torus(3, 3))], method="rays", engine="embree")
