"""Levels and clearances of whole scenes against brute force, and savings that must not show."""

import numpy as np
import pytest

from replay.collision.columns import Level
from replay.collision.gjk import distance
from replay.collision.pairs import CollisionBody, Pair
from replay.collision.pipeline import CollisionPipeline
from replay.collision.relative import RelativePoses
from replay.errors import InvalidValue
from replay.geometry.containment import contains
from replay.geometry.mesh import solid_from_triangles
from replay.geometry.primitives import arc, cube, cuboid, cylinder, plane, sphere
from replay.geometry.solid import Solid
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.numerics import transforms
from tests.collision import motions, scenes

BOUNDS = ("obb", "obb_vertices", "aabb", "sphere")


def drift(rng, frames, bodies, reach):
    """Return smooth random poses (frames, bodies, 4, 4)."""
    ends = rng.normal(size=(2, bodies, 3)) * reach
    share = np.linspace(0, 1, frames)[:, None, None]
    poses = transforms.from_translation((1 - share) * ends[0] + share * ends[1])
    for k in range(bodies):
        axis = rng.normal(size=3)
        turn = transforms.from_axis_angle(axis / np.sqrt((axis**2).sum()), np.linspace(0, rng.uniform(0, 2), frames))
        poses[:, k] = transforms.compose(poses[:, k], turn)
    return poses


def parts(solid):
    return solid.pieces or tuple(solid.triangles)


def brute_force(a, b, pose_a, pose_b):
    """Return the distance of two solids, every part against every part, and every corner against a closed surface."""
    T_a_b = transforms.compose(transforms.invert(pose_a), pose_b)
    best = min(distance(p, q, pose_b=T_a_b).distance for p in parts(a) for q in parts(b))
    if not a.pieces and a.watertight and contains(a.triangles, transforms.apply(T_a_b, b.vertices)).any():
        return 0.0
    if (
        not b.pieces
        and b.watertight
        and contains(b.triangles, transforms.apply(transforms.invert(T_a_b), a.vertices)).any()
    ):
        return 0.0
    return best


def concave():
    """Return an L of 28 triangles that is collided by its triangles."""
    long, short = cuboid((0.2, 0.2, 1.0)).triangles, cuboid((0.6, 0.2, 0.2)).triangles + np.array([0.2, 0, 0.6])
    return Solid(np.concatenate([long, short + np.array([0.0, 0, 1e-3])]))


SOLIDS = (
    cube(0.4),
    cylinder(0.2, 0.5, 0.02),
    arc(0.6, 2.0, 0.1, 0.1, 0.03),
    concave(),
    plane((0.5, 0.3)),
    sphere(0.2, 0.002),  # enough vertices for a table
)


@pytest.mark.compiled
def test_levels_and_clearances_agree_with_brute_force():
    rng = np.random.default_rng(5)
    poses = drift(rng, 12, len(SOLIDS), 0.2)
    columns = scenes.run(SOLIDS, poses, clearance="always")
    near = scenes.run(SOLIDS, poses, clearance="near", margin=0.1)
    never = scenes.run(SOLIDS, poses, clearance="never")
    pairs = [(i, j) for i in range(len(SOLIDS)) for j in range(i + 1, len(SOLIDS))]
    touched = 0
    for p, (i, j) in enumerate(pairs):
        for f in range(0, len(poses), 3):
            truth = brute_force(SOLIDS[i], SOLIDS[j], poses[f, i], poses[f, j])
            touched += truth == 0.0
            assert columns.clearance[f, p] == pytest.approx(truth, rel=1e-12, abs=1e-13)
            assert (columns.level[f, p] == Level.CONTACT) == (truth == 0.0)
            if truth <= 0.1:
                assert near.clearance[f, p] == pytest.approx(truth, rel=1e-12, abs=1e-13)
            else:
                assert np.isnan(near.clearance[f, p])
    assert 0.2 < touched / (4 * len(pairs)) < 0.8
    assert (near.level == columns.level).all()
    assert (never.level == columns.level).all()
    assert columns.evaluated.all()
    assert not never.evaluated.any()
    assert (near.evaluated == ~np.isnan(near.clearance)).all()
    assert not columns.undecided.any()


