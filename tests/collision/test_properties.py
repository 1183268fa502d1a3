"""What holds for any two bodies: order, rigid motion, moving apart, and a broad phase that loses nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.collision.columns import Level
from replay.collision.gjk import Convex, Status, distance, distances, intersect, intersects
from replay.collision.pairs import CollisionBody, PairRules
from replay.collision.pipeline import CollisionPipeline
from replay.geometry.hull import convex_hull
from replay.geometry.solid import Solid
from tests.amounts import cases
from tests.collision import motions, reference, scenes

BOUNDS = ("obb", "obb_vertices", "aabb", "sphere")
STEPS = np.array([0.0, 1e-15, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 10.0])
ROUNDING = 1e-14
"""Error of a distance over the scene's size: poses, vertices in a common frame, and the kernel's own 1e-15."""

RELATIVE = 1e-12
"""Error of a distance over itself: GJK stops there, and near-parallel faces use it up."""

ENGINES = {"gjk": 1e-13, "fcl": 2e-6}
"""Error of a clearance over the scene's size; python-fcl stops its iteration at 1e-6."""

seeds = st.integers(0, 2**32 - 1)
kinds = st.sampled_from(["box", "thin box", "hull", "many vertices", "flat", "rod"])
angles = st.sampled_from([0.0, 1e-12, 1e-7, 1e-3, 1.0])
"""How far b is turned from a's own axes: parallel, nearly so, or anyhow."""


def vertices(kind, rng):
    """Return the vertices of a body about the origin."""
    if kind == "box":
        return reference.box(rng.uniform(0.2, 2.0, 3))
    if kind == "thin box":
        return reference.box(10.0 ** rng.uniform(-5, 0, 3))
    points = rng.normal(size=(rng.integers(20, 120) if kind == "many vertices" else rng.integers(4, 10), 3))
    if kind == "flat":
        points[:, 2] = 0.0
    return points[:2] if kind == "rod" else points


def place(rng, angle):
    """Return poses of two bodies somewhere, about 2 m apart, b turned by `angle` from a."""
    pose_a = motions.pose(motions.rotation(rng), rng.normal(size=3) * 10.0 ** rng.integers(-1, 4))
    x, y, z = (axis := rng.normal(size=3)) / np.sqrt((axis**2).sum())
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    turn = pose_a[:3, :3] @ (np.identity(3) + np.sin(angle) * skew + 2.0 * np.sin(angle / 2) ** 2 * skew @ skew)
    return pose_a, motions.pose(turn, pose_a[:3, 3] + 1.2 * rng.normal(size=3))


def moved(pose, direction, way):
    result = pose.copy()
    result[:3, 3] += way * direction
    return result


def way_apart(a, b, pose_a, pose_b, rng):
    """Return b's pose at or outside of a, and the direction that separates them."""
    apart = distance(a, b, pose_a=pose_a, pose_b=pose_b)
    if apart.status is Status.SEPARATED:
        return pose_b, apart.direction
    direction = rng.normal(size=3)
    return pose_b, direction / np.sqrt((direction**2).sum())


@settings(max_examples=cases(150), deadline=None)
@given(kinds, kinds, angles, seeds)
def test_moving_apart_never_brings_nearer(kind_a, kind_b, angle, seed):
    """Along any direction the distance is convex and grows by the way at most; along the separating one it grows."""
    rng = np.random.default_rng(seed)
    a, b = vertices(kind_a, rng), vertices(kind_b, rng)
    pose_a, pose_b = place(rng, angle)
    start = distance(a, b, pose_a=pose_a, pose_b=pose_b)
    pose_b, direction = way_apart(a, b, pose_a, pose_b, rng)
    size = np.abs(a).max() + np.abs(b).max() + np.abs(pose_a[:3, 3] - pose_b[:3, 3]).max() + np.abs(pose_a[:3, 3]).max()
    before, way_before, left = start.distance, 0.0, start.status is Status.SEPARATED
    for way in STEPS:
        there = moved(pose_b, direction, way)
        found = distance(a, b, pose_a=pose_a, pose_b=there)
        verdict = intersect(Convex(a), Convex(b), pose_a=pose_a, pose_b=there)
        slack = ROUNDING * (size + way) + RELATIVE * found.distance
        assert found.status is verdict.status is not Status.UNDECIDED
        assert before - slack <= found.distance <= before + (way - way_before) + slack
        if start.status is Status.SEPARATED:
            assert found.distance >= start.lower_bound + way - slack
        if left and before > slack:  # once apart, apart for good
            assert found.status is Status.SEPARATED
        before, way_before, left = found.distance, way, left or found.status is Status.SEPARATED
    if start.status is Status.SEPARATED and start.lower_bound > 1e-9 * size:  # and the other way, short of the gap
        nearer = moved(pose_b, direction, -0.999 * start.lower_bound)
        assert intersect(a, b, pose_a=pose_a, pose_b=nearer).status is Status.SEPARATED
        touching = moved(pose_b, start.point_a - start.point_b, 1.0)
        assert distance(a, b, pose_a=pose_a, pose_b=touching).distance <= ROUNDING * size


