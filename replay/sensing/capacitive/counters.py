"""What a suite of capacitive sensors counts while it works."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from replay.sensing.capacitive.tree import tree_sum


@dataclass
class CapacitiveCounters:
    """What a suite did since it was made; with other methods than "tree" only the first three are counted.

    Attributes:
        integrals: asked for: a plate, a body and a frame each.
        triangles: of the bodies, over all integrals.
        repeated: integrals taken from a frame of the block with the same pose.
        nodes: tree nodes looked at.
        clusters: those summed as a whole.
        in_clusters: triangles in these.
        alone: triangles summed one by one.
    """

    integrals: int = 0
    triangles: int = 0
    repeated: int = 0
    nodes: int = 0
    clusters: int = 0
    in_clusters: int = 0
    alone: int = 0

    def add(self, counted: Sequence[int]) -> None:
        """Add the counts of `tree_sum.sum_tree`."""
        self.nodes += counted[tree_sum.NODES]
        self.clusters += counted[tree_sum.CLUSTERS]
        self.in_clusters += counted[tree_sum.IN_CLUSTERS]
        self.alone += counted[tree_sum.ALONE]
