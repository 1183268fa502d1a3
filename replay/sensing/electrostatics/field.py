"""The fast method: few unknowns, where they matter in each pose, with an estimate of what that costs.

One cut goes through the trees of all bodies and of the unit (`cut`). With its N nodes and with half as many,

    dC = d_N + (d_N - d_N/2) / 2,    error = |dC - d_N| + |effect of the extrapolation of phi| / 2 + 1 % dC,

and where a diagonal entry's error is more than it may be, once more with 2 N. Fewer unknowns make the increase smaller,
never larger.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

import numpy as np
from numba import float64, int64

from replay.numerics import transforms
from replay.numerics.arrays import Floats, Integers
from replay.numerics.jit import entry, kernel
from replay.sensing.electrostatics import cholesky
from replay.sensing.electrostatics.algebra import Response, response
from replay.sensing.electrostatics.bem import BemReading
from replay.sensing.electrostatics.body import ConductorBody
from replay.sensing.electrostatics.cut import cut, gathered
from replay.sensing.electrostatics.faces import faces_of
from replay.sensing.electrostatics.grading import graded
from replay.sensing.electrostatics.memory import MEMORY_TYPE, Memory, make_memory, remembered
from replay.sensing.electrostatics.nodes import (
    ACROSS,
    NODES_TYPE,
    WITHIN,
    Nodes,
    children,
    far_mean,
    make_nodes,
    node_mean,
)
from replay.sensing.electrostatics.panels import Panels
from replay.sensing.electrostatics.placement import RESOLVED, PosedBodies
from replay.sensing.electrostatics.potential_grid import NEAR, Potential
from replay.sensing.electrostatics.unit import Unit

_NODES = 400
_CELLS = 5.0
"""Divisions of edges in the grids that trees end in, before anything is halved: fine where charge gathers."""

_SURVEY = 1200
_PIECE = 0.025
"""Bodies are looked at in up to so many pieces, which need not be smaller than this [m]."""

_COMMON = 1e-2
"""Share of a reading that both cuts may be off alike: rules of integration, grids (measured on the shared cases)."""

_FLOOR = 0.02
"""Share of the largest diagonal entry below which an entry's error does not ask for more nodes."""


