"""Bodies before a unit in one pose: which of them are one conductor, and what of their surfaces counts.

Bodies that touch are one conductor: grounded if one is, else their capacitances to earth add up. Where two shapes of a
conductor lie on each other, the later one's panels are left out, since panels at one place make influences singular.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from replay.numerics import transforms
from replay.numerics.arrays import Flags, Floats, Integers
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.gap import on_surface
from replay.sensing.electrostatics.panels import Panels, chosen, moved

if TYPE_CHECKING:
    from scipy.spatial import cKDTree


TOUCHING = 1e-6
"""Surfaces that come nearer than this [m] touch."""

RESOLVED = 3e-3
"""Gaps between unit and bodies below this [m] are not resolved."""


@dataclass(frozen=True, eq=False)
class PosedBodies:
    """Bodies in one pose.

    Attributes:
        bodies: at least one.
        poses: (4, 4) each, T_unit_body.
        conductors: (bodies,) number of the conductor that each is part of.
        gap: the least distance between the unit and a body [m], > 0; what is beyond 5 mm does not matter.
        cut: whether panels nearer to the unit than `RESOLVED` are left out, as of bodies that overlap it.
    """

    bodies: Sequence[ConductorBody]
    poses: Sequence[Floats]
    conductors: Integers
    gap: float
    cut: bool = False

    @cached_property
    def earth(self) -> Floats:
        """The capacitance of each conductor to earth [m]."""
        result = np.zeros(int(self.conductors.max()) + 1)
        np.add.at(result, self.conductors, [body.earth for body in self.bodies])
        return result

    @cached_property
    def body_of_shape(self) -> Integers:
        """The body (shapes,) of each shape."""
        return np.repeat(np.arange(len(self.bodies)), [len(body.shapes) for body in self.bodies])

    @property
    def conductor_of_shape(self) -> Integers:
        """The conductor (shapes,) of each shape."""
        return np.asarray(self.conductors[self.body_of_shape])

    def outline(self, body: int) -> Floats:
        """Return points (n, 3) [m] all over a body, in the unit's frame."""
        return transforms.apply(self.poses[body], self.bodies[body].outline)

    def meshes(self, body: int, fineness: float) -> list[Panels]:
        """Return the panels of each shape of a body by itself, in the unit's frame."""
        return [moved(part, self.poses[body]) for part in self.bodies[body].meshes(fineness)]

    def uncovered(self, parts: list[Panels], near_unit: cKDTree) -> list[Panels]:
        """Return, of the panels of each shape, those that count."""
        result = []
        for shape, part in enumerate(parts):
            counts = ~self.covered(shape, part.centroid)
            if self.cut:
                counts &= near_unit.query(part.centroid)[0] >= RESOLVED
            result.append(chosen(part, counts) if not counts.all() else part)
        return result

    def covered(self, shape: int, points: Floats) -> Flags:
        """Return which points (n, 3) of a shape, in the unit's frame, lie on an earlier shape of its conductor."""
        conductor, body_of = self.conductor_of_shape, self.body_of_shape
        places = [(body, k) for body, each in enumerate(self.bodies) for k in range(len(each.shapes))]
        result = np.zeros(len(points), np.bool_)
        for first in np.flatnonzero(conductor[:shape] == conductor[shape]):
            body, k = places[first]
            local = transforms.apply(transforms.invert(self.poses[body_of[first]]), points)
            result |= on_surface(np.ascontiguousarray(local), *self.bodies[body].surface(k), TOUCHING)
        return result
