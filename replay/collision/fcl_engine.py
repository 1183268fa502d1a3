"""The second narrow phase: python-fcl behind the interface of `narrow.decide`.

For comparing with what others use. Known of the library: convex distance is iterative and good to about 1e-6 of the
bodies' size, and in one order of its arguments it can be far too large (0.333 for 0.164 between two polytopes of a
shipped scenario); a distance of overlapping shapes is -1; it crashes on NaN poses, empty models and bad indices, which
never reach it (the pipeline refuses such poses); surfaces are hollow, so containment is this package's own test.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from replay.collision.bodies import Bodies
from replay.collision.narrow import CONTACTS, RUNS, SEEN_INSIDE
from replay.collision.pair_frames import REPEAT, RUN, PairFrames
from replay.collision.pairs import CollisionBody
from replay.collision.traversal import QUERIES, contains_part
from replay.errors import MissingPackageError
from replay.geometry.hull import convex_hull
from replay.numerics.arrays import Floats, Integers


class FclEngine:
    """Bodies as fcl geometries: a surface as a triangle hierarchy, convex pieces as fcl's convex polytopes."""

    def __init__(self, bodies: Sequence[CollisionBody], arrays: Bodies) -> None:
        try:
            import fcl
        except ImportError:
            raise MissingPackageError(
                "python-fcl", "collision narrowphase fcl", "install it with: pip install python-fcl"
            ) from None
        self._fcl = fcl
        self._arrays = arrays
        self._parts = [self._geometries(k, body) for k, body in enumerate(bodies)]

    def __call__(self, frames: PairFrames, limit: float, counts: Integers) -> None:
        """See `narrow.decide`; `undecided` stays False, since fcl never says so."""
        poses, task, level, clearance = frames.poses, frames.task, frames.level, frames.clearance
        for p, (a, b, q, _) in enumerate(frames.pairs.tolist()):
            for f in range(len(task)):
                if task[f, p] == REPEAT:
                    level[f, p], clearance[f, p] = level[f - 1, p], clearance[f - 1, p]
                if task[f, p] != RUN:
                    continue
                counts[RUNS] += 1
                distance = self._distance(a, b, poses[q, f], limit, counts)
                if distance > 0.0 and level[f, p] > 0 and self._holds(a, b, poses[q, f]):
                    distance = 0.0
                    counts[SEEN_INSIDE] += 1
                if distance == 0.0:
                    level[f, p] = 2
                    counts[CONTACTS] += 1
                if limit > 0.0 and distance <= limit:
                    clearance[f, p] = distance

    def _distance(self, a: int, b: int, T_a_b: Floats, limit: float, counts: Integers) -> float:
        """Return 0 in contact, else the distance [m]; inf where it was not asked for."""
        fcl = self._fcl
        best = math.inf
        pose = fcl.Transform(T_a_b[:3, :3].copy(), T_a_b[:3, 3].copy())
        for geometry_a in self._parts[a]:
            object_a = fcl.CollisionObject(geometry_a, fcl.Transform())
            for geometry_b in self._parts[b]:
                object_b = fcl.CollisionObject(geometry_b, pose)
                counts[QUERIES] += 1
                if fcl.collide(object_a, object_b, fcl.CollisionRequest(), fcl.CollisionResult()):
                    return 0.0
                if limit > 0.0:
                    result = fcl.DistanceResult()
                    best = min(best, max(fcl.distance(object_a, object_b, fcl.DistanceRequest(), result), 0.0))
        return best

    def _holds(self, a: int, b: int, T_a_b: Floats) -> bool:
        rotation, translation = T_a_b[:3, :3].copy(), T_a_b[:3, 3].copy()
        surface = self._arrays.surface
        held = surface[a] and contains_part(self._arrays, a, b, rotation, translation, False)
        return bool(held or (surface[b] and contains_part(self._arrays, b, a, rotation, translation, True)))

    def _geometries(self, k: int, body: CollisionBody) -> list[Any]:
        arrays, fcl = self._arrays, self._fcl
        first = arrays.sets.first[arrays.set_first[k] : arrays.set_first[k + 1] + 1]
        if (np.diff(first) == 3).all():
            return [self._hierarchy(arrays.sets.vertices[first[0] : first[-1]].reshape(-1, 3, 3))]
        parts = []
        for begin, end in itertools.pairwise(first.tolist()):
            points = arrays.sets.vertices[begin:end]
            hull = convex_hull(points)
            if hull is None:  # a rectangle without volume: its triangles
                return [self._hierarchy(body.solid.triangles)]
            place = np.full(len(points), -1)
            place[hull.vertices] = np.arange(len(hull.vertices))
            faces = np.insert(place[hull.faces], 0, 3, axis=1)
            parts.append(fcl.Convex(points[hull.vertices], len(faces), faces.ravel()))
        return parts

    def _hierarchy(self, triangles: Floats) -> Any:
        model = self._fcl.BVHModel()
        model.beginModel(3 * len(triangles), len(triangles))
        model.addSubModel(triangles.reshape(-1, 3), np.arange(3 * len(triangles)).reshape(-1, 3))
        model.endModel()
        return model
