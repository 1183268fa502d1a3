"""Pairs on which public libraries failed, as found, moved and scaled."""

import json
from pathlib import Path

import numpy as np
import pytest

from replay.collision.gjk import Status, distance, intersect
from tests.collision import motions, reference

CASES = {case["id"]: case for case in json.loads((Path(__file__).parents[1] / "data/pairs.json").read_text())["cases"]}
ROUNDING = 3e-15
"""Error that mapping vertices into the common frame may leave, over the largest coordinates of bodies and offset: a
coordinate of R p + h rounds by 4 units of 2^-53 of |R| |p| + |h|, |R| |p| <= 3 max|p|, for both bodies."""

SAMPLES = 64  # points on a circle of a cylinder or sphere


def solid(shape):
    """Return the vertices of a shape and the chord error of its sampling."""
    if shape["type"] == "box":
        return reference.box(shape["size"]), 0.0
    if shape["type"] == "hull":
        return np.array(shape["vertices"], dtype=float), 0.0
    radius = shape["radius"]
    turn = 2 * np.pi * np.arange(SAMPLES) / SAMPLES
    if shape["type"] == "cylinder":
        assert shape["axis"] == 2 or shape["axis"] == "z"
        circle = radius * np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
        rise = np.array([0, 0, shape["length"] / 2])
        return np.concatenate([circle - rise, circle + rise]), radius * (1 - np.cos(np.pi / SAMPLES))
    fall = np.pi * np.arange(SAMPLES // 2 + 1) / (SAMPLES // 2)
    points = [(np.sin(f) * np.cos(t), np.sin(f) * np.sin(t), np.cos(f)) for f in fall for t in turn]
    return radius * np.array(points), 2 * radius * (1 - np.cos(np.pi / SAMPLES))


def answers(a, b, pose_a, pose_b):
    """Return the signed answer (distance, 0 for contact), checked for certificates and for both argument orders."""
    separation = distance(a, b, pose_a=pose_a, pose_b=pose_b)
    swapped = distance(b, a, pose_a=pose_b, pose_b=pose_a)
    verdict = intersect(a, b, pose_a=pose_a, pose_b=pose_b)
    assert separation.status is swapped.status is verdict.status is not Status.UNDECIDED
    assert separation.distance == swapped.distance
    assert intersect(b, a, pose_a=pose_b, pose_b=pose_a).status is verdict.status
    assert 0 <= separation.lower_bound <= separation.distance
    size = np.abs(a).max() + np.abs(b).max() + np.abs(pose_a[:3, 3] - pose_b[:3, 3]).max()
    assert separation.distance - separation.lower_bound <= 1e-12 * separation.distance + 2.0**-70 * size
    for value in (separation.point_a, separation.point_b, separation.distance):
        assert np.isfinite(value).all()
    return separation.distance


@pytest.mark.parametrize("name", CASES)
def test_as_found(name):
    case = CASES[name]
    (a, chord_a), (b, chord_b) = solid(case["A"]), solid(case["B"])
    pose_a, pose_b = (motions.pose(case[f"R_{k}"], case[f"p_{k}"]) for k in "AB")
    found = answers(a, b, pose_a, pose_b)
    expected, chord = case["expect"], chord_a + chord_b
    truth = expected.get("signed_distance", expected.get("distance"))
    if truth is not None:
        assert abs(found - max(truth, 0.0)) <= expected["tol"] + chord
        if abs(truth) >= expected["tol"] + chord:
            assert (found > 0.0) == (truth > 0.0)
    if "collide" in expected and not expected.get("touching") and chord == 0.0:
        assert (found == 0.0) == expected["collide"]


@pytest.mark.parametrize("name", [k for k, case in CASES.items() if case["A"]["type"] + case["B"]["type"] in
                                  ("boxbox", "hullhull", "hullbox", "boxhull")])  # fmt: skip
def test_moved_and_scaled(name):
    """Truth comes from the rounded poses in extended precision."""
    case = CASES[name]
    a, b = solid(case["A"])[0], solid(case["B"])[0]
    pose_a, pose_b = (motions.pose(case[f"R_{k}"], case[f"p_{k}"]) for k in "AB")
    rng = np.random.default_rng(0)
    trials = [(1.0, motions.random_pose(rng, reach)) for reach in np.repeat([0.0, 1.0, 1e3, 1e6], 5)]
    trials += [(scale, motions.random_pose(rng, scale)) for scale in (1e-6, 1e-3, 1e3, 1e6)]
    for scale, move in trials:
        to_world = [move @ np.block([[p[:3, :3], scale * p[:3, 3:]], [p[3:]]]) for p in (pose_a, pose_b)]
        origin = to_world[0][:3, 3]
        truth = reference.signed_distance(
            reference.placed(scale * a, to_world[0], origin), reference.placed(scale * b, to_world[1], origin)
        )
        offset = np.abs(to_world[0][:3, 3] - to_world[1][:3, 3]).max()
        size = scale * (np.abs(a).max() + np.abs(b).max()) + offset
        found = answers(scale * a, scale * b, *to_world)
        assert abs(found - max(float(truth), 0.0)) <= ROUNDING * size
        if abs(truth) > ROUNDING * size:
            assert (found > 0.0) == (truth > 0.0)


def run_slivers(n, seed):
    """Bring n random pairs, many as thin as 1:1e6 and nearly parallel, to within 1e-14..0.1 m and check each answer."""
    rng = np.random.default_rng(seed)
    apart = 0
    for _ in range(n):
        a, b = (_sliver(rng) for _ in range(2))
        turn, axis = motions.rotation(rng), rng.normal(size=3)
        x, y, z = axis / np.sqrt((axis**2).sum())
        skew, angle = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), 10.0 ** rng.uniform(-13, 0)
        nearly = turn @ (np.identity(3) + np.sin(angle) * skew + 2 * np.sin(angle / 2) ** 2 * skew @ skew)
        pose_a = motions.pose(turn, rng.normal(size=3) * 10.0 ** rng.integers(-1, 6))
        pose_b = motions.pose(nearly, pose_a[:3, 3] + 2 * rng.normal(size=3))
        separation = distance(a, b, pose_a=pose_a, pose_b=pose_b)
        if separation.status is Status.SEPARATED:
            gap = 10.0 ** rng.uniform(-14, -1) * rng.choice([-1, 1])
            pose_b[:3, 3] -= separation.direction * (separation.distance - gap)
        found = answers(a, b, pose_a, pose_b)
        size = np.abs(a).max() + np.abs(b).max() + np.abs(pose_a[:3, 3] - pose_b[:3, 3]).max()
        if found > 0.0:
            # the witness points bound the distance from above, the direction from below
            direction = distance(a, b, pose_a=pose_a, pose_b=pose_b).direction
            proven = reference.exact_gap(a, b, pose_a, pose_b, direction)
            assert abs(found - proven) <= 1e-12 * found + ROUNDING * size
        else:  # normals of slivers cost the extended precision of the reference its last digits
            origin = pose_a[:3, 3]
            truth = reference.signed_distance(reference.placed(a, pose_a, origin), reference.placed(b, pose_b, origin))
            assert truth <= 1e-14 * size
        apart += found > 0.0
    assert 0.3 < apart / n < 0.8


