"""The trees of bodies and units that `field` cuts, with what is known of them: kept by content for the whole process.

They are fine at sharp edges, and bodies fine enough to be looked at. Halves and influences are added as poses ask for
them; each follows from the surfaces alone, so that nothing depends on who asked first.
"""

from __future__ import annotations

import hashlib
import heapq
import threading
from collections import OrderedDict
from collections.abc import Sequence

import numpy as np

from replay.numerics.arrays import Floats
from replay.sensing.electrostatics.faces import faces_of
from replay.sensing.electrostatics.grading import graded
from replay.sensing.electrostatics.memory import make_memory
from replay.sensing.electrostatics.nodes import first_child, make_nodes, with_room

_CELLS = 5.0
"""Divisions of edges in the grids that trees end in, before anything is halved: fine where charge gathers."""

_SURVEY = 1200
PIECE = 0.025
"""Bodies are looked at in up to so many pieces, which need not be smaller than this [m]."""

_KEPT = 6

growing = threading.Lock()
"""Held by who asks for halves or influences."""


class Trees:
    """The trees over surfaces that are rigid to each other.

    Args:
        surfaces: (n, 3, 3) [m] each.
        pieces: whether the largest panels are halved, until there are enough pieces to look at.

    Attributes:
        nodes: the roots first, one a surface.
        roots: how many.
        known: how many nodes there always are.
        survey: those of them without children.
        memory: of influences.
    """

    def __init__(self, surfaces: Sequence[Floats], *, pieces: bool) -> None:
        self.nodes = with_room(make_nodes([graded(faces_of(triangles), _CELLS) for triangles in surfaces]))
        self.roots = len(surfaces)
        if pieces:
            self._split()
        self.known = int(self.nodes.made[0])
        self._children = self.nodes.child[: self.known].copy()
        self.survey = np.flatnonzero(self._children < 0)
        self.memory = make_memory()

    def make_room(self, halves: int) -> None:
        """Forget what was added if there is no room for so many halves; what is made again is the same."""
        if self.nodes.made[0] + halves > len(self.nodes.alone):
            self.nodes.made[0] = self.known
            self.nodes.child[: self.known] = self._children
            self.nodes.child[self.known :] = -1
            self.memory = make_memory()

    def _split(self) -> None:
        nodes = self.nodes
        heap = [(-nodes.panels.diameter[k], k) for k in range(int(nodes.made[0])) if nodes.child[k] < 0]
        heapq.heapify(heap)
        while len(heap) < _SURVEY and -heap[0][0] > PIECE:
            _, k = heapq.heappop(heap)
            first = first_child(nodes, k)
            for c in (first, first + 1):
                heapq.heappush(heap, (-nodes.panels.diameter[c], c))


_trees: OrderedDict[bytes, Trees] = OrderedDict()


def trees(surfaces: Sequence[Floats], *, pieces: bool) -> Trees:
    """Return the trees over surfaces; those that this process made before come with what is known of them."""
    digest = hashlib.sha256(b"pieces" if pieces else b"")
    for surface in surfaces:
        digest.update(f" {len(surface)} ".encode() + np.ascontiguousarray(surface).tobytes())
    key = digest.digest()
    with growing:
        if key not in _trees:
            _trees[key] = Trees(surfaces, pieces=pieces)
            while len(_trees) > _KEPT:
                _trees.popitem(last=False)
        _trees.move_to_end(key)
        return _trees[key]
