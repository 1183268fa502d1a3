"""Self-collision of imported robots in random poses: as python-fcl and coal decide, and closed forms."""

from pathlib import Path

import coal
import fcl
import numpy as np
import pytest

import replay
from replay.errors import ReplayError
from replay.robots import checking
from replay.scenario.load import load_sources
from replay.scenario.scene import build
from replay.simulation import touching
from tests.robots import made
from tests.robots.public import descriptions
from tests.robots.test_poses import imported

PANDA = Path(replay.__file__).parents[1] / "scenarios" / "parts" / "panda.yaml"
NEAR = 1e-6
"""Pairs this close [m] to touching are not compared: other engines decide with their own rounding."""


class Fcl:
    """python-fcl on triangles."""

    def shape(self, triangles):
        mesh = fcl.BVHModel()
        mesh.beginModel(len(triangles), 3 * len(triangles))
        mesh.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
        mesh.endModel()
        return mesh

    def placed(self, shape, pose):
        return fcl.CollisionObject(shape, fcl.Transform(pose[:3, :3], pose[:3, 3]))

    def meet(self, a, b):
        return fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult()) > 0

    def gap(self, a, b):
        return fcl.distance(a, b, fcl.DistanceRequest(), fcl.DistanceResult())


class Coal:
    """coal on triangles."""

    def shape(self, triangles):
        mesh = coal.BVHModelOBBRSS()
        mesh.beginModel(len(triangles), 3 * len(triangles))
        for corners in triangles:
            mesh.addTriangle(*corners)
        mesh.endModel()
        return mesh

    def placed(self, shape, pose):
        return coal.CollisionObject(shape, coal.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy()))

    def meet(self, a, b):
        return coal.collide(a, b, coal.CollisionRequest(), coal.CollisionResult()) > 0

    def gap(self, a, b):
        return coal.distance(a, b, coal.DistanceRequest(), coal.DistanceResult())


ENGINES = [Fcl(), Coal()]


def compared(scene, samples, engine):
    """Return how many pairs were in contact, how many were decided alike, and how many there were, in random poses."""
    machine = scene.linkage
    positions = checking.random_positions(machine, samples)
    free = np.broadcast_to(np.eye(4), (samples, len(machine.free_names), 4, 4))
    met = np.concatenate(list(touching(scene, positions, free)))
    poses = machine.forward(positions, free).world
    bodies = {body.name: (body.link, engine.shape(body.solid.triangles), body.solid) for body in scene.bodies}
    count = 0
    for sample in range(samples):
        placed = {name: engine.placed(shape, poses[sample, link]) for name, (link, shape, _) in bodies.items()}
        for column, name in enumerate(scene.layout.pairs):
            first, second = name.split("|")
            expected = engine.meet(placed[first], placed[second])
            if expected == met[sample, column]:
                count += 1
            elif expected:  # engines take what is nearly touching for touching: never by more than this
                assert engine.gap(placed[first], placed[second]) < NEAR, f"{name} in pose {sample}"
            else:  # surfaces that do not cross: one body is inside the other, which their triangles cannot tell
                (a, _, solid_a), (b, _, solid_b) = bodies[first], bodies[second]
                assert inside(solid_a, poses[sample, a], solid_b, poses[sample, b]), f"{name} in pose {sample}"
    return int(met.sum()), count, met.size