@pytest.mark.parametrize("bounds", BOUNDS)
@pytest.mark.compiled
def test_bounds_level_is_what_the_volumes_say_and_loses_no_contact(bounds):
    rng = np.random.default_rng(6)
    poses = drift(rng, 60, len(SOLIDS), 0.5)
    level = scenes.run(SOLIDS, poses, clearance="never", bounds=bounds).level
    reference_level = scenes.run(SOLIDS, poses, clearance="never").level
    assert ((level == Level.CONTACT) == (reference_level == Level.CONTACT)).all()
    assert (level == Level.BOUNDS).any()
    if bounds != "sphere":
        return
    spheres = scenes.pipeline(SOLIDS, bounds=bounds)[0]._volumes
    pairs = [(i, j) for i in range(len(SOLIDS)) for j in range(i + 1, len(SOLIDS))]
    for p, (i, j) in enumerate(pairs):
        centers = [transforms.apply(poses[:, k], spheres.center[k]) for k in (i, j)]
        gap = np.sqrt(((centers[0] - centers[1]) ** 2).sum(axis=1)) - spheres.radius[i] - spheres.radius[j]
        sure = np.abs(gap) > 1e-12
        assert ((level[:, p] > Level.CLEAR) == (gap < 0))[sure].all()


def test_world_boxes_follow_the_world():
    """Two cubes, side by side along a diagonal: their boxes along the axes meet only when both are turned."""
    square = transforms.from_axis_angle(np.array([0.0, 0, 1]), np.array([0.0, np.pi / 4]))
    poses = transforms.identity(2, 2)
    poses[:, 1, 0, 3] = 1.2
    poses = transforms.compose(square[:, None], poses)
    level = scenes.run((cube(1.0), cube(1.0)), poses, bounds="aabb").level[:, 0]
    assert level.tolist() == [Level.CLEAR, Level.BOUNDS]


@pytest.mark.compiled
def test_savings_do_not_show():
    """Blocks cut elsewhere, dwells, and frames in another order give the same levels and clearances."""
    rng = np.random.default_rng(7)
    poses = drift(rng, 40, len(SOLIDS), 0.4)
    poses = np.concatenate([poses[:20], np.repeat(poses[19:20], 15, axis=0), poses[20:]])
    engine, linkage = scenes.pipeline(SOLIDS, clearance="always")
    links = linkage.forward(np.zeros((len(poses), 0)), poses)
    whole = engine.run(links)
    assert engine.counters.repeated == 15 * len(engine.pairs)
    first = engine.run(links.slice(0, 23))
    rest = engine.run(links.slice(23, len(poses)))
    for name in ("level", "evaluated", "undecided"):
        assert (np.concatenate([getattr(first, name), getattr(rest, name)]) == getattr(whole, name)).all()
    cut = np.concatenate([first.clearance, rest.clearance])
    assert np.allclose(cut, whole.clearance, rtol=1e-12, atol=1e-13)
    again = engine.run(links)
    assert (again.clearance == whole.clearance).all()
    backwards = engine.run(linkage.forward(np.zeros((len(poses), 0)), poses[::-1]))
    assert (backwards.level[::-1] == whole.level).all()
    assert np.allclose(backwards.clearance[::-1], whole.clearance, rtol=1e-12, atol=1e-13)


