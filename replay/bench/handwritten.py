"""The same scene as a user would write it today: python-fcl, embreex and NumPy, frame by frame.

Written with care, not as a straw man: shapes, ray patterns and sub-triangles are prepared once, pairs are planned,
rays and plates are carried into the bodies' frames, and all 4^n centroids of a body go through NumPy at once.
"""

from __future__ import annotations

import importlib
import time
from typing import Any

import numpy as np

from replay.bench.engines import Body, fcl_geometry
from replay.geometry.solid import Solid
from replay.kinematics.linkage import LinkPoses
from replay.numerics import transforms
from replay.numerics.arrays import Flags, Floats
from replay.scenario.scene import Scene
from replay.sensing.capacitive import CapacitiveSensor
from replay.sensing.distance import DistanceSensor
from replay.sensing.distance.rays import cap_directions
from replay.sensing.target import Target

RAYS = 1000
SPLITS = 4
AT_ONCE = 500_000
"""Centroids in one NumPy expression: what stays in a processor's cache is several times faster than all at once."""


class Handwritten:
    """Contacts, distances and capacitances of a scene.

    Attributes:
        missing: why it cannot run; "" if it can.
        seconds: spent on collision, distance and capacitive in the last run.
    """

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.seconds = {"collision": 0.0, "distance": 0.0, "capacitive": 0.0}
        self.missing = ""
        for module in ("fcl", "embreex"):
            try:
                importlib.import_module(module)
            except ImportError as error:
                self.missing = f"not installed ({error})"
        if self.missing:
            return
        import fcl

        self._fcl = fcl
        self._parts = [_fcl_parts(fcl, body.solid) for body in scene.bodies]
        self._embree = [_embree_scene(target) for target in scene.targets]
        self._patterns = [cap_directions(sensor.aperture, RAYS) for sensor in scene.distance_sensors]
        felt = [any(sensor.senses(target.link) for sensor in scene.capacitive_sensors) for target in scene.targets]
        self._pieces = [_pieces(target) if needed else None for target, needed in zip(scene.targets, felt, strict=True)]

    def run(self, poses: LinkPoses) -> tuple[Flags, Floats, Floats]:
        """Return contacts (n, P), distances (n, D) [m], NaN for nothing, and capacitances (n, C) [F]."""
        scene, count = self.scene, len(poses.world)
        contact = np.zeros((count, len(scene.pairs)), dtype=np.bool_)
        distance = np.full((count, len(scene.distance_sensors)), np.nan)
        capacitance = np.zeros((count, len(scene.capacitive_sensors)))
        self.seconds = dict.fromkeys(self.seconds, 0.0)
        for f in range(count):
            world = poses.world[f]
            begin = time.perf_counter()
            contact[f] = self._contacts(world)
            after = time.perf_counter()
            for s, sensor in enumerate(scene.distance_sensors):
                distance[f, s] = self._nearest(s, sensor, world)
            last = time.perf_counter()
            for s, felt in enumerate(scene.capacitive_sensors):
                capacitance[f, s] = self._capacitance(felt, world)
            self.seconds["collision"] += after - begin
            self.seconds["distance"] += last - after
            self.seconds["capacitive"] += time.perf_counter() - last
        return contact, distance, capacitance

    def _contacts(self, world: Floats) -> Flags:
        fcl = self._fcl
        for parts, body in zip(self._parts, self.scene.bodies, strict=True):
            T = world[body.link]
            place = fcl.Transform(T[:3, :3].copy(), T[:3, 3].copy())
            for part in parts:
                part.setTransform(place)
        return np.array(
            [
                any(
                    fcl.collide(a, b, fcl.CollisionRequest(), fcl.CollisionResult())
                    for a in self._parts[pair.a]
                    for b in self._parts[pair.b]
                )
                for pair in self.scene.pairs
            ]
        )

    def _nearest(self, s: int, sensor: DistanceSensor, world: Floats) -> float:
        best = np.inf
        T_world_sensor = transforms.compose(world[sensor.link], sensor.T_link_sensor)
        for scene, target in zip(self._embree, self.scene.targets, strict=True):
            if not sensor.sees(target):
                continue
            T = transforms.compose(transforms.invert(world[target.link]), T_world_sensor)
            directions = self._patterns[s] @ T[:3, :3].T
            origins = np.broadcast_to(T[:3, 3], directions.shape)
            hits = scene.run(origins.astype(np.float32), directions.astype(np.float32), output=True)
            lengths = hits["tfar"][hits["primID"] >= 0]
            if len(lengths):
                best = min(best, float(lengths.min()))
        return best if best <= sensor.range else np.nan

    def _capacitance(self, sensor: CapacitiveSensor, world: Floats) -> float:
        total = 0.0
        for pieces, target in zip(self._pieces, self.scene.targets, strict=True):
            if pieces is None or not sensor.senses(target.link):
                continue
            centroids, areas = pieces
            for plate in sensor.plates:
                T_world_plate = transforms.compose(world[sensor.link], plate.T_link_plate)
                T = transforms.compose(transforms.invert(T_world_plate), world[target.link])
                for k in range(0, len(centroids), AT_ONCE):
                    total += _midpoints(
                        T, centroids[k : k + AT_ONCE], areas[k : k + AT_ONCE], plate.half_size, sensor.side
                    )
        return sensor.permittivity * total


def _midpoints(T: Floats, centroids: Floats, areas: Floats, half: Floats, side: str) -> float:
    x, y, z = (centroids @ T[:3, :3].T + T[:3, 3]).T
    u, v = np.maximum(np.abs(x) - half[0], 0.0), np.maximum(np.abs(y) - half[1], 0.0)
    counted = areas / np.sqrt(u * u + v * v + z * z)
    return float(np.sum(counted if side == "both" else counted[z > 0.0]))


def _fcl_parts(fcl: Any, solid: Solid) -> list[Any]:
    if solid.pieces:
        shapes = [fcl_geometry(fcl, Body(piece)) for piece in solid.pieces]
    else:
        model = fcl.BVHModel()
        model.beginModel(3 * len(solid.triangles), len(solid.triangles))
        model.addSubModel(solid.triangles.reshape(-1, 3), np.arange(3 * len(solid.triangles)).reshape(-1, 3))
        model.endModel()
        shapes = [model]
    return [fcl.CollisionObject(shape, fcl.Transform()) for shape in shapes]


def _embree_scene(target: Target) -> Any:
    from embreex.mesh_construction import TriangleMesh
    from embreex.rtcore_scene import EmbreeScene

    scene = EmbreeScene()
    TriangleMesh(scene, target.triangles.astype(np.float32))
    return scene


def _pieces(target: Target) -> tuple[Floats, Floats]:
    """Return centroids (m, 3) [m] and areas (m,) [m^2] of 4^n equal parts of each triangle."""
    parts = target.triangles
    for _ in range(SPLITS):
        a, b, c = parts[:, 0], parts[:, 1], parts[:, 2]
        d, e, f = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = np.concatenate([np.stack(corners, axis=1) for corners in ((a, d, f), (d, b, e), (f, e, c), (d, e, f))])
    normals = np.cross(parts[:, 1] - parts[:, 0], parts[:, 2] - parts[:, 0])
    return parts.mean(axis=1), 0.5 * np.sqrt(np.sum(normals**2, axis=1))
