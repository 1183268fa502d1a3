"""The bodies and poses that benchmarks ask about are what they are called."""

from __future__ import annotations

import math

import numpy as np
import pytest

from replay.bench import carm, inputs
from replay.bench.goals import PROMISES, Goal, advantage, in_order
from replay.bench.measure import Row
from replay.geometry.solid import signed_volume
from replay.geometry.winding import corner_indices, sides, topology


def test_a_spiral_covers_the_sphere_evenly():
    points = inputs.spiral(1000)
    np.testing.assert_allclose(np.linalg.norm(points, axis=1), 1.0, rtol=0, atol=1e-15)
    np.testing.assert_allclose(points.mean(axis=0), 0.0, rtol=0, atol=2e-3)
    np.testing.assert_allclose(points.T @ points / 1000, np.eye(3) / 3, rtol=0, atol=2e-3)
    gaps = np.linalg.norm(points[:, None] - points[None], axis=2) + 2 * np.eye(1000)
    assert gaps.min() > 0.05  # evenly would be 0.12 from each other
    np.testing.assert_allclose(inputs.ellipsoid(50, (1.0, 2.0, 3.0)), inputs.spiral(50) * (1.0, 2.0, 3.0), rtol=1e-15)


@pytest.mark.parametrize(
    ("count", "major", "minor", "less"), [(200, 0.5, 0.2, 0.25), (5000, 0.5, 0.2, 0.02), (5000, 1.0, 0.1, 0.04)]
)
def test_a_torus_is_closed_outward_and_on_its_surface(count, major, minor, less):
    triangles = inputs.torus(count, major=major, minor=minor)
    assert len(triangles) == pytest.approx(count, rel=0.1)
    assert topology(sides(corner_indices(triangles.round(12))[1])).is_closed
    x, y, z = triangles.reshape(-1, 3).T
    np.testing.assert_allclose(np.hypot(np.hypot(x, y) - major, z), minor, rtol=0, atol=1e-14)
    volume = 2 * math.pi**2 * major * minor**2
    assert (1.0 - less) * volume < signed_volume(triangles) < volume


def test_slivers_are_long_and_thin():
    triangles = inputs.slivers(300)
    longest = np.linalg.norm(triangles[:, 1] - triangles[:, 0], axis=1)
    np.testing.assert_allclose(longest, 0.1, rtol=0, atol=1e-15)
    area = np.linalg.norm(np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1)
    width = area / longest
    assert width.max() <= 1e-2 and width.min() < 1e-7 and np.median(width) < 1e-4
    assert np.abs(triangles[:, 0]).max() <= 0.2


@pytest.mark.parametrize("tilt", [0.0, 0.3])
def test_sensors_look_back_at_the_surface(tilt):
    rng = np.random.default_rng(1)
    points, normals, distance = rng.normal(size=(200, 3)), inputs.unit(rng, 200), rng.uniform(0.1, 2.0, 200)
    poses = inputs.aimed(rng, points, normals, distance, tilt)
    turns = poses[:, :3, :3]
    np.testing.assert_allclose(np.swapaxes(turns, 1, 2) @ turns, np.tile(np.eye(3), (200, 1, 1)), rtol=0, atol=1e-14)
    assert (np.linalg.det(poses[:, :3, :3]) > 0.99).all()
    back = points - poses[:, :3, 3]
    np.testing.assert_allclose(np.linalg.norm(back, axis=1), distance, rtol=1e-13)
    np.testing.assert_allclose(back / distance[:, None], -normals, rtol=0, atol=1e-12)
    angle = np.arccos(np.clip(np.sum(poses[:, :3, 2] * -normals, axis=1), -1, 1))
    assert angle.max() <= tilt + 1e-7 and (tilt == 0.0 or angle.max() > 0.8 * tilt)