def test_counters_add_up():
    rng = np.random.default_rng(8)
    poses = drift(rng, 50, 8, 0.9)
    engine, linkage = scenes.pipeline([cube(0.5)] * 8, clearance="near", margin=0.05)
    columns = engine.run(linkage.forward(np.zeros((50, 0)), poses))
    counters = engine.counters
    settled = counters.pruned_by_block + counters.pruned_by_sphere + counters.pruned_by_volume
    assert settled + counters.repeated + counters.narrow == counters.pair_frames == columns.level.size
    assert counters.contacts == (columns.level == Level.CONTACT).sum() > 0
    assert min(counters.pruned_by_block, counters.pruned_by_sphere, counters.gjk_queries) > 0
    assert counters.undecided == 0


def test_static_pairs_are_evaluated_once():
    fixed = Joint("", JointType.FIXED)
    joints = [Joint("base"), Joint("tip", JointType.FIXED), Joint("free", JointType.FREE)]
    at = transforms.from_translation
    linkage = Linkage(
        [
            Link("a", None, at(np.zeros(3)), joints[2]),
            Link("b", "a", at(np.array([0.0, 0, 2])), fixed),
            Link("c", "b", at(np.array([0.0, 0, -0.9])), joints[1]),
        ]
    )
    bodies = [CollisionBody("a/s", 0, cube(1.0)), CollisionBody("c/s", 2, cube(1.0))]
    engine = CollisionPipeline(bodies, [Pair("a/s|c/s", 0, 1, static=True)], linkage, margin=0.2)
    poses = linkage.forward(np.zeros((30, 0)), drift(np.random.default_rng(9), 30, 1, 100.0))
    for _ in range(2):
        columns = engine.run(poses)
        assert np.allclose(columns.clearance, 0.1, rtol=1e-12)
        assert (columns.clearance == columns.clearance[0]).all()
    assert engine.counters.static == 60
    assert engine.counters.narrow == 1


def test_a_body_wholly_inside_another_is_in_contact():
    shell = Solid(sphere(1.0, 0.05).triangles)  # collided by its triangles
    rooms = Solid(np.concatenate([cube(0.2).triangles + np.array([k, 0, 0]) for k in (0.0, 5.0)]))
    poses = transforms.identity(3, 2)
    poses[:, 1, 0, 3] = [0.0, 3.0, -5.0]
    for solids, order in (((shell, cube(0.1)), [2, 0, 0]), ((shell, rooms), [2, 0, 2]), ((shell, shell), [2, 0, 0])):
        for turned in (False, True):
            chosen, there = (solids[::-1], poses[:, ::-1]) if turned else (solids, poses)
            columns = scenes.run(chosen, there, clearance="near")
            assert (columns.level[:, 0] == 2).tolist() == [k == 2 for k in order]


def test_a_body_wholly_inside_a_mesh_with_a_hole_is_in_contact_and_one_beside_a_sheet_is_not():
    # a ball in the middle of a cube that lacks a triangle read no contact
    holed = solid_from_triangles(np.delete(sphere(1.0, 0.05).triangles, 7, axis=0))
    sheet = solid_from_triangles(cube(2.0).triangles[:2])
    closed = Solid(sphere(1.0, 0.05).triangles)
    poses = transforms.identity(3, 2)
    poses[:, :, :3, 3] = np.random.default_rng(4).normal(size=(3, 1, 3))
    poses[:, 1, 0, 3] += [0.1, 0.2, 3.0]
    small = Solid(cube(0.1).triangles)
    for solids, order in (((closed, small), [2, 2, 0]), ((holed, small), [2, 2, 0]), ((sheet, small), [0, 0, 0])):
        for chosen, there in ((solids, poses), (solids[::-1], poses[:, ::-1])):
            columns = scenes.run(chosen, there, clearance="near")
            assert (columns.level[:, 0] == 2).tolist() == [k == 2 for k in order]
    both = scenes.run((closed, holed, small), np.insert(poses, 1, poses[:, 0], axis=1), clearance="near")
    assert (both.level == 2).all(axis=1).tolist() == [True, True, False]