class Field:
    """A unit and its bodies, ready for any pose.

    Args:
        unit: the electrodes.
        surface: (n, 3, 3) [m], the unit's triangles.
        bodies: what is before it.
        behind: whether the last electrode is what is behind the plates.
        accuracy: error of a diagonal entry from which on twice as many nodes are taken, as a share of it.
    """

    def __init__(
        self, unit: Unit, surface: Floats, bodies: Sequence[ConductorBody], *, behind: bool, accuracy: float = 0.03
    ) -> None:
        self.potential = Potential(unit, surface)
        self._accuracy = accuracy
        self._sensors = len(unit.electrodes) - behind
        self._body_of_shape = np.repeat(np.arange(len(bodies)), [len(body.shapes) for body in bodies])
        self._nodes = make_nodes([graded(faces, _CELLS) for body in bodies for faces in body.faces])
        self._roots = len(self._body_of_shape)
        _split(self._nodes, _SURVEY, _PIECE)
        self._known = int(self._nodes.count[0])
        self._survey = np.flatnonzero(self._nodes.child[: self._known] < 0)
        self._first_children = self._nodes.child[: self._known].copy()
        surfaces = [faces_of(surface) for electrode in unit.electrodes for surface in electrode.surfaces]
        self._image = make_nodes([graded(faces, _CELLS) for faces in surfaces])
        self._image_roots = len(surfaces)
        self._memory, self._image_memory = make_memory(), make_memory()

    def survey(self, placement: PosedBodies) -> tuple[Floats, Floats, Floats]:
        """Return points (n, 3) [m] of the bodies in the unit's frame, phi (k, n) and the distances (n,) [m] there."""
        panels, body = self._nodes.panels, self._body_of_shape[self._nodes.shape[self._survey]]
        points = np.empty((len(self._survey), 3))
        for index, pose in enumerate(placement.poses):
            own = body == index
            points[own] = transforms.apply(pose, panels.centroid[self._survey[own]])
        return points, *self.potential.interpolated(points)

    def proxy(self, placement: PosedBodies) -> Floats:
        """Return E (k,) [m], see `keyframes`."""
        return self._proxy(*self.survey(placement)[1:])

    def _proxy(self, phi: Floats, distance: Floats) -> Floats:
        share = self._nodes.panels.area[self._survey] / np.maximum(distance, RESOLVED)
        return np.asarray((phi * phi * share).sum(axis=1) + 1e-300)

    def read(self, placement: PosedBodies) -> BemReading | None:
        """Return what bodies change in one pose; None where conductors overlap so that no charges are an answer."""
        found = self._read(placement, _NODES)
        if found is None:
            return None
        own = found.increase.diagonal()[: self._sensors]
        counts = own > _FLOOR * own.max()
        if (found.error.diagonal()[: self._sensors][counts] > self._accuracy * own[counts]).any():
            return self._read(placement, 2 * _NODES) or found
        return found

    def _read(self, placement: PosedBodies, count: int) -> BemReading | None:
        nodes = self._nodes
        if nodes.count[0] + 4 * count > len(nodes.alone):
            self._forget()
        points, phi, distance = self.survey(placement)
        each = phi[: self._sensors] ** 2 / self._proxy(phi, distance)[: self._sensors, None]
        squares, distances = np.zeros(self._known), np.zeros(self._known)
        squares[self._survey], distances[self._survey] = each.max(axis=0), distance
        gathered(nodes, self._known, squares, distances)
        poses = np.ascontiguousarray(np.stack(placement.poses)[self._body_of_shape])
        cuts = cut(
            nodes,
            self._roots,
            self._known,
            squares,
            distances,
            self._image,
            self._image_roots,
            points,
            np.ascontiguousarray(squares[self._survey]),
            poses,
            self.potential.surface,
            self.potential.tree,
            count // 2,
            count,
        )
        posed = self._posed(poses)
        half, whole = (self._solve(placement, posed, row[: row[-1]]) for row in cuts)
        if half is None or whole is None:
            return None
        (coarse, _), (fine, change) = half, whole
        increase = 1.5 * fine.increase - 0.5 * coarse.increase
        shares = 1.5 * fine.shares - 0.5 * coarse.shares
        error = np.abs(increase - fine.increase) + 0.5 * np.abs(change) + _COMMON * np.abs(increase)
        return BemReading(increase, error, shares)

    def _solve(self, placement: PosedBodies, posed: Nodes, which: Integers) -> tuple[Response, Floats] | None:
        """Return what bodies change with the charges of one cut, and what of it the extrapolation of phi makes."""
        own, image = np.ascontiguousarray(which[which >= 0]), np.ascontiguousarray(-1 - which[which < 0])
        if placement.cut:
            outside = self.potential.distances(posed.panels.centroid[own]) >= RESOLVED
            own = np.ascontiguousarray(own[outside])
        if len(own) == 0:
            return None
        upper = np.empty((len(own) + len(image),) * 2)
        body = self._body_of_shape[self._nodes.shape]
        _fill_influences(self._nodes, posed, body, own, self._image, image, self._memory, self._image_memory, upper)
        if cholesky.factor(upper) >= 0:
            return None
        phi, fine = self._phi(posed, own)
        found = response(upper, phi, self._nodes.shape[own], placement.conductor_of_shape, placement.earth)
        change = -np.einsum("ki,li->kl", found.charges, phi - fine)
        return found, change + change.T

    def _phi(self, posed: Nodes, own: Integers) -> tuple[Floats, Floats]:
        """Return the mean potentials (k, n) of nodes: extrapolated, and where a grid would not do of the finer mesh."""
        points, weights = posed.points[own].reshape(-1, 3), posed.weights[own].reshape(-1)
        phi, distance = self.potential.interpolated(points)
        fine = phi.copy()
        near = np.flatnonzero((distance < NEAR) & (weights > 0.0))
        if len(near):
            phi[:, near], fine[:, near] = self.potential.summed(np.ascontiguousarray(points[near]))
        k = len(phi)
        return tuple(np.ascontiguousarray((each * weights).reshape(k, -1, 4).sum(axis=2)) for each in (phi, fine))  # type: ignore[return-value]

    def _posed(self, poses: Floats) -> Nodes:
        """Return the nodes that there are, each body in its pose, in the unit's frame."""
        n = int(self._nodes.count[0])
        T = poses[self._nodes.shape[:n]]
        panels = self._nodes.panels
        turn = T.copy()
        turn[:, :3, 3] = 0.0
        placed = Panels(
            transforms.apply(T, panels.origin[:n]),
            transforms.apply(turn, panels.u[:n]),
            transforms.apply(turn, panels.v[:n]),
            panels.four[:n],
            transforms.apply(T, panels.centroid[:n]),
            panels.diameter[:n],
            panels.area[:n],
        )
        points = transforms.apply(T[:, None], self._nodes.points[:n])
        rest = self._nodes
        return Nodes(placed, rest.alone[:n], rest.child[:n], points, rest.weights[:n], rest.shape[:n], rest.count)

    def _forget(self) -> None:
        """Make room for halves; what is made again is the same."""
        self._nodes.count[0] = self._known
        self._nodes.child[: self._known] = self._first_children
        self._nodes.child[self._known :] = -1
        self._memory = make_memory()


