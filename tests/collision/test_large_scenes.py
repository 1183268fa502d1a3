"""The tree over all bodies: nothing it leaves out would have been anything but clear."""

import dataclasses

import numpy as np
import pytest

from replay.collision import pipeline
from replay.collision.candidates import near_pairs
from replay.collision.columns import Level
from replay.collision.pairs import MOST_PAIRS, CollisionBody, DisabledPair, Pair, PairRules, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.errors import InvalidValue
from replay.geometry.primitives import cube, cuboid, cylinder, plane
from replay.kinematics.linkage import Joint, JointType, Link, Linkage
from replay.numerics import transforms
from tests.collision import motions, scenes
from tests.collision.test_pipeline import concave

BOUNDS = ("obb", "obb_vertices", "aabb", "sphere")
FIELDS = ("level", "clearance", "evaluated", "undecided")


def crowd(rng, *, trees, frames, away=0.0):
    """Return (bodies, linkage, poses): trees of a free base, a turning arm and a fixed tip, and fixed posts."""
    links, bodies = [], []
    edge = 0.55 * (3 * trees) ** (1 / 3)
    solids = (cube(0.3), cuboid((0.2, 0.6, 0.1)), cylinder(0.15, 0.5, 0.02), concave(), plane((0.6, 0.4)))
    for k in range(trees):
        for name, parent, kind in (
            (f"a{k:03}", None, JointType.FREE),
            (f"b{k:03}", f"a{k:03}", JointType.REVOLUTE),
            (f"c{k:03}", f"b{k:03}", JointType.FIXED),
            (f"d{k:03}", None, JointType.FIXED),
        ):
            place = motions.pose(motions.rotation(rng), rng.uniform(0, edge, 3) + away) if name[0] == "d" else None
            if place is None:
                place = np.identity(4) if parent is None else motions.random_pose(rng, 0.3)
            links.append(Link(name, parent, place, Joint(f"j{name}", kind)))
    linkage = Linkage(links)
    for k, link in enumerate(linkage.links):
        solid = solids[rng.integers(len(solids))]
        bodies.append(CollisionBody(f"{link.name}/s", k, solid.transformed(motions.random_pose(rng, 0.1))))
    free = np.array([[motions.pose(motions.rotation(rng), rng.uniform(0, edge, 3) + away) for _ in range(trees)]])
    free = np.repeat(free, frames, axis=0)
    free[..., :3, 3] += np.linspace(0, 1, frames)[:, None, None] * rng.normal(size=(trees, 3)) * 0.3
    free[frames // 2 : frames // 2 + 3] = free[frames // 2]
    turn = np.linspace(0, 1, frames)[:, None] * rng.uniform(-2, 2, trees)
    turn[frames // 2 : frames // 2 + 3] = turn[frames // 2]
    return bodies, linkage, linkage.forward(turn, free)


@pytest.mark.parametrize("bounds", BOUNDS)
@pytest.mark.parametrize("clearance", ["never", "near"])
@pytest.mark.parametrize("away", [0.0, 1e6])
@pytest.mark.compiled
def test_a_tree_over_all_bodies_does_not_show(monkeypatch, bounds, clearance, away):
    rng = np.random.default_rng(21)
    bodies, linkage, poses = crowd(rng, trees=14, frames=24, away=away)
    disabled = [DisabledPair("a00?", "d*", "no matter"), DisabledPair("b003/s", "a*", "no matter")]
    pairs = plan_pairs(bodies, linkage, disabled=disabled)
    results = []
    for few in (10**9, 0):
        monkeypatch.setattr(pipeline, "FEW_PAIRS", few)
        engine = CollisionPipeline(bodies, pairs, linkage, bounds=bounds, clearance=clearance, margin=0.08)
        results.append([engine.run(poses.slice(begin, begin + 12)) for begin in (0, 12)])
        counters = dataclasses.asdict(engine.counters)
        settled = sum(counters[name] for name in counters if name.startswith("pruned"))
        moving = counters["pairs"] - counters["static_pairs"]
        assert settled + counters["repeated"] + counters["narrow"] == 24 * moving + counters["static_pairs"]
    for plain, by_tree in zip(*results, strict=True):
        for name in FIELDS:
            assert np.array_equal(getattr(plain, name), getattr(by_tree, name), equal_nan=name == "clearance")
    assert 0.005 < (results[0][0].level == Level.CONTACT).mean() < 0.2
    # by rules, without a list, the same again
    rules = PairRules(bodies, linkage, disabled=disabled)
    sparse = CollisionPipeline(bodies, rules, linkage, bounds=bounds, clearance=clearance, margin=0.08)
    assert sparse.counters.pairs == len(pairs)
    column = {(pair.a, pair.b): k for k, pair in enumerate(pairs)}
    for asked in (engine, sparse):
        for begin, columns in zip((0, 12), results[0], strict=True):
            entries = asked.contacts(poses.slice(begin, begin + 12))
            k = np.array([column[pair] for pair in map(tuple, entries.bodies.tolist())])
            dense = np.zeros_like(columns.level), np.full_like(columns.clearance, np.nan), columns.undecided * False
            dense[0][entries.frame, k] = entries.level
            dense[1][entries.frame, k] = entries.clearance
            dense[2][entries.frame, k] = entries.undecided
            assert np.array_equal(dense[0], columns.level)
            assert np.array_equal(dense[1], columns.clearance, equal_nan=True)
            assert np.array_equal(dense[2], columns.undecided)
            ordered = np.lexsort((entries.bodies[:, 1], entries.bodies[:, 0], entries.frame))
            assert (ordered == np.arange(len(k))).all()


def test_near_pairs_are_those_whose_swept_boxes_meet():
    """Against every pair, one by one; the boxes are those of the spheres, half the limit wider."""
    rng = np.random.default_rng(22)
    solids = [cube(0.3)] * 200
    engine, linkage = scenes.pipeline(solids, bounds="sphere")
    starts = rng.uniform(0, 5, (200, 3))
    poses = np.stack([transforms.from_translation(starts + shift * rng.normal(size=(200, 3))) for shift in (0, 0.2, 1)])
    links = linkage.forward(np.zeros((3, 0)), poses)
    found = near_pairs(engine._volumes, engine._links, links, 0.1, np.zeros(len(engine._links)))
    reach = engine._volumes.radius[:, None] + 0.05
    low, high = poses[..., :3, 3].min(axis=0) - reach, poses[..., :3, 3].max(axis=0) + reach
    meet = ((low[:, None] <= high[None]) & (low[None] <= high[:, None])).all(axis=2)
    a, b = np.nonzero(np.triu(meet, 1))
    assert {tuple(pair) for pair in found.tolist()} == set(zip(a.tolist(), b.tolist(), strict=True))
    assert len(found) == len(a) > 300


@pytest.mark.compiled
def test_candidates_grow_with_the_bodies_not_with_their_pairs():
    looked_at = []
    for count in (100, 800):
        rng = np.random.default_rng(23)
        linkage = scenes.free_links(count)
        bodies = [CollisionBody(f"l{k:03}/s", k, cube(0.2)) for k in range(count)]
        engine = CollisionPipeline(bodies, PairRules(bodies, linkage), linkage, clearance="never")
        place = transforms.from_translation(rng.uniform(0, 0.8 * count ** (1 / 3), (1, count, 3)))
        engine.contacts(linkage.forward(np.zeros((1, 0)), place))
        looked_at.append(engine.counters.pair_frames - engine.counters.pruned_by_block)
    assert looked_at[0] > 5
    assert looked_at[1] < 8 * 2 * looked_at[0]


def test_scenes_with_too_many_pairs_are_refused_before_they_are_listed():
    count = 1_002
    linkage = Linkage([Link(f"l{k:04}", None, np.identity(4), Joint(f"j{k}", JointType.FREE)) for k in range(count)])
    bodies = [CollisionBody(f"l{k:04}/s", k, cube(1.0)) for k in range(count)]
    with pytest.raises(InvalidValue, match="disable pairs that cannot meet") as caught:
        plan_pairs(bodies, linkage)
    assert caught.value.value == count * (count - 1) // 2 > MOST_PAIRS


def test_rules_have_no_columns_and_no_clearance_of_everything():
    linkage = scenes.free_links(2)
    bodies = [CollisionBody(f"l{k:03}/s", k, cube(1.0)) for k in range(2)]
    rules = PairRules(bodies, linkage)
    with pytest.raises(InvalidValue) as caught:
        CollisionPipeline(bodies, rules, linkage, clearance="always")
    assert caught.value.name == "clearance"
    engine = CollisionPipeline(bodies, rules, linkage)
    poses = linkage.forward(np.zeros((1, 0)), transforms.identity(1, 2))
    with pytest.raises(InvalidValue) as caught:
        engine.run(poses)
    assert caught.value.name == "pairs"
    assert engine.contacts(poses).level.tolist() == [Level.CONTACT]
    twice = [Pair("l000/s|l001/s", 0, 1, False), Pair("l001/s|l000/s", 1, 0, False)]
    with pytest.raises(InvalidValue, match="listed once"):
        CollisionPipeline(bodies, twice, linkage)
