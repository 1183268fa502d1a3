"""Collision engines behind one interface: ours, python-fcl, coal and MuJoCo, each called the fastest way it offers.

Everything that a user would prepare once (shapes, transforms, requests) is prepared before the clock runs. A distance
of overlapping bodies is 0, whatever an engine says of their depth.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from replay.collision.gjk import Convex, Status, distance, distances, intersect, intersects
from replay.geometry.hull import convex_hull
from replay.numerics import transforms
from replay.numerics.arrays import Flags, Floats, Integers


@dataclass(frozen=True, eq=False)
class Body:
    """A convex body: the hull of `vertices` (n, 3) [m]; `size` are its full edges [m] if it is a box about its centre.

    An engine that has a box of its own is given that.
    """

    vertices: Floats
    size: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class Queries:
    """A pair of bodies at n relative poses, ready to be asked: do they meet, and how far apart are they [m]."""

    hits: Callable[[], Flags]
    distances: Callable[[], Floats]


@dataclass(frozen=True)
class Engine:
    """A collision engine.

    Attributes:
        name: as tables show it.
        package: that has to be installed, "" for none.
        queries: (a, b, T_world_a (n, 4, 4), T_world_b (n, 4, 4)) -> Queries.
    """

    name: str
    package: str
    queries: Callable[[Body, Body, Floats, Floats], Queries]

    def missing(self) -> str:
        """Return why the engine cannot take part; "" if it can."""
        try:
            if self.package:
                __import__(self.package)
        except ImportError as error:
            return f"not installed ({error})"
        return ""


def _ours(a: Body, b: Body, T_world_a: Floats, T_world_b: Floats) -> Queries:
    """All poses in one call, as the pipeline works; every query starts afresh, as an unrelated one does."""
    first, second = Convex(a.vertices), Convex(b.vertices)
    here, there = T_world_a.copy(), T_world_b.copy()
    here[:, :3, 3], there[:, :3, 3] = 0.0, T_world_b[:, :3, 3] - T_world_a[:, :3, 3]  # far away, nothing is rounded off
    T_a_b = np.ascontiguousarray(transforms.compose(transforms.invert(here), there))
    contact = Status.CONTACT.value

    def hits() -> Flags:
        return intersects(first, second, T_a_b) >= contact

    return Queries(hits, lambda: distances(first, second, T_a_b)[1])


def _ours_checked(a: Body, b: Body, T_world_a: Floats, T_world_b: Floats) -> Queries:
    first, second = Convex(a.vertices), Convex(b.vertices)
    pairs = list(zip(T_world_a, T_world_b, strict=True))

    def hits() -> Flags:
        verdicts = (intersect(first, second, pose_a=x, pose_b=y) for x, y in pairs)
        return np.array([verdict.direction is None for verdict in verdicts])

    def measured() -> Floats:
        answers = (distance(first, second, pose_a=x, pose_b=y) for x, y in pairs)
        return np.array([answer.distance for answer in answers])

    return Queries(hits, measured)


def _fcl(a: Body, b: Body, T_world_a: Floats, T_world_b: Floats) -> Queries:
    import fcl

    def place(T: Floats) -> list[Any]:
        return [fcl.Transform(pose[:3, :3].copy(), pose[:3, 3].copy()) for pose in T]

    first, second = (fcl.CollisionObject(fcl_geometry(fcl, body), fcl.Transform()) for body in (a, b))
    placed = list(zip(place(T_world_a), place(T_world_b), strict=True))

    def hits() -> Flags:
        answers = np.empty(len(placed), dtype=np.bool_)
        for k, (at, to) in enumerate(placed):
            first.setTransform(at)
            second.setTransform(to)
            answers[k] = fcl.collide(first, second, fcl.CollisionRequest(), fcl.CollisionResult()) > 0
        return answers

    def distances() -> Floats:
        answers = np.empty(len(placed))
        for k, (at, to) in enumerate(placed):
            first.setTransform(at)
            second.setTransform(to)
            answers[k] = fcl.distance(first, second, fcl.DistanceRequest(), fcl.DistanceResult())
        return np.maximum(answers, 0.0)

    return Queries(hits, distances)


def fcl_geometry(fcl: Any, body: Body) -> Any:
    """Return a body as python-fcl's box or convex polytope."""
    if body.size is not None:
        return fcl.Box(*body.size)
    vertices, faces = _polytope(body.vertices)
    return fcl.Convex(vertices, len(faces), np.insert(faces, 0, 3, axis=1).ravel())


