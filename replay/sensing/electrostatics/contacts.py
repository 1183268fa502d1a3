"""Where bodies stand to a unit: how far, what touches, which of them are one conductor, and what is done about it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.geometry.containment import each_inside
from replay.numerics import transforms
from replay.numerics.arrays import Flags, Floats, Integers
from replay.sensing.electrostatics.conductors import Station
from replay.sensing.electrostatics.gap import gaps
from replay.sensing.electrostatics.placement import RESOLVED, TOUCHING, PosedBodies
from replay.sensing.target import Target

NEAR = 5e-3
"""Gaps are known exactly below this [m]; beyond, they do not matter."""

_MOST_MOVES = 8


@dataclass(frozen=True, eq=False)
class Stand:
    """n poses of bodies before a unit with k sensors.

    Attributes:
        placements: as they are solved: with bodies that come nearer than `RESOLVED` moved away to that.
        gap: (n,) [m], as it is; `NEAR` for more.
        touching: (n, k, shapes) whether a shape touches a plate, or holds it.
    """

    placements: tuple[PosedBodies, ...]
    gap: Floats
    touching: Flags

    @property
    def states(self) -> Integers:
        """What does not change within a motion, as a number (n,): what touches, what is resolved or cut."""
        numbers: dict[tuple[bytes, ...], int] = {}
        rows = zip(self.touching, self.unresolved, self.placements, strict=True)
        return np.array(
            [
                numbers.setdefault((t.tobytes(), bytes([int(u), int(p.cut)]), p.conductors.tobytes()), len(numbers))
                for t, u, p in rows
            ],
            dtype=np.int64,
        )

    @property
    def unresolved(self) -> Flags:
        """Whether the poses (n,) are not solved as they are."""
        return np.asarray(self.gap < RESOLVED)


def stand(station: Station, targets: list[Target], T: Floats) -> Stand:
    """Return where bodies stand.

    Args:
        station: the unit and its bodies, at least one.
        targets: the shapes of the bodies, in order.
        T: (n, bodies, 4, 4), T_unit_body.
    """
    n, k = len(T), len(station.plates)
    touching = np.zeros((n, k, len(targets)), np.bool_)
    found = np.full((n, len(station.bodies)), NEAR)
    body_of = np.repeat(np.arange(len(station.bodies)), [len(body.shapes) for body in station.bodies])
    for shape, (target, body) in enumerate(zip(targets, body_of, strict=True)):
        inverse = np.ascontiguousarray(transforms.invert(T[:, body]))
        gap = gaps(station.surface, inverse, target.triangles, target.tree, NEAR)[:, 0]
        held = _holds(station, target, inverse)
        close = np.flatnonzero(gap < TOUCHING)
        for sensor, plates in enumerate(station.plates):
            touches = gaps(plates, inverse[close], target.triangles, target.tree, NEAR)[:, 0] < TOUCHING
            touching[close[touches], sensor, shape] = True
        touching[:, :, shape] |= held
        gap[held.any(axis=1)] = 0.0
        found[:, body] = np.minimum(found[:, body], gap)
    conductors = _conductors(station, T)
    least = found.min(axis=1)
    placements = [_placed(station, targets, body_of, T[i], found[i], conductors[i], float(least[i])) for i in range(n)]
    return Stand(tuple(placements), np.where(least < TOUCHING, 0.0, least), touching)


def _holds(station: Station, target: Target, inverse: Floats) -> Flags:
    """Return which sensors (n, k) have a plate whose centre is inside a shape."""
    result = np.zeros((len(inverse), len(station.plates)), np.bool_)
    if target.closing is None:
        return result
    for sensor, plates in enumerate(station.plates):
        # a plate is two triangles with its diagonal from the first to the third corner
        centres = 0.5 * (plates[::2, 0] + plates[::2, 2])
        points = transforms.apply(inverse[:, None], centres)
        inside = each_inside(np.ascontiguousarray(points.reshape(-1, 3)), target.triangles, target.tree, target.closing)
        result[:, sensor] = inside.reshape(len(inverse), -1).any(axis=1)
    return result


def _conductors(station: Station, T: Floats) -> Integers:
    """Return the conductor (n, bodies) that each body is part of: bodies that touch are one."""
    n, count = T.shape[:2]
    result = np.tile(np.arange(count), (n, 1))
    for b in range(count):
        for a in range(b):
            relative = transforms.compose(transforms.invert(T[:, a]), T[:, b])
            touch = np.zeros(n, np.bool_)
            for surface in station.bodies[b].shapes:
                for shape in range(len(station.bodies[a].shapes)):
                    triangles, tree = station.bodies[a].surface(shape)
                    touch |= gaps(surface, np.ascontiguousarray(relative), triangles, tree, TOUCHING)[:, 0] < TOUCHING
            for i in np.flatnonzero(touch):
                result[i, result[i] == result[i, b]] = result[i, a]
    for i in np.flatnonzero((result != np.arange(count)).any(axis=1)):
        result[i] = np.unique(result[i], return_inverse=True)[1]
    return result


def _placed(
    station: Station,
    targets: list[Target],
    body_of: Integers,
    T: Floats,
    gap: Floats,
    conductors: Integers,
    least: float,
) -> PosedBodies:
    """Return a pose as it is solved."""
    if least >= RESOLVED:
        return PosedBodies(station.bodies, list(T), conductors, least)
    poses = [pose.copy() for pose in T]
    cut = bool((gap < TOUCHING).any())
    for body in np.flatnonzero((gap < RESOLVED) & (gap >= TOUCHING)):
        own = [target for target, of in zip(targets, body_of, strict=True) if of == body]
        cut |= not _moved_away(station.surface, own, poses[body])
    return PosedBodies(station.bodies, poses, conductors, RESOLVED, cut)


def _moved_away(surface: Floats, own: list[Target], pose: Floats) -> bool:
    """Move a body straight away from the unit, in place; return whether it is then as far as gaps are resolved."""
    for _ in range(_MOST_MOVES):
        inverse = transforms.invert(pose)[None]
        found = np.concatenate([gaps(surface, inverse, each.triangles, each.tree, RESOLVED) for each in own])
        nearest = found[np.argmin(found[:, 0])]
        if nearest[0] >= RESOLVED * (1.0 - 1e-6):
            return True
        if nearest[0] < TOUCHING:
            return False
        way = (nearest[4:] - nearest[1:4]) / nearest[0]
        pose[:3, 3] += pose[:3, :3] @ way * (RESOLVED - nearest[0])
    return False