def _sliver(rng):
    lengths = 10.0 ** rng.uniform(-6, 0, 3)
    return reference.box(lengths) if rng.random() < 0.6 else rng.normal(size=(rng.integers(3, 7), 3)) * lengths


def run_flat_contacts(n, seed):
    """Put boxes, some needles, on each other's faces, parallel to 1e-15..1e-3 rad; a contact's point is in both."""
    rng = np.random.default_rng(seed)
    met = 0
    for _ in range(n):
        sizes = 10.0 ** rng.uniform(-6 if rng.random() < 0.5 else -1, 0, (2, 3))
        axis, angle = rng.normal(size=3), 10.0 ** rng.uniform(-15, -3)
        x, y, z = axis / np.sqrt((axis**2).sum())
        skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        turn = motions.rotation(rng)
        off = rng.uniform(-0.5, 0.5, 3) * sizes.sum(axis=0)
        side = rng.integers(3)
        off[side] = 0.5 * sizes[:, side].sum() * (1 - rng.choice([0, 1e-16, 1e-15, 1e-14, 1e-12, 1e-9]))
        pose_a = motions.pose(turn, rng.normal(size=3))
        nearly = turn @ (np.identity(3) + np.sin(angle) * skew + 2 * np.sin(angle / 2) ** 2 * skew @ skew)
        pose_b = motions.pose(nearly, pose_a[:3, 3] + turn @ off)
        boxes = [reference.box(size) for size in sizes]
        separation = distance(*boxes, pose_a=pose_a, pose_b=pose_b)
        verdict = intersect(*boxes, pose_a=pose_a, pose_b=pose_b)
        assert separation.status is verdict.status is not Status.UNDECIDED
        if verdict.status is Status.CONTACT:
            scene = sizes.max() + np.abs(off).max() + np.abs(pose_a[:3, 3]).max()
            for point in (separation.point_a, verdict.point):
                for size, pose in zip(sizes, (pose_a, pose_b), strict=True):
                    inside = pose[:3, :3].T @ (point - pose[:3, 3])
                    assert (np.abs(inside) <= 0.5 * size + 2e-13 * scene).all()
        met += verdict.status is Status.CONTACT
    assert 0.3 < met / n < 0.9


def test_points_of_flat_contacts_are_in_both_bodies():
    run_flat_contacts(1_500, seed=4)


@pytest.mark.soak
def test_points_of_many_flat_contacts_are_in_both_bodies():
    run_flat_contacts(200_000, seed=5)


def run_sheets(n, seed):
    """Ask about flat polygons in one plane but for the rounding of their corners: nothing stays undecided."""
    rng = np.random.default_rng(seed)
    for _ in range(n):
        tilt = rng.integers(-3, 4, (3, 3)) / rng.integers(1, 8)
        sheets = [np.pad(rng.integers(-3, 4, (rng.integers(3, 8), 2)), ((0, 0), (0, 1))) @ tilt.T for _ in range(2)]
        found = distance(*sheets)
        verdict = intersect(*sheets)
        assert Status.UNDECIDED not in (found.status, verdict.status)
        if found.status is not verdict.status:  # `distance` calls contact what is nearer than 2^-53 of the size, 50 m
            assert max(found.distance, verdict.gap_lower_bound) <= 2.0**-53 * 50.0
        assert found.distance == pytest.approx(distance(*sheets[::-1]).distance, rel=1e-12, abs=2.0**-70 * 50.0)


def test_sheets_in_one_plane_are_decided():
    run_sheets(1_500, seed=6)


@pytest.mark.soak
def test_many_sheets_in_one_plane_are_decided():
    run_sheets(200_000, seed=7)


def test_slivers_near_contact():
    run_slivers(400, seed=1)


@pytest.mark.soak
def test_many_slivers_near_contact():
    run_slivers(20_000, seed=2)
