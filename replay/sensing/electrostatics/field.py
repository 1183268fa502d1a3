"""The fast method: few unknowns, where they matter in each pose, with an estimate of what that costs.

One cut goes through the trees of all bodies and of the unit (`cut`). With its N nodes, and with half as many, whose
influences are means of theirs,

    dC = d_N + (d_N - d_N/2) / 2,    error = |dC - d_N| + (doubt_k + doubt_l + 1 %) |dC|,

doubt what the extrapolation of phi makes; and where a diagonal entry's error is more than it may be, and |dC - d_N| has
a part in that, once more with 2 N. Fewer unknowns make the increase smaller, never larger.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from replay.numerics import transforms
from replay.numerics.arrays import Floats, Integers
from replay.sensing.electrostatics import cholesky
from replay.sensing.electrostatics.algebra import Response, response
from replay.sensing.electrostatics.bem import BemReading
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.coupling import fill_influences, means_below, place_below
from replay.sensing.electrostatics.cut import cut, gathered
from replay.sensing.electrostatics.nodes import place, placed_apart
from replay.sensing.electrostatics.placement import RESOLVED, PosedBodies
from replay.sensing.electrostatics.surveys import PIECE, growing, trees
from replay.sensing.electrostatics.unit import Unit

_NODES = 400
"""N: nodes of bodies and unit together."""

_COMMON = 1e-2
"""Share of a reading that both cuts may be off alike: rules of integration, grids (measured on the shared cases)."""

_LOOKS = 16
"""Poses of a block that decide into which pieces bodies are taken apart for E."""

_MENDS = 0.25
"""Share of `accuracy` that few nodes must cost for more of them to be taken: of what else makes an error they mend
nothing."""

_FLOOR = 0.1
"""Share of the largest diagonal entry below which an entry's error does not ask for more nodes."""


class _System(NamedTuple):
    """The equations of one cut."""

    influences: Floats  # (m + n, m + n) [1/m], the unit's nodes first; the upper triangle
    phi: Floats  # (k, n), the unit's potential at the bodies' nodes
    shape: Integers  # (n,) of each of these


