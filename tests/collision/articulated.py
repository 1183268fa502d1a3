"""Random articulated scenes, and what their intervals really hold by looking at many frames within them."""

import numpy as np

from replay.collision.columns import Between, Level
from replay.collision.pairs import CollisionBody, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.geometry import primitives
from tests.collision.motions import random_pose
from tests.kinematics.scripts import random_clocks, random_motion

BOUNDS = ("obb", "sphere", "aabb", "obb_vertices")
CLEARANCES = ("near", "always", "never")


def random_scene(rng):
    """Return (linkage, motion, bodies, pairs, size [m], span [s]): one body on each link, 1e-3 .. 1e3 m."""
    size, span = 10.0 ** rng.uniform(-3, 3), 10.0 ** rng.uniform(-1, 1)
    linkage, motion = random_motion(rng, links=int(rng.integers(2, 8)), span=span, size=size)
    bodies, share = [], 10.0 ** rng.uniform(-0.5, 0.5)
    for index, link in enumerate(linkage.links):
        s = size * share * rng.uniform(0.1, 0.5)
        solid = (
            lambda s=s: primitives.cube(s),
            lambda s=s: primitives.cuboid(tuple((s * rng.uniform(0.05, 2.0, 3)).tolist())),
            lambda s=s: primitives.sphere(0.5 * s, 0.05 * s),
            lambda s=s: primitives.arc(s, 2.0, 0.2 * s, 0.2 * s, 0.05 * s),
            lambda s=s: primitives.plane((s, 2.0 * s)),
        )[rng.integers(5)]()
        bodies.append(CollisionBody(f"{link.name}/s", index, solid.transformed(random_pose(rng, 0.3 * size))))
    return linkage, motion, bodies, plan_pairs(bodies, linkage), size, span


def check_intervals(seed, *, frames=6, samples=200, slowed=False):
    """Hold what is said of a random scene's intervals against frames within; return how often each `Between` was.

    With `slowed` clocks brake and release the scripts of joints.
    """
    rng = np.random.default_rng(seed)
    linkage, motion, bodies, pairs, size, span = random_scene(rng)
    motion = random_clocks(rng, motion, span) if slowed else motion
    counts = np.zeros(len(Between), dtype=np.int64)
    if not pairs:
        return counts
    options = {
        "bounds": BOUNDS[rng.integers(len(BOUNDS))],
        "clearance": CLEARANCES[rng.integers(len(CLEARANCES))],
        "margin": float(size * 10.0 ** rng.uniform(-3, 0)),
    }
    rate = 10.0 ** rng.uniform(0, 2) / span
    time = ((rng.uniform(0, span) + np.arange(frames) / rate) * 1e9).astype(np.int64)

    def poses(ns):
        states = motion.states(np.asarray(ns) / 1e9)
        return linkage.forward(states.positions, states.free_poses)

    columns = CollisionPipeline(bodies, pairs, linkage, motion=motion, **options).run(poses(time), time=time)
    sampled = CollisionPipeline(bodies, pairs, linkage, **options).run(poses(time))
    for name in ("level", "clearance", "evaluated", "undecided"):
        np.testing.assert_array_equal(getattr(columns, name), getattr(sampled, name))
    assert (sampled.between == Between.NOT_LOOKED).all()
    assert (columns.between[0] == Between.NOT_LOOKED).all()
    reference = CollisionPipeline(bodies, pairs, linkage, bounds=options["bounds"], clearance="always")
    crossings = columns.crossings
    for f in range(1, frames):
        within = reference.run(poses(np.unique(np.linspace(time[f - 1], time[f], samples + 1).astype(np.int64))))
        for p in range(len(pairs)):
            state, bound = columns.between[f, p], columns.clearance_bound[f, p]
            counts[state] += 1
            mine = np.flatnonzero((crossings.pair == p) & (crossings.frame == f))
            place = (seed, f, p)
            if state == Between.CLEAR:
                assert (within.level[:, p] < Level.CONTACT).all(), place
                assert within.clearance[:, p].min() >= bound * (1.0 - 1e-11) - 1e-13 * size, place
                assert not (crossings.level[mine] == Level.CONTACT).any(), place
            else:
                assert state in (Between.CONTACT, Between.UNDECIDED), place
                assert bound == 0.0, place
            level = int(columns.level[f - 1, p])
            for k in mine:
                reached, begins = int(crossings.level[k]), bool(crossings.begins[k])
                earliest, latest = crossings.earliest[k], crossings.latest[k]
                assert time[f - 1] <= earliest < latest <= time[f], place
                # levels begin where they were not, and end where they were
                assert (level < reached) == begins, place
                level = reached if begins else reached - 1
                seen = reference.run(poses([earliest, latest])).level[:, p]
                assert (seen[1] >= reached) == begins, place
                if latest - earliest <= 1_000:
                    assert (seen[0] >= reached) != begins, place
            assert level == columns.level[f, p], place
    return counts
