"""Self-collision of an imported robot in random poses: every pair as python-fcl decides it on the same triangles."""

from pathlib import Path

import fcl
import numpy as np
import pytest

import replay
from replay.robots import checking
from replay.scenario.scene import build
from replay.simulation import touching
from tests.robots import made
from tests.robots.test_poses import imported

PANDA = Path(replay.__file__).parents[1] / "scenarios" / "parts" / "panda.yaml"
NEAR = 1e-6
"""Pairs this close [m] to touching by fcl are not compared: it decides with its own rounding."""


def fcl_mesh(triangles):
    mesh = fcl.BVHModel()
    mesh.beginModel(len(triangles), 3 * len(triangles))
    mesh.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
    mesh.endModel()
    return mesh


def compared(scene, samples):
    """Return how many pairs were in contact, and how many were compared, over random poses."""
    machine = scene.linkage
    positions = checking.random_positions(machine, samples)
    free = np.broadcast_to(np.eye(4), (samples, len(machine.free_names), 4, 4))
    met = np.concatenate(list(touching(scene, positions, free)))
    poses = machine.forward(positions, free).world
    bodies = {body.name: (body.link, fcl_mesh(body.solid.triangles), body.solid) for body in scene.bodies}
    count = 0
    for sample in range(samples):
        for column, name in enumerate(scene.layout.pairs):
            (a, mesh_a, solid_a), (b, mesh_b, solid_b) = (bodies[side] for side in name.split("|"))
            placed = [
                fcl.CollisionObject(mesh, fcl.Transform(poses[sample, link, :3, :3], poses[sample, link, :3, 3]))
                for link, mesh in ((a, mesh_a), (b, mesh_b))
            ]
            expected = fcl.collide(*placed, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
            if expected == met[sample, column]:
                count += 1
                continue
            if expected:  # fcl takes what is nearly touching for touching: never by more than this
                gap = fcl.distance(*placed, fcl.DistanceRequest(), fcl.DistanceResult())
                assert gap < NEAR, f"{name} in pose {sample}"
            else:  # surfaces that do not cross: one body is inside the other, which fcl's triangles cannot tell
                assert inside(solid_a, poses[sample, a], solid_b, poses[sample, b]), f"{name} in pose {sample}"
    return int(met.sum()), count, met.size


def inside(first, pose_first, second, pose_second):
    """Return whether a corner of one convex body is inside the other, by the planes of its triangles."""
    for a, pose_a, b, pose_b in ((first, pose_first, second, pose_second), (second, pose_second, first, pose_first)):
        into = np.linalg.inv(pose_a) @ pose_b
        points = b.triangles.reshape(-1, 3) @ into[:3, :3].T + into[:3, 3]
        p, q, r = np.moveaxis(a.triangles, 1, 0)
        normals = np.cross(q - p, r - p)
        if (np.einsum("nd,knd->kn", normals, points[:, None] - p) <= 1e-9).all(axis=1).any():
            return True
    return False


@pytest.mark.parametrize("seed", [1, 2])
def test_made_robots_touch_themselves_where_fcl_says_so(seed, tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text(made.urdf(seed, links=8, far=0.2))
    done, _ = imported(path, tmp_path)
    scene = build(checking.valid(done.file.read_text(), done.file, {}, deep=True))
    touched, same, total = compared(scene, 25)
    assert same >= 0.97 * total and 0.02 * total < touched < 0.9 * total


def test_the_shipped_arm_touches_itself_where_fcl_says_so():
    meshes = {f"panda/{path.name}": path for path in sorted((PANDA.parent / "panda").glob("*.stl"))}
    scene = build(checking.valid(PANDA.read_text(), PANDA, meshes, deep=True))
    touched, same, total = compared(scene, 100)
    assert same >= 0.99 * total and touched > 5