def test_poses_around_a_body_are_from_near_to_far_off_its_surface():
    body = inputs.box_surface((1.0, 2.0, 3.0))
    poses = inputs.around(body, 500, near=0.01, far=5.0, tilt=0.0)
    half = np.array([0.5, 1.0, 1.5])
    outside = np.linalg.norm(np.maximum(np.abs(poses[:, :3, 3]) - half, 0.0), axis=1)
    assert 0.01 <= outside.min() < 0.02 and 3.0 < outside.max() <= 5.0
    assert np.median(outside) == pytest.approx(math.sqrt(0.01 * 5.0), rel=0.3)
    flat = np.concatenate([body[:1], body[:1, [0, 0, 0]]])
    assert np.isfinite(inputs.around(flat, 50, near=0.1, far=0.2, tilt=0.1)).all()


def test_the_carm_has_twelve_bodies_that_swing_about_their_places():
    machine, poses = carm.linkage(), carm.poses(200)
    assert len(machine.link_names) == len(carm.bodies()) == len(carm.collision_bodies()) == 12
    assert len(carm.all_pairs()) == 66 and len({pair.name for pair in carm.all_pairs()}) == 66
    for body, named in zip(carm.bodies(), carm.collision_bodies(), strict=True):
        assert named.name == f"{machine.link_names[named.link]}/body"
        np.testing.assert_allclose(np.ptp(named.solid.vertices, axis=0), np.ptp(body.vertices, axis=0), rtol=1e-15)
    column = machine.link_names.index("column")
    heights = poses.world[:, column, 2, 3]
    assert abs(heights - 1.07).max() <= 0.15 and np.ptp(heights) > 0.05
    stand = machine.link_names.index("stand")
    np.testing.assert_allclose(poses.world[:, stand, :3, 3], [(0.0, 0.0, 0.15)] * 200, rtol=0, atol=1e-15)
    assert not np.array_equal(poses.world[0], poses.world[60])


@pytest.mark.parametrize(
    ("key", "measured", "wrong", "verdict"),
    [
        ("gjk.fcl", 3.0, False, "met"),
        ("gjk.fcl", 2.99, False, "missed"),
        ("gjk.fcl", 9.0, True, "wrong"),
        ("gjk.fcl", math.nan, False, "not measured"),
        ("diff.equal", 5.0, False, "met"),
        ("diff.equal", 5.01, False, "missed"),
        ("gjk.wrong", 0.0, False, "met"),
        ("gjk.wrong", 1.0, False, "missed"),
    ],
)
def test_a_goal_is_met_at_its_figure(key, measured, wrong, verdict):
    goal = Goal(key, measured, wrong)
    assert goal.verdict == verdict and goal.failed == (verdict in ("missed", "wrong"))
    assert goal.cells()[-1] == verdict and goal.as_json()["verdict"] == verdict
    assert (goal.as_json()["measured"] is None) == math.isnan(measured)
    assert goal.cells()[2].startswith(">= " if PROMISES[key].at_least else "<= ")


def test_goals_stand_in_the_order_of_the_promises():
    keys = [*PROMISES]
    assert [goal.key for goal in in_order(Goal(key, 1.0) for key in reversed(keys))] == keys
    assert PROMISES["motion.fcl"].target == ">= 10 x (stretch 30)" and PROMISES["gjk.wrong"].target == "<= 0"


def test_an_advantage_is_the_least_over_the_cases_and_nan_where_one_is_absent():
    def rows(*times, failed="", rounds=3):
        return [
            Row(case, method, 2 * time, time, 3 * time, rounds, 0.0, 0, 9, method == failed)
            for case, method, time in times
        ]

    both = rows(("a", "old", 6.0), ("a", "new", 2.0), ("b", "old", 8.0), ("b", "new", 1.0))
    found = advantage("gjk.fcl", both, ("a", "b"), "old", "new")
    assert (found.measured, found.wrong) == (3.0, False)
    assert math.isnan(advantage("gjk.fcl", both[:3], ("a", "b"), "old", "new").measured)
    assert math.isnan(advantage("gjk.fcl", both, (), "old", "new").measured)
    faster = [("a", "old", 6.0), ("a", "new", 2.0)]
    assert advantage("gjk.fcl", rows(*faster, failed="new"), ("a",), "old", "new").wrong
    assert not advantage("gjk.fcl", rows(*faster, failed="old"), ("a",), "old", "new").wrong
    assert math.isnan(advantage("gjk.fcl", rows(*faster, rounds=0), ("a",), "old", "new").measured)
