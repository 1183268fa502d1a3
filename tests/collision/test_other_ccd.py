"""What is called clear is clear by another conservative engine: ipctk's continuous collision of curved trajectories."""

import itertools
from functools import partial

import ipctk
import numpy as np
import pytest

from replay.collision.columns import Between
from replay.collision.pairs import CollisionBody, plan_pairs
from replay.collision.pipeline import CollisionPipeline
from replay.geometry.mesh import solid_from_triangles
from tests.kinematics.scripts import random_motion

FACES = ((0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2))
EDGES = tuple(itertools.combinations(range(4), 2))


def tetrahedron(rng, size):
    """Corners (4, 3) and the solid."""
    corners = size * rng.normal(size=(4, 3))
    if np.linalg.det(corners[1:] - corners[0]) < 0.0:
        corners = corners[[0, 2, 1, 3]]
    return corners, solid_from_triangles(corners[np.array(FACES)])


class Path(ipctk.NonlinearTrajectory):
    """The way of a corner, at x in [0, 1] of an interval, with a bound of how far it leaves a chord."""

    def __init__(self, place, curvature):
        ipctk.NonlinearTrajectory.__init__(self)
        self.place, self.curvature = place, curvature

    def __call__(self, x):
        return self.place(x)

    def max_distance_from_linear(self, x0, x1):
        return self.curvature * (x1 - x0) ** 2 / 8.0


def touch(bodies, curvature):
    """Whether two tetrahedra, given by the ways of their corners, come together in [0, 1]."""
    ccd = ipctk.NonlinearCCD()
    a, b = ([Path(place, curvature) for place in places] for places in bodies)
    for corners, faces in ((a, b), (b, a)):
        for corner, face in itertools.product(corners, FACES):
            if ccd.point_triangle_ccd(corner, *(faces[k] for k in face))[0]:
                return True
    return any(ccd.edge_edge_ccd(a[i], a[j], b[k], b[l])[0] for (i, j), (k, l) in itertools.product(EDGES, EDGES))


def disagreements(seed, frames=4):
    """(intervals asked, those that are called clear where the other engine finds a contact, contacts of both)."""
    rng = np.random.default_rng(seed)
    linkage, motion = random_motion(rng, links=3, span=1.0, size=1.0)
    made = [tetrahedron(rng, 0.3) for _ in linkage.links]
    bodies = [CollisionBody(f"{link.name}/s", k, made[k][1]) for k, link in enumerate(linkage.links)]
    pairs = plan_pairs(bodies, linkage)
    time = ((rng.uniform(0.0, 0.8) + np.arange(frames) * 0.02) * 1e9).astype(np.int64)

    def poses(ns):
        states = motion.states(np.asarray(ns, dtype=np.float64) / 1e9)
        return linkage.forward(states.positions, states.free_poses)

    def place(corner, link, t0, t1, x):
        T = poses([t0 + x * (t1 - t0)]).world[0, link]
        return T[:3, :3] @ corner + T[:3, 3]

    columns = CollisionPipeline(bodies, pairs, linkage, motion=motion).run(poses(time), time=time)
    asked, false, both = 0, 0, 0
    for f in range(1, frames):
        t0, t1 = int(time[f - 1]), int(time[f])
        samples = poses(np.linspace(t0, t1, 65)).world
        for p, pair in enumerate(pairs):
            ends = columns.level[f - 1 : f + 1, p]
            if (ends == 2).any() or columns.between[f, p] == Between.UNDECIDED:
                continue
            ways, worst = [], 0.0
            for body in (pair.a, pair.b):
                corners = made[body][0]
                link = bodies[body].link
                there = samples[:, link, :3, :3] @ corners.T + samples[:, link, :3, 3, None]
                second = np.abs(np.diff(there, n=2, axis=0)).max(initial=0.0) * 64**2
                worst = max(worst, 2.0 * np.sqrt(3.0) * second)
                ways.append([partial(place, corner, link, t0, t1) for corner in corners])
            asked += 1
            found = touch(ways, worst)
            false += found and columns.between[f, p] == Between.CLEAR
            both += found and columns.between[f, p] == Between.CONTACT
    return asked, false, both


@pytest.mark.soak
def test_another_engine_finds_no_contact_where_there_is_none():
    found = np.array([disagreements(seed) for seed in range(60)])
    assert found[:, 0].sum() > 300
    assert found[:, 1].sum() == 0
