"""A sensor unit: the electrodes of one link, meshed, and the charges that they carry by themselves.

Electrodes are plates and what is behind them. Their charges q0 when one of them has the potential 1 and the others 0
make the potential phi in which bodies stand; it is the largest source of error, so it comes from two meshes and is
extrapolated.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from replay.errors import InvalidValue
from replay.geometry.tree import triangle_tree
from replay.numerics.arrays import Floats, Integers
from replay.sensing.electrostatics import cholesky
from replay.sensing.electrostatics.faces import OPEN, Faces, faces_of
from replay.sensing.electrostatics.gap import least_gap
from replay.sensing.electrostatics.grading import cut_nodes, graded, grid
from replay.sensing.electrostatics.influence import fill_influences, mean_potentials
from replay.sensing.electrostatics.panels import Panels, chosen, joined
from replay.sensing.electrostatics.placement import TOUCHING
from replay.sensing.electrostatics.potential_grid import Potential
from replay.sensing.electrostatics.products import products
from replay.sensing.electrostatics.refinement import near_tree, point_sample, refined

CELLS = 9.0
"""Divisions of a plate's edge at fineness 1; at fineness f, CELLS / f."""

FINENESSES = (0.8, 0.56)
"""Of the two meshes that phi comes from."""

_GAIN = 1.2
"""The finer mesh's error is about the difference of the two over this: panels double, errors halve or better."""

_LARGEST = 0.024
"""Panels are not made smaller than this for their distance to other electrodes [m], at fineness 1; nor smaller than
_SHARE of the smallest plate's edge."""

_SHARE = 0.25
_SLOPE = 1.1
_NEAR = 0.25
"""A plate is near a face behind it when their distance is below this share of its shorter edge."""

MOST_PANELS = 6000
"""Of the finer mesh."""


@dataclass(frozen=True, eq=False)
class Electrode:
    """One conductor of a unit at a potential of its own.

    Attributes:
        name: for messages.
        surfaces: (n, 3, 3) triangles [m] each, in the unit's frame; a plate is a surface by itself.
    """

    name: str
    surfaces: tuple[Floats, ...]


@dataclass(frozen=True, eq=False)
class Charged:
    """A mesh of the unit and what its electrodes carry: charges [m] per volt, in units of 4 pi eps0.

    Attributes:
        panels: n of them.
        charges: (k, n), of each electrode alone at 1 V.
        matrix: (k, k) [m], Maxwell's capacitances of the unit alone.
    """

    panels: Panels
    charges: Floats
    matrix: Floats