class FieldSolver:
    """A unit and its bodies, ready for any pose.

    Args:
        unit: the electrodes.
        bodies: what is before it.
        behind: whether the last electrode is what is behind the plates.
        accuracy: error of a diagonal entry from which on twice as many nodes are taken, as a share of it.
    """

    def __init__(self, unit: Unit, bodies: Sequence[ConductorBody], *, behind: bool, accuracy: float = 0.03) -> None:
        self.potential = unit.around
        self._accuracy = accuracy
        self._common = self.potential.doubt[:, None] + self.potential.doubt + _COMMON
        self._sensors = len(unit.electrodes) - behind
        self._body_of_shape = np.repeat(np.arange(len(bodies)), [len(body.shapes) for body in bodies])
        self._trees = trees([triangles for body in bodies for triangles in body.shapes], pieces=True)
        self._image = trees([surface for electrode in unit.electrodes for surface in electrode.surfaces], pieces=False)
        self._posed = placed_apart(self._trees.nodes)

    def proxies(self, T: Floats) -> Floats:
        """Return E (n, k) [m] of n poses (n, bodies, 4, 4), see `keyframes`."""
        nodes = self._trees.nodes
        which = self._pieces(T[np.linspace(0, len(T) - 1, min(len(T), _LOOKS)).round().astype(np.intp)])
        body = self._body_of_shape[nodes.shape[which]]
        return self.potential.proxies(nodes.panels.centroid[which], nodes.panels.area[which], body, T, RESOLVED)

    def _pieces(self, T: Floats) -> Integers:
        """Return nodes that the bodies consist of, none much larger than it is far from the unit in any of n poses."""
        bodies = self._trees
        panels, child = bodies.nodes.panels, bodies.nodes.child
        done, waiting = [], np.arange(bodies.roots)
        while len(waiting):
            poses = T[:, self._body_of_shape[bodies.nodes.shape[waiting]]]
            distance = self.potential.at(transforms.apply(poses, panels.centroid[waiting]).reshape(-1, 3))[1]
            least = distance.reshape(len(T), -1).min(axis=0)
            first = child[waiting]
            small = (first < 0) | (first >= bodies.known) | (panels.diameter[waiting] <= np.maximum(PIECE, least))
            done.append(waiting[small])
            waiting = np.concatenate([first[~small], first[~small] + 1])
        return np.concatenate(done)

    def solve(self, placement: PosedBodies, count: int) -> BemReading | None:
        """Return what bodies change in one pose by so many nodes, and by half of them; None as of `read`."""
        return self._read(placement, count)

    def read(self, placement: PosedBodies) -> BemReading | None:
        """Return what bodies change in one pose; None where conductors overlap so that no charges are an answer."""
        found = self._read(placement, _NODES)
        if found is None:
            return None
        own = found.increase.diagonal()[: self._sensors]
        error = found.error.diagonal()[: self._sensors]
        few = error - self._common[: self._sensors].diagonal() * own
        asks = (own > _FLOOR * own.max()) & (error > self._accuracy * own) & (few > _MENDS * self._accuracy * own)
        return self._read(placement, 2 * _NODES) or found if asks.any() else found

    def _read(self, placement: PosedBodies, count: int) -> BemReading | None:
        with growing:
            systems = self._systems(placement, count)
        if systems is None:
            return None
        coarse, fine = (self._respond(placement, system) for system in systems)
        if coarse is None or fine is None:
            return None
        increase = 1.5 * fine.increase - 0.5 * coarse.increase
        shares = 1.5 * fine.shares - 0.5 * coarse.shares
        return BemReading(increase, np.abs(increase - fine.increase) + self._common * np.abs(increase), shares)

    def _systems(self, placement: PosedBodies, count: int) -> tuple[_System, _System] | None:
        """Return the equations with half as many nodes, and with all; None where no node is left."""
        bodies, unit = self._trees, self._image
        for each in (bodies, unit):
            each.make_room(4 * count)
        nodes = bodies.nodes
        poses = np.ascontiguousarray(np.stack(placement.poses)[self._body_of_shape])
        coarse_cut, fine_cut = self._cuts(poses, count)
        own, image = fine_cut[fine_cut >= 0], -1 - fine_cut[fine_cut < 0]
        body = self._body_of_shape[nodes.shape]
        own = own[np.argsort(body[own], kind="stable")]
        place(nodes, own, poses, self._posed)
        if len(self._body_of_shape) > 1:
            own = self._uncovered(placement, own)
        if placement.cut:
            own = own[self.potential.at(self._posed.panels.centroid[own])[1] >= RESOLVED]
        if len(own) == 0:
            return None
        total = len(image) + len(own)
        fine = _System(np.empty((total, total)), self._phi(own), nodes.shape[own])
        memories = bodies.memory, unit.memory
        fill_influences(nodes, self._posed, body, own, unit.nodes, image, *memories, fine.influences)
        part = np.concatenate(
            [
                place_below(unit.nodes, -1 - coarse_cut[coarse_cut < 0], image),
                len(coarse_cut) + place_below(nodes, coarse_cut[coarse_cut >= 0], own),
            ]
        )
        areas = np.concatenate([unit.nodes.panels.area[image], nodes.panels.area[own]])
        return _above(fine, np.unique(part, return_inverse=True)[1], areas), fine

    def _uncovered(self, placement: PosedBodies, own: Integers) -> Integers:
        """Return the nodes, which are placed, whose middle lies on no earlier shape of their conductor."""
        shape, covered = self._trees.nodes.shape[own], np.zeros(len(own), np.bool_)
        for each in np.unique(shape):
            at = shape == each
            covered[at] = placement.covered(int(each), self._posed.panels.centroid[own[at]])
        return own[~covered]

    def _cuts(self, poses: Floats, count: int) -> tuple[Integers, Integers]:
        """Return nodes of bodies as they are, of the unit as -1 - node: half as many, and all."""
        bodies, unit = self._trees, self._image
        panels, survey = bodies.nodes.panels, bodies.survey
        points = transforms.apply(poses[bodies.nodes.shape[survey]], panels.centroid[survey])
        phi, distance = self.potential.at(points)
        phi = phi[:, : self._sensors]
        share = panels.area[survey] / np.maximum(distance, RESOLVED)
        square = np.ascontiguousarray((phi * phi / ((phi * phi * share[:, None]).sum(axis=0) + 1e-300)).max(axis=1))
        squares, distances = np.zeros(bodies.known), np.zeros(bodies.known)
        squares[survey], distances[survey] = square, distance
        gathered(bodies.nodes, bodies.known, squares, distances)
        looked_at = bodies.nodes, bodies.roots, bodies.known, squares, distances
        half, whole = cut(
            *looked_at, unit.nodes, unit.roots, points, square, poses, *self.potential.surface, count // 2, count
        )
        return half[: half[-1]], whole[: whole[-1]]

    @staticmethod
    def _respond(placement: PosedBodies, system: _System) -> Response | None:
        """Return what bodies change with the charges of one cut; the influences become their factor."""
        if cholesky.factor(system.influences) >= 0:
            return None
        return response(system.influences, system.phi, system.shape, placement.conductor_of_shape, placement.earth)

    def _phi(self, own: Integers) -> Floats:
        """Return the mean potentials (k, n) of nodes that are placed."""
        points, weights = self._posed.points[own], self._trees.nodes.weights[own]
        counts = weights > 0.0
        found, _ = self.potential.at(points[counts], exact=True)
        phi = np.zeros((*weights.shape, found.shape[1]))
        phi[counts] = found * weights[counts][:, None]
        return np.ascontiguousarray(phi.sum(axis=1).T)


def _above(fine: _System, part: Integers, areas: Floats) -> _System:
    """Return the equations of a cut above another, of whose nodes `part` tells what they are part of."""
    total, m = int(part.max()) + 1, len(areas) - len(fine.shape)
    first = int(part[:m].max()) + 1
    weights: Floats = areas / np.bincount(part, weights=areas)[part]
    influences = np.zeros((total, total))
    means_below(fine.influences, part, weights, influences)
    phi = np.stack([np.bincount(part[m:] - first, weights=weights[m:] * row).astype(np.float64) for row in fine.phi])
    shape = np.zeros(total - first, fine.shape.dtype)
    shape[part[m:] - first] = fine.shape
    return _System(influences, phi, shape)