def _split(nodes: Nodes, most: int, size: float) -> None:
    """Halve the largest panels until there are so many nodes without children, or none is larger than a size [m]."""
    leaves = [k for k in range(int(nodes.count[0])) if nodes.child[k] < 0]
    heap = [(-nodes.panels.diameter[k], k) for k in leaves]
    heapq.heapify(heap)
    while len(heap) < most and -heap[0][0] > size:
        _, k = heapq.heappop(heap)
        first = int(children_of(nodes, k))
        for c in (first, first + 1):
            heapq.heappush(heap, (-nodes.panels.diameter[c], c))


@entry(NODES_TYPE, int64)
@kernel
def children_of(nodes: Nodes, k: int) -> int:
    """Return the first of a node's children, see `nodes.children`."""
    return children(nodes, k)


@entry(
    NODES_TYPE,
    NODES_TYPE,
    int64[::1],
    int64[::1],
    NODES_TYPE,
    int64[::1],
    MEMORY_TYPE,
    MEMORY_TYPE,
    float64[:, ::1],
)
@kernel
def _fill_influences(
    rest: Nodes,
    posed: Nodes,
    body: Integers,
    own: Integers,
    images: Nodes,
    image: Integers,
    memory: Memory,
    image_memory: Memory,
    into: Floats,
) -> None:
    """Write the upper triangle of the influences, the unit's nodes first."""
    stack, shares = np.zeros((400, 2), np.int64), np.zeros(400)
    m, n = len(image), len(own)
    for i in range(m):
        for j in range(i, m):
            value = far_mean(images, image[i], images, image[j], WITHIN[1])
            if value == 0.0:
                value = remembered(image_memory, images, image[i], image[j], stack, shares)
            into[i, j] = value
        for j in range(n):
            value = far_mean(images, image[i], posed, own[j], ACROSS[1])
            if value == 0.0:
                value = node_mean(images, image[i], posed, own[j], ACROSS, stack, shares)
            into[i, m + j] = value
    for i in range(n):
        for j in range(i, n):
            same = body[own[i]] == body[own[j]]
            # of one body in the body's own frame: every pose then finds the same number
            value = (
                far_mean(rest, own[i], rest, own[j], WITHIN[1])
                if same
                else far_mean(posed, own[i], posed, own[j], ACROSS[1])
            )
            if value == 0.0 and same:
                value = remembered(memory, rest, own[i], own[j], stack, shares)
            elif value == 0.0:
                value = node_mean(posed, own[i], posed, own[j], ACROSS, stack, shares)
            into[m + i, m + j] = value
