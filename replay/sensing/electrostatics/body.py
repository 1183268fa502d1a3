"""A body: one conductor before a unit, meshed by itself."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from replay.geometry.tree import Tree, triangle_tree
from replay.numerics.arrays import Floats
from replay.sensing.electrostatics.faces import Faces, faces_of
from replay.sensing.electrostatics.grading import graded
from replay.sensing.electrostatics.panels import Panels, chosen, halved, joined
from replay.sensing.electrostatics.refinement import bounded, point_sample

_CELLS = 9.0
_LARGEST, _SHARE = 0.13, 1.0 / 3.0
"""The largest diameter of a panel: [m], and as a share of the body's extent; at fineness 1."""

_AS_THEY_ARE = 1.5
"""Fineness at which the triangles of a surface are not halved; they are once wherever it falls by the root of 2: what
three finenesses tell of the error is nothing where their panels are the same."""


@dataclass(frozen=True, eq=False)
class ConductorBody:
    """A conductor of one or more shapes, which move as one.

    Attributes:
        name: for messages.
        shapes: (n, 3, 3) triangles [m] each, in its own frame; any surfaces, open or closed, of any winding.
        earth: its capacitance to earth through what is not modelled [m], in units of 4 pi eps0: inf for a grounded
            body, 0 for one that floats.
    """

    name: str
    shapes: tuple[Floats, ...]
    earth: float = math.inf

    @cached_property
    def faces(self) -> tuple[Faces, ...]:
        """The faces of each shape; none of one whose triangles have no area."""
        return tuple(faces_of(triangles) for triangles in self.shapes)

    @cached_property
    def outline(self) -> Floats:
        """Points (n, 3) [m] all over it, for distances."""
        return point_sample(joined([faces.panels for faces in self.faces]), 0.005)

    def surface(self, shape: int) -> tuple[Floats, Tree]:
        """Return the triangles of a shape and the tree over them."""
        return self.shapes[shape], self._trees[shape]

    @cached_property
    def _trees(self) -> tuple[Tree, ...]:
        return tuple(triangle_tree(triangles) for triangles in self.shapes)

    def meshes(self, fineness: float) -> list[Panels]:
        """Return the panels of each shape while nothing is near."""
        result = []
        for triangles, faces in zip(self.shapes, self.faces, strict=True):
            extent = float(np.max(np.ptp(triangles.reshape(-1, 3), axis=0)))
            panels = graded(faces, _CELLS / fineness) if len(faces.edges) else faces.panels
            panels = _triangles_halved(panels, round(2.0 * math.log2(_AS_THEY_ARE / fineness)))
            result.append(bounded(panels, np.full(len(panels.area), fineness * min(_LARGEST, _SHARE * extent))))
        return result


def _triangles_halved(panels: Panels, times: int) -> Panels:
    """Return panels whose triangles are halved some times, or not."""
    done, triangles = chosen(panels, panels.four), chosen(panels, ~panels.four)
    for _ in range(times):
        triangles = halved(triangles)
    return joined([done, triangles])