class Unit:
    """The electrodes of one link.

    Args:
        electrodes: at least one, each with a surface that has area.
        most_panels: of the finer mesh that phi comes from; beyond, both are made coarser.

    Raises:
        InvalidValue: an electrode without area, or electrodes that touch each other.
    """

    def __init__(self, electrodes: Sequence[Electrode], *, most_panels: int = MOST_PANELS) -> None:
        self.electrodes = tuple(electrodes)
        self._most_panels = most_panels
        self._faces = [[faces_of(surface) for surface in electrode.surfaces] for electrode in self.electrodes]
        for electrode, found in zip(self.electrodes, self._faces, strict=True):
            if not found or not all(len(faces.panels.area) for faces in found):
                raise InvalidValue(f"electrode {electrode.name!r}", "a surface without area", "must have area")
        _check_apart(self.electrodes)
        every = [faces for found in self._faces for faces in found]
        self._plates = [faces for faces in every if len(faces.edges) == 1 and np.all(faces.edges == OPEN)]
        edges = [min(float(np.linalg.norm(f.panels.u)), float(np.linalg.norm(f.panels.v))) for f in self._plates]
        self._smallest = min([_LARGEST, *(_SHARE * edge for edge in edges)])

    @cached_property
    def outline(self) -> Floats:
        """Points (n, 3) [m] all over the unit, for distances."""
        surface = joined([faces.panels for found in self._faces for faces in found])
        return point_sample(surface, 0.005)

    def mesh(self, fineness: float, *, outlines: bool = True) -> tuple[Panels, Integers]:
        """Return the panels of the unit by itself, and the electrode (n,) of each.

        Args:
            fineness: CELLS over the divisions of a plate's edge.
            outlines: whether what is behind a plate is graded towards its outline, and panels to their neighbours.
        """
        parts = [joined([self._surface(faces, fineness, outlines) for faces in found]) for found in self._faces]
        if outlines and len(parts) > 1:
            samples = [point_sample(part, 0.005) for part in parts]
            parts = [
                refined(
                    part,
                    near_tree(np.concatenate(samples[:k] + samples[k + 1 :])),
                    slope=_SLOPE * fineness,
                    smallest=self._smallest * fineness,
                )
                for k, part in enumerate(parts)
            ]
        return joined(parts), np.repeat(np.arange(len(parts)), [len(part.area) for part in parts])

    @cached_property
    def charged(self) -> tuple[Charged, Charged]:
        """The coarser and the finer mesh that phi comes from."""
        scale = 1.0
        while len(self.mesh(scale * FINENESSES[1])[1]) > self._most_panels:
            scale *= 1.2
        coarse, fine = (self._charged(scale * fineness) for fineness in FINENESSES)
        return coarse, fine

    @cached_property
    def matrix(self) -> Floats:
        """Maxwell's capacitances (k, k) [m] of the unit alone, extrapolated."""
        coarse, fine = self.charged
        return np.asarray(self.extrapolated(coarse.matrix, fine.matrix))

    def potential(self, panels: Panels) -> tuple[Floats, Floats]:
        """Return the mean potentials (k, n) on panels, each electrode alone at 1 V: extrapolated, and the fine one."""
        first, second = (mean_potentials(panels, mesh.panels, mesh.charges) for mesh in self.charged)
        return self.extrapolated(first, second), second

    @cached_property
    def around(self) -> Potential:
        """The potential around the unit, at any point."""
        return Potential(self)

    @staticmethod
    def extrapolated(coarse: Any, fine: Any) -> Any:
        """Return what potentials of both meshes say of a mesh without end."""
        return fine + (fine - coarse) / _GAIN

    def _charged(self, fineness: float) -> Charged:
        panels, electrode = self.mesh(fineness)
        influences = np.empty((len(electrode), len(electrode)))
        fill_influences(panels, influences)
        if cholesky.factor(influences) >= 0:
            names = ", ".join(e.name for e in self.electrodes)
            raise InvalidValue("electrodes", names, "must not touch or overlap each other")
        drives = np.zeros((len(self.electrodes), len(electrode)))
        drives[electrode, np.arange(len(electrode))] = 1.0
        charges = drives.copy()
        cholesky.solve(influences, 0, charges)
        return Charged(panels, charges, products(drives, charges))

    def _surface(self, faces: Faces, fineness: float, outlines: bool) -> Panels:
        cells = CELLS / fineness
        if not outlines or (len(faces.edges) == 1 and np.all(faces.edges == OPEN) and not self._under(faces, 0)):
            return graded(faces, cells)
        longest = float(np.max(np.linalg.norm(np.concatenate([faces.panels.u, faces.panels.v]), axis=1)))
        cut, parts = [], []
        for i in np.flatnonzero(faces.panels.four):
            found = self._under(faces, int(i))
            if not found:
                continue
            cut.append(i)
            width = min(height for height, _, _ in found) * fineness / FINENESSES[0]
            u, v = faces.panels.u[i], faces.panels.v[i]
            along = []
            for axis, (edge, ends) in enumerate(((u, faces.edges[i, 2:]), (v, faces.edges[i, :2]))):
                length = float(np.linalg.norm(edge))
                cuts = _apart([span[axis][k] for _, *span in found for k in (0, 1)], width / length)
                even = bool(np.all(faces.edges[i] == OPEN))
                share = cells if even else cells * length / longest
                along.append(cut_nodes(cuts, length, share, width, (float(ends[0]), float(ends[1]))))
            parts.append(grid(faces.panels.origin[i], u, v, along[0], along[1]))
        rest = np.setdiff1d(np.arange(len(faces.edges)), cut)
        if len(rest):
            parts.append(graded(Faces(chosen(faces.panels, rest), faces.edges[rest]), cells))
        return joined(parts)

    def _under(self, faces: Faces, i: int) -> list[tuple[float, tuple[float, float], tuple[float, float]]]:
        """Return the plates that are near a parallelogram, parallel to it and along its edges: how far, and where."""
        panels = faces.panels
        u, v = panels.u[i], panels.v[i]
        uu, vv, normal = float(u @ u), float(v @ v), np.cross(u, v)
        if abs(float(u @ v)) > 1e-6 * np.sqrt(uu * vv):
            return []
        normal /= np.linalg.norm(normal)
        found = []
        for plate in self._plates:
            if plate is faces:
                continue
            corner, pu, pv = plate.panels.origin[0], plate.panels.u[0], plate.panels.v[0]
            size = min(float(np.linalg.norm(pu)), float(np.linalg.norm(pv)))
            height = abs(float(normal @ (corner - panels.origin[i])))
            tilted = max(abs(float(normal @ pu)), abs(float(normal @ pv))) > 1e-3 * size
            turned = min(abs(float(pu @ u)) / np.sqrt(uu), abs(float(pv @ u)) / np.sqrt(uu)) > 1e-3 * size
            if tilted or turned or not 0.0 < height < _NEAR * size:
                continue
            corners = corner - panels.origin[i] + np.stack([0.0 * pu, pu, pv, pu + pv])
            a, b = corners @ u / uu, corners @ v / vv
            if a.max() > 0.0 and a.min() < 1.0 and b.max() > 0.0 and b.min() < 1.0:
                found.append((height, (float(a.min()), float(a.max())), (float(b.min()), float(b.max()))))
        return found


def _check_apart(electrodes: Sequence[Electrode]) -> None:
    """Raise InvalidValue where two electrodes touch or overlap, with their names."""
    surfaces = [np.ascontiguousarray(np.concatenate(electrode.surfaces)) for electrode in electrodes]
    for b, later in enumerate(electrodes):
        tree = triangle_tree(surfaces[b])
        for a, earlier in enumerate(electrodes[:b]):
            if least_gap(surfaces[a], surfaces[b], tree, TOUCHING).distance < TOUCHING:
                names = f"{earlier.name}, {later.name}"
                raise InvalidValue(
                    "electrodes", names, "must not touch or overlap each other; leave a gap between them"
                )


def _apart(places: list[float], least: float) -> list[float]:
    """Return the places inside 0 .. 1 that are at least so far from the ends and from each other."""
    result: list[float] = []
    for place in sorted(places):
        if least <= place <= 1.0 - least and (not result or place - result[-1] >= least):
            result.append(place)
    return result
