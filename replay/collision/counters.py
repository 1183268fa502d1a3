"""What a pipeline counts while it works."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from replay.collision import broad, crossing_look, interval_proof, narrow, traversal


@dataclass
class Counters:
    """What a pipeline did since it was made; pair-frames unless said otherwise.

    Attributes:
        pairs: pairs planned.
        static_pairs: of those, pairs that cannot move relative to each other (0 when pairs are given as rules).
        pair_frames: asked for.
        static: answered from the one evaluation of a static pair (0 when pairs are given as rules).
        pruned_by_block: ruled out for a whole block, by the tree over all bodies or by the pair's swept spheres.
        pruned_by_sphere: ruled out by bounding spheres in a frame.
        pruned_by_volume: ruled out by the bounding volumes in a frame.
        pruned_by_way: ruled out because the bodies cannot have come near since they were looked at last.
        repeated: answered from the frame before, the pose being the same.
        narrow: looked at by the narrow phase.
        boxes: pairs of tree boxes bounded.
        gjk_queries: pairs of convex sets decided (for `fcl`, calls of the library).
        gjk_iterations: their iterations.
        gjk_exact: queries that doubles could not decide and double-doubles did.
        contacts: at level contact.
        contained: contacts of a body wholly inside another.
        undecided: at level contact because GJK reached its accuracy limit.
        intervals: between frames, asked for.
        intervals_by_frames: proven by what is known at their ends; what is not told here was proven for a whole block.
        intervals_searched: in doubt, and searched.
        moments: poses between frames that the search looked at.
        moment_queries: pairs of convex sets decided there.
    """

    pairs: int = 0
    static_pairs: int = 0
    pair_frames: int = 0
    static: int = 0
    pruned_by_block: int = 0
    pruned_by_sphere: int = 0
    pruned_by_volume: int = 0
    pruned_by_way: int = 0
    repeated: int = 0
    narrow: int = 0
    boxes: int = 0
    gjk_queries: int = 0
    gjk_iterations: int = 0
    gjk_exact: int = 0
    contacts: int = 0
    contained: int = 0
    undecided: int = 0
    intervals: int = 0
    intervals_by_frames: int = 0
    intervals_searched: int = 0
    moments: int = 0
    moment_queries: int = 0

    def add_intervals(self, proven: Sequence[int], searched: Sequence[int]) -> None:
        """Add the counts of `interval_proof.certify` and of `crossing_search.search`."""
        self.intervals_by_frames += proven[interval_proof.BY_FRAMES]
        self.intervals_searched += proven[interval_proof.IN_DOUBT]
        self.moments += searched[crossing_look.MOMENTS]
        self.moment_queries += searched[traversal.QUERIES]

    def add(self, sieved: Sequence[int], decided: Sequence[int]) -> None:
        """Add the counts of `broad.sieve` and of the narrow phase."""
        self.pruned_by_block += sieved[broad.BY_BLOCK]
        self.pruned_by_sphere += sieved[broad.BY_SPHERE]
        self.pruned_by_volume += sieved[broad.BY_VOLUME]
        self.pruned_by_way += sieved[broad.BY_WAY]
        self.repeated += sieved[broad.BY_REPEAT]
        self.boxes += decided[traversal.BOXES]
        self.gjk_queries += decided[traversal.QUERIES]
        self.gjk_iterations += decided[traversal.ITERATIONS]
        self.gjk_exact += decided[traversal.IN_DOUBLE_DOUBLE]
        self.narrow += decided[narrow.RUNS]
        self.contained += decided[narrow.SEEN_INSIDE]
        self.contacts += decided[narrow.CONTACTS]
        self.undecided += decided[narrow.UNDECIDEDS]