def inside(first, pose_first, second, pose_second):
    """Return whether one of up to 300 corners of one body is inside the other, open or not, wound either way."""
    for a, pose_a, b, pose_b in ((first, pose_first, second, pose_second), (second, pose_second, first, pose_first)):
        into = np.linalg.inv(pose_a) @ pose_b
        corners = b.triangles.reshape(-1, 3)[:: 1 + len(b.triangles) // 100]
        if any(abs(winding(a.triangles, corner)) > 0.5 for corner in corners @ into[:3, :3].T + into[:3, 3]):
            return True
    return False


def winding(triangles, point):
    """Return how often a surface goes around a point, by solid angles of triangles (Van Oosterom, Strackee 1983)."""
    a, b, c = np.moveaxis(triangles - point, 1, 0)
    far_a, far_b, far_c = (np.linalg.norm(side, axis=1) for side in (a, b, c))
    volume = np.einsum("nd,nd->n", a, np.cross(b, c))
    ab, bc, ca = (np.einsum("nd,nd->n", *sides) for sides in ((a, b), (b, c), (c, a)))
    return np.arctan2(volume, far_a * far_b * far_c + ab * far_c + bc * far_a + ca * far_b).sum() / (2.0 * np.pi)


@pytest.mark.parametrize("engine", ENGINES, ids=["fcl", "coal"])
@pytest.mark.parametrize("seed", [1, 2])
def test_made_robots_touch_themselves_where_others_say_so(seed, engine, tmp_path):
    path = tmp_path / "r.urdf"
    path.write_text(made.urdf(seed, links=8, far=0.2))
    touched, same, total = compared(scene_of(path, tmp_path), 25, engine)
    assert same >= 0.97 * total and 0.02 * total < touched < 0.9 * total


@pytest.mark.parametrize("engine", ENGINES, ids=["fcl", "coal"])
def test_the_shipped_arm_touches_itself_where_others_say_so(engine):
    meshes = {f"panda/{path.name}": path for path in sorted((PANDA.parent / "panda").glob("*.stl"))}
    scene = build(checking.valid(PANDA.read_text(), PANDA, meshes, deep=True))
    touched, same, total = compared(scene, 100, engine)
    assert same >= 0.99 * total and touched > 5


def scene_of(description, folder):
    """Return the scene of a description that was imported with its meshes beside the part."""
    done, _ = imported(description, folder, copy_meshes=True, collision="visual")
    meshes = {path.relative_to(folder).as_posix(): path for path in (folder / "part").rglob("*") if path.is_file()}
    return build(checking.valid(done.file.read_text(), done.file, meshes, deep=True))


@pytest.mark.soak
@pytest.mark.parametrize("engine", ENGINES, ids=["fcl", "coal"])
@pytest.mark.parametrize("description", descriptions(), ids=lambda path: "/".join(path.parts[-3:]))
def test_public_robots_touch_themselves_where_others_say_so(description, engine, tmp_path):
    """Of robots of 2 to 40 bodies with a pair to test; one that is refused is compared in `test_poses.py`."""
    try:
        scene = scene_of(description, tmp_path)
    except ReplayError:
        return
    if scene.pairs and len(scene.bodies) <= 40:
        _, same, total = compared(scene, 100, engine)
        assert same >= 0.95 * total


def test_capsules_meet_where_their_axes_are_within_their_radii(tmp_path):
    """Against the distance of the segments, to the chord error of both."""
    joints = [(kind, axis) for kind in ("prismatic", "revolute") for axis in ("1 0 0", "0 1 0", "0 0 1")]
    limit = '<limit lower="-0.4" upper="0.4" velocity="1"/>'
    parts = [made.link("l0", '<capsule radius="0.1" length="0.5"/>')]
    for k, (kind, axis) in enumerate(joints):
        body = ['<capsule radius="0.07" length="0.3"/>'] if k == len(joints) - 1 else []
        inside = f'<axis xyz="{axis}"/>{limit}'
        parts += [made.link(f"l{k + 1}", *body), made.joint(f"j{k}", f"l{k}", f"l{k + 1}", kind, inside)]
    (tmp_path / "r.urdf").write_text(made.robot(*parts))
    positions, poses, met = states(scene_of(tmp_path / "r.urdf", tmp_path), 400)
    ends = np.array([[0, 0, 0.5], [0, 0, -0.5]])
    gaps = []
    for sample in range(len(positions)):
        first, last = poses[sample]["l0"], poses[sample]["l6"]
        a, b = (0.5 * ends) @ first[:3, :3].T + first[:3, 3], (0.3 * ends) @ last[:3, :3].T + last[:3, 3]
        gaps.append(between_segments(a, b) - 0.17)
    decided_as(np.array(gaps), met, 2e-3)


def test_ellipsoids_meet_where_a_stretched_space_says_so():
    """Two alike and parallel ones are balls where space is shrunk by their radii; beside a wall their height counts."""
    egg = "{type: ellipsoid, radii: [0.1, 0.2, 0.35], chord_error: 0.3 mm}"
    axes = ("[1, 0, 0]", "[0, 1, 0]", "[0, 0, 1]")
    slides = [f"type: prismatic, axis: {axis}, lower: -0.5, upper: 0.5" for axis in axes]
    turns = [f"type: revolute, axis: {axis}, lower: -2, upper: 2" for axis in axes]
    up = "type: prismatic, axis: [0, 0, 1], lower: 0, upper: 0.6"
    wall = "{type: cuboid, size: [18, 18, 2]}"
    radii = np.array([0.1, 0.2, 0.35])
    for still, at, joints in ((egg, 0, slides), (wall, -1, [up, *turns])):
        links = [f"  a: {{pose: {{xyz: [0, 0, {at}]}}, shapes: {{s: {still}}}}}"]
        for k, joint in enumerate(joints):
            body = f", shapes: {{s: {egg}}}" if k == len(joints) - 1 else ""
            above = f"parent: l{k - 1}, " if k else ""
            links.append(f"  l{k}: {{{above}joint: {{{joint}}}{body}}}")
        text = "\n".join(["version: 1", "name: eggs", "rate: 1", "duration: 0", "links:", *links])
        _, poses, met = states(build(load_sources("eggs.yaml", {"eggs.yaml": text.encode()})), 400)
        T = np.array([pose[f"l{len(joints) - 1}"] for pose in poses])
        if still == wall:
            decided_as(T[:, 2, 3] - np.linalg.norm(T[:, 2, :3] * radii, axis=1), met, 1e-3)
        else:
            scaled = np.linalg.norm(T[:, :3, 3] / radii, axis=1)
            decided_as(0.1 * (scaled - 2.0), met, 2e-3)  # each is 0.1 or more across: a gap is at least that share


def states(scene, samples):
    """Return random positions, the poses of links by name, and whether the scene's one pair meets."""
    machine = scene.linkage
    positions = checking.random_positions(machine, samples)
    free = np.zeros((samples, 0, 4, 4))
    assert len(scene.layout.pairs) == 1
    world = machine.forward(positions, free).world
    met = np.concatenate(list(touching(scene, positions, free)))[:, 0]
    return positions, [dict(zip(machine.link_names, poses, strict=True)) for poses in world], met


def decided_as(gaps, met, near):
    """Assert that pairs meet where the gap [m] is below 0, but for gaps as small as the triangles may be off."""
    clear = np.abs(gaps) > near
    np.testing.assert_array_equal(met[clear], gaps[clear] < 0.0)
    assert clear.mean() > 0.95 and 0.1 < met.mean() < 0.9


def between_segments(a, b):
    """Return the distance of two segments: the least over both, or from an end to the other one."""
    u, v = a[1] - a[0], b[1] - b[0]
    found = []
    for point, (start, along) in [(p, (b[0], v)) for p in a] + [(p, (a[0], u)) for p in b]:
        share = np.clip((point - start) @ along / (along @ along), 0.0, 1.0)
        found.append(np.linalg.norm(point - start - share * along))
    s, t = np.linalg.lstsq(np.stack([u, -v], axis=1), b[0] - a[0], rcond=None)[0]
    if 0.0 <= s <= 1.0 and 0.0 <= t <= 1.0:
        found.append(np.linalg.norm(a[0] + s * u - b[0] - t * v))
    return min(found)