@settings(max_examples=cases(150), deadline=None)
@given(kinds, kinds, angles, seeds)
def test_all_poses_at_once_say_what_one_by_one_does(kind_a, kind_b, angle, seed):
    """The batch works in a's frame, with tables; one by one is about a common origin, without."""
    rng = np.random.default_rng(seed)
    a, b = Convex(vertices(kind_a, rng)), Convex(vertices(kind_b, rng))
    poses = np.stack([place(rng, angle)[1] for _ in range(4)])
    poses[:, :3, 3] = 1.2 * rng.normal(size=(4, 3))
    status, measured = distances(a, b, poses)
    assert (intersects(a, b, poses) == status).all()
    back = np.stack([np.linalg.inv(pose) for pose in poses])
    back[:, 3] = [0.0, 0.0, 0.0, 1.0]
    turned = distances(b, a, back)[1]
    for k, pose in enumerate(poses):
        one = distance(a, b, pose_b=pose)
        size = a.reach + b.reach + np.abs(pose[:3, 3]).max()
        assert measured[k] == pytest.approx(one.distance, rel=1e-12, abs=ROUNDING * size)
        assert turned[k] == pytest.approx(one.distance, rel=1e-12, abs=ROUNDING * size)
        if one.distance > ROUNDING * size:
            assert status[k] == Status.SEPARATED.value


def solid(kind, rng):
    """Return a body as the pipeline takes it, or None for points without a hull."""
    points = vertices(kind, rng)
    hull = convex_hull(points)
    return None if hull is None else Solid(np.ascontiguousarray(points[hull.faces]), pieces=(points,))


@pytest.mark.parametrize("engine", ENGINES)
@settings(max_examples=cases(40), deadline=None)
@given(st.sampled_from(["box", "hull", "many vertices"]), st.sampled_from(["box", "hull"]), angles, seeds)
def test_both_engines_keep_order_motion_and_moving_apart(engine, kind_a, kind_b, angle, seed):
    """One pair in a row of frames: b moves away; then the same with a and b exchanged, and elsewhere in the world."""
    rng = np.random.default_rng(seed)
    a, b = solid(kind_a, rng), solid(kind_b, rng)
    pose_a, pose_b = place(rng, angle)
    pose_b, direction = way_apart(a.vertices, b.vertices, pose_a, pose_b, rng)
    poses = np.stack([np.stack([pose_a, moved(pose_b, direction, way)]) for way in STEPS])
    elsewhere = motions.random_pose(rng, 3.0)
    columns = [
        scenes.run((a, b), poses, clearance="always", narrowphase=engine),
        scenes.run((b, a), poses[:, ::-1], clearance="always", narrowphase=engine),
        scenes.run((a, b), elsewhere @ poses, clearance="always", narrowphase=engine),
    ]
    size = np.abs(a.vertices).max() + np.abs(b.vertices).max() + 15.0 + np.abs(pose_a[:3, 3]).max()
    band = ENGINES[engine] * size
    clearance = columns[0].clearance[:, 0]
    assert (np.diff(clearance) >= -band).all()
    assert (np.diff(clearance) <= np.diff(STEPS) + band).all()
    for other in columns[1:]:
        assert np.allclose(other.clearance[:, 0], clearance, rtol=0.0, atol=band)
        sure = clearance > band
        assert (other.level[sure, 0] != Level.CONTACT).all()


@settings(max_examples=cases(60), deadline=None)
@given(st.lists(kinds, min_size=3, max_size=5), angles, seeds)
def test_no_volume_loses_a_contact(several, angle, seed):
    """Bodies at, in and just off each other over some frames: each volume finds the contacts that no pruning finds."""
    rng = np.random.default_rng(seed)
    solids = [body for body in (solid(kind, rng) for kind in several) if body is not None]
    solids += [Solid(np.ascontiguousarray(rng.normal(size=(4, 3, 3)) * 0.3))]  # loose triangles, no hull
    frames = 6
    poses = np.tile(np.identity(4), (frames, len(solids), 1, 1))
    far = rng.normal(size=3) * 10.0 ** rng.integers(0, 7)
    for k in range(len(solids)):
        here, there = place(rng, angle)
        poses[:, k] = there
        poses[:, k, :3, 3] = far + rng.normal(size=3) + np.linspace(0, rng.uniform(0, 2), frames)[:, None] * here[0, :3]
    for k in range(1, len(solids)):  # bring some to touch the one before, to rounding
        touch = distance(solids[k - 1].vertices, solids[k].vertices, pose_a=poses[3, k - 1], pose_b=poses[3, k])
        poses[3, k, :3, 3] += touch.point_a - touch.point_b
    linkage = scenes.free_links(len(solids))
    bodies = [CollisionBody(f"l{k:03}/s", k, body) for k, body in enumerate(solids)]
    links = linkage.forward(np.zeros((frames, 0)), poses)
    truth = scenes.run(solids, poses, clearance="always").level == Level.CONTACT
    column = {pair: k for k, pair in enumerate((i, j) for i in range(len(solids)) for j in range(i + 1, len(solids)))}
    for bounds in BOUNDS:
        level = scenes.run(solids, poses, clearance="never", bounds=bounds).level
        assert ((level == Level.CONTACT) == truth).all()
        # by the tree over all bodies, whatever their number
        entries = CollisionPipeline(bodies, PairRules(bodies, linkage), linkage, bounds=bounds).contacts(links)
        found = np.zeros_like(truth)
        hits = entries.level == Level.CONTACT
        found[entries.frame[hits], [column[tuple(pair)] for pair in entries.bodies[hits].tolist()]] = True
        assert (found == truth).all()