def test_far_from_the_world_origin_reads_the_same():
    rng = np.random.default_rng(10)
    linkage = Linkage(
        [
            Link("base", None, np.identity(4), Joint("base", JointType.FREE)),
            Link("low", "base", np.identity(4), Joint("low")),
            Link("turn", "base", np.identity(4), Joint("turn", JointType.REVOLUTE)),
        ]
    )
    bodies = [CollisionBody("low/s", 1, cube(0.5)), CollisionBody("turn/s", 2, cylinder(0.2, 2.0, 0.01))]
    engine = CollisionPipeline(bodies, [Pair("p", 0, 1, static=False)], linkage, clearance="always")
    turn = np.linspace(0, 3, 20)[:, None]
    here = engine.run(linkage.forward(turn, transforms.identity(20, 1)))
    far = engine.run(linkage.forward(turn, np.broadcast_to(motions.random_pose(rng, 1e6), (20, 1, 4, 4)).copy()))
    assert (here.clearance == far.clearance).all()
    assert (here.level == far.level).all()


@pytest.mark.parametrize("pieces", ["exact", "hull"])
@pytest.mark.compiled
def test_phantom_agrees_with_fcl(pieces):
    """Both engines on random poses; fcl's convex distances are good to 1e-6, so that band is left out."""
    rng = np.random.default_rng(11)
    solids = (scenes.phantom(), cuboid((0.4, 0.3, 0.2)), scenes.phantom())
    poses = np.array([[motions.random_pose(rng, 0.3) for _ in solids] for _ in range(40)])
    own = scenes.run(solids, poses, clearance="always", pieces=pieces)
    peer = scenes.run(solids, poses, clearance="always", pieces=pieces, narrowphase="fcl")
    contact = own.level == Level.CONTACT
    assert 0.1 < contact.mean() < 0.9
    sure = (own.clearance > 1e-5) | contact
    assert ((peer.level == Level.CONTACT) == contact)[sure].all()
    assert np.allclose(peer.clearance[sure], own.clearance[sure], atol=1e-5)


def test_options_are_checked():
    solids = (cube(1.0), cube(1.0))
    for options, name in (
        ({"clearance": "sometimes"}, "clearance"),
        ({"narrowphase": "bullet"}, "narrowphase"),
        ({"bounds": "capsule"}, "bounds"),
        ({"pieces": "voxels"}, "pieces"),
        ({"margin": 0.0}, "margin"),
        ({"margin": np.inf}, "margin"),
    ):
        with pytest.raises(InvalidValue) as caught:
            scenes.pipeline(solids, **options)
        assert caught.value.name == name


@pytest.mark.parametrize("narrowphase", ["gjk", "fcl"])
def test_poses_must_be_finite(narrowphase):
    poses = transforms.identity(3, 2)
    poses[2, 1, 0, 3] = np.nan
    with pytest.raises(InvalidValue) as caught:
        scenes.run((cube(1.0), cube(1.0)), poses, narrowphase=narrowphase)
    assert caught.value.name == "poses.local[2, l001]"


def test_relative_poses_are_those_of_the_linkage():
    rng = np.random.default_rng(12)
    joint = JointType.FREE
    parents = [None, "l0", "l1", "l0", None, "l4", "l5", "l6"]
    links = [Link(f"l{k}", up, motions.random_pose(rng), Joint(f"j{k}", joint)) for k, up in enumerate(parents)]
    linkage = Linkage(links)
    poses = linkage.forward(np.zeros((7, 0)), drift(rng, 7, 8, 1.0))
    pairs = [(a, b) for a in range(8) for b in range(8)]
    relative = RelativePoses(linkage, pairs).of(poses.local)
    for q, (a, b) in enumerate(pairs):
        assert (relative[q] == poses.relative(a, b)).all()


def test_no_pairs_no_frames():
    assert scenes.run((cube(1.0),), transforms.identity(5, 1)).level.shape == (5, 0)
    assert scenes.run((cube(1.0), cube(1.0)), transforms.identity(0, 2)).level.shape == (0, 1)
