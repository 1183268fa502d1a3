"""What a reading follows roughly, cheap enough for every frame: see `keyframes`."""

from __future__ import annotations

import numpy as np
from numba import float64

from replay.geometry.closest import distance_to_surface
from replay.geometry.tree import TREE_TYPE, Tree, triangle_tree
from replay.numerics import transforms
from replay.numerics.arrays import Floats
from replay.numerics.jit import entry, kernel
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.influence import point_potentials
from replay.sensing.electrostatics.panels import joined
from replay.sensing.electrostatics.placement import RESOLVED
from replay.sensing.electrostatics.refinement import bounded
from replay.sensing.electrostatics.unit import Unit

_PIECE = 0.025
"""Diameter of the pieces of bodies [m]."""

_MOST_POINTS = 1500


@entry(float64[:, ::1], float64[:, :, ::1], TREE_TYPE)
@kernel
def surface_distances(points: Floats, triangles: Floats, tree: Tree) -> Floats:
    """Return the distances (n,) [m] of points (n, 3) from triangles (m, 3, 3) under their tree."""
    result = np.empty(len(points))
    for k in range(len(points)):
        result[k] = distance_to_surface(points[k], triangles, tree)
    return result


class Proxy:
    """E of a unit and its bodies.

    Args:
        unit: the electrodes.
        surface: (n, 3, 3) [m], the unit's triangles.
        bodies: what is before it.
    """

    def __init__(self, unit: Unit, surface: Floats, bodies: tuple[ConductorBody, ...]) -> None:
        self._unit = unit
        self._surface, self._tree = surface, triangle_tree(surface)
        self._points, self._areas = [], []
        for body in bodies:
            panels = joined([faces.panels for faces in body.faces])
            size = _PIECE
            pieces = bounded(panels, np.full(len(panels.area), size))
            while len(pieces.area) > max(_MOST_POINTS, 4 * len(panels.area)):
                size *= 1.5
                pieces = bounded(panels, np.full(len(panels.area), size))
            self._points.append(pieces.centroid)
            self._areas.append(pieces.area)

    def of(self, poses: Floats) -> Floats:
        """Return E (k,) [m], > 0, of one pose (bodies, 4, 4)."""
        turned = [transforms.apply(pose, points) for points, pose in zip(self._points, poses, strict=True)]
        points = np.ascontiguousarray(np.concatenate(turned))
        coarse = self._unit.charged[0]
        phi = point_potentials(points, coarse.panels, coarse.charges)
        distance = np.maximum(surface_distances(points, self._surface, self._tree), RESOLVED)
        return np.asarray((phi * phi * np.concatenate(self._areas) / distance).sum(axis=1) + 1e-300)