def coal_geometry(coal: Any, body: Body) -> Any:
    """Return a body as coal's box or convex polytope."""
    if body.size is not None:
        return coal.Box(*body.size)
    vertices, faces = _polytope(body.vertices)
    points, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in vertices:
        points.append(vertex)
    for i, j, k in faces.tolist():
        triangles.append(coal.Triangle(i, j, k))
    return coal.Convex(points, triangles)


def _coal(a: Body, b: Body, T_world_a: Floats, T_world_b: Floats) -> Queries:
    import coal

    def place(T: Floats) -> list[Any]:
        return [coal.Transform3s(pose[:3, :3].copy(), pose[:3, 3].copy()) for pose in T]

    first, second = coal_geometry(coal, a), coal_geometry(coal, b)
    collide, measure = coal.ComputeCollision(first, second), coal.ComputeDistance(first, second)
    question, contacts = coal.CollisionRequest(), coal.CollisionResult()
    question.enable_contact = False  # a boolean is asked for, no depth
    request, nearest = coal.DistanceRequest(), coal.DistanceResult()
    placed = list(zip(place(T_world_a), place(T_world_b), strict=True))

    def hits() -> Flags:
        answers = np.empty(len(placed), dtype=np.bool_)
        for k, (at, to) in enumerate(placed):
            contacts.clear()
            collide(at, to, question, contacts)
            answers[k] = contacts.isCollision()
        return answers

    def distances() -> Floats:
        answers = np.empty(len(placed))
        for k, (at, to) in enumerate(placed):
            nearest.clear()
            answers[k] = measure(at, to, request, nearest)
        return np.maximum(answers, 0.0)

    hits.keep = distances.keep = (first, second)  # type: ignore[attr-defined]  # the functors hold bare pointers
    return Queries(hits, distances)


def _mujoco(a: Body, b: Body, T_world_a: Floats, T_world_b: Floats) -> Queries:
    import mujoco

    meshes, geoms = "", ""
    for name, body in (("a", a), ("b", b)):
        if body.size is not None:
            half = " ".join(repr(0.5 * edge) for edge in body.size)
            geom = f'<geom type="box" size="{half}"/>'
        else:
            corners = " ".join(map(repr, body.vertices.ravel().tolist()))
            meshes += f'<mesh name="{name}" vertex="{corners}"/>'
            geom = f'<geom type="mesh" mesh="{name}"/>'
        geoms += f"<body>{geom}</body>"
    mujoco.set_mju_user_warning(lambda _: None)  # it would write a log into the current folder
    xml = f"<mujoco><asset>{meshes}</asset><worldbody>{geoms}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    own = transforms.from_quaternion(np.roll(model.geom_quat, -1, axis=1))  # it keeps meshes in their inertial frames
    own[:, :3, 3] = model.geom_pos
    placed = [transforms.compose(T, own[k]) for k, T in enumerate((T_world_a, T_world_b))]
    positions = np.stack([T[:, :3, 3] for T in placed], axis=1)
    turns = np.stack([T[:, :3, :3].reshape(-1, 9) for T in placed], axis=1)
    size = max(float(np.abs(body.vertices).max()) for body in (a, b))

    def ask(farthest: float) -> Floats:
        answers = np.empty(len(positions))
        for k in range(len(positions)):
            data.geom_xpos[:] = positions[k]
            data.geom_xmat[:] = turns[k]
            answers[k] = mujoco.mj_geomDistance(model, data, 0, 1, farthest, None)
        return answers

    def distances() -> Floats:
        return np.maximum(ask(1e6 * size), 0.0)

    return Queries(lambda: ask(1e-6 * size) <= 0.0, distances)


def _polytope(points: Floats) -> tuple[Floats, Integers]:
    """Return the hull's vertices and its triangles as indices into them; flat points as one fan."""
    hull = convex_hull(points)
    if hull is None:
        count = len(points)
        return points, np.array([[0, k, k + 1] for k in range(1, count - 1)], dtype=np.int64).reshape(-1, 3)
    place = np.full(len(points), -1)
    place[hull.vertices] = np.arange(len(hull.vertices))
    return points[hull.vertices], place[hull.faces].astype(np.int64)


OURS = Engine("replay", "", _ours)
OURS_CHECKED = Engine("replay, one call a query", "", _ours_checked)
PEERS = (
    Engine("python-fcl", "fcl", _fcl),
    Engine("coal", "coal", _coal),
    Engine("mujoco", "mujoco", _mujoco),
)
