"""From link poses to levels and clearances of all pairs, a block of frames at a time."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from replay.collision import broad, narrow, traversal
from replay.collision.bodies import Bodies, Bounds, Pieces, collect, fit_volumes
from replay.collision.columns import CollisionColumns
from replay.collision.pairs import CollisionBody, Pair
from replay.errors import InvalidValue
from replay.kinematics.linkage import Linkage, LinkPoses

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

LINK_PAIRS_AT_ONCE = 512
"""Relative poses held at a time: 512 link pairs of 256 frames are 16 MiB."""


@dataclass
class Counters:
    """What a pipeline did since it was made; pair-frames unless said otherwise.

    Attributes:
        pairs: pairs planned.
        static_pairs: of those, pairs that cannot move relative to each other.
        pair_frames: asked for.
        static: answered from the one evaluation of a static pair.
        pruned_by_block: ruled out by the swept spheres of a block.
        pruned_by_sphere: ruled out by bounding spheres in a frame.
        pruned_by_volume: ruled out by the bounding volumes in a frame.
        repeated: answered from the frame before, the pose being the same.
        narrow: looked at by the narrow phase.
        boxes: pairs of tree boxes bounded.
        gjk_queries: pairs of convex sets decided (for `fcl`, calls of the library).
        gjk_iterations: their iterations.
        gjk_exact: queries that doubles could not decide and double-doubles did.
        contacts: at level contact.
        contained: contacts of a body wholly inside another.
        undecided: at level contact because GJK reached its accuracy limit.
    """

    pairs: int = 0
    static_pairs: int = 0
    pair_frames: int = 0
    static: int = 0
    pruned_by_block: int = 0
    pruned_by_sphere: int = 0
    pruned_by_volume: int = 0
    repeated: int = 0
    narrow: int = 0
    boxes: int = 0
    gjk_queries: int = 0
    gjk_iterations: int = 0
    gjk_exact: int = 0
    contacts: int = 0
    contained: int = 0
    undecided: int = 0


class NarrowPhase(Protocol):
    """What decides the pair-frames that the broad phase leaves; see `narrow.decide` for the arguments."""

    def __call__(
        self,
        pairs: Integers,
        poses: Floats,
        limit: float,
        task: NDArray[np.uint8],
        level: NDArray[np.uint8],
        clearance: Floats,
        undecided: NDArray[np.bool_],
        counts: Integers,
    ) -> None: ...


class CollisionPipeline:
    """Levels and clearances of pairs of bodies; everything that is constant is computed once, here.

    Args:
        bodies: shapes in their links' frames.
        pairs: pairs to test, see `pairs.plan_pairs`; the columns' order.
        linkage: whose links the bodies are on.
        bounds: bounding volumes, which define the level `bounds`.
        narrowphase: "gjk" (this package's own) or "fcl" (python-fcl).
        pieces: how concave bodies are collided, see `geometry.convex_sets`.
        clearance: "never"; "near": exact up to `margin`; "always".
        margin: [m], for "near".

    Raises:
        InvalidValue: an unknown option, or a margin that is not finite and positive.
        MissingPackageError: "fcl" without python-fcl.
    """

    def __init__(
        self,
        bodies: Sequence[CollisionBody],
        pairs: Sequence[Pair],
        linkage: Linkage,
        *,
        bounds: Bounds = "obb",
        narrowphase: Literal["gjk", "fcl"] = "gjk",
        pieces: Pieces = "exact",
        clearance: Literal["never", "near", "always"] = "near",
        margin: float = 0.05,
    ) -> None:
        if clearance not in ("never", "near", "always"):
            raise InvalidValue("clearance", clearance, "must be one of never, near, always")
        if narrowphase not in ("gjk", "fcl"):
            raise InvalidValue("narrowphase", narrowphase, "must be one of gjk, fcl")
        if clearance == "near" and not 0.0 < margin < math.inf:
            raise InvalidValue("margin", margin, "must be finite and positive [m]")
        self.pairs = tuple(pairs)
        self.counters = Counters(pairs=len(self.pairs), static_pairs=sum(pair.static for pair in self.pairs))
        self._limit = {"never": 0.0, "near": float(margin), "always": math.inf}[clearance]
        self._uses_world = bounds == "aabb"
        used = sorted({k for pair in self.pairs for k in (pair.a, pair.b)})
        place = {body: k for k, body in enumerate(used)}
        chosen = [bodies[k] for k in used]
        self._links = [body.link for body in chosen]
        self._rows = np.array([[place[pair.a], place[pair.b]] for pair in self.pairs], dtype=np.int64).reshape(-1, 2)
        self._static = np.array([pair.static for pair in self.pairs], dtype=bool)
        if bounds == "aabb":  # their boxes turn with their common base
            self._static[:] = False
        self._static_columns: CollisionColumns | None = None
        self._decide: NarrowPhase | None = None
        if chosen:
            arrays = collect(chosen, pieces=pieces)
            self._volumes = fit_volumes(chosen, arrays, bounds=bounds, pieces=pieces)
            self._decide = _engine(narrowphase, chosen, arrays)

    def run(self, poses: LinkPoses) -> CollisionColumns:
        """Return the columns of a block of n frames; they depend on no other block.

        Accuracy: a clearance is right to 1e-12 of itself plus 1e-14 of the bodies' reach and offset
        (tests/collision/test_pipeline.py); levels are decided as `gjk.intersect` does.
        """
        n, count = len(poses.local), len(self.pairs)
        self.counters.pair_frames += n * count
        columns = _empty(n, count)
        moving = np.flatnonzero(~self._static)
        fixed = np.flatnonzero(self._static)
        if n == 0:
            return columns
        if len(fixed):
            if self._static_columns is None:
                self._static_columns = _empty(1, len(fixed))
                self._evaluate(poses.slice(0, 1), fixed, self._static_columns, np.arange(len(fixed)))
            self.counters.static += n * len(fixed)
            _copy(self._static_columns, columns, fixed)
        self._evaluate(poses, moving, columns, moving)
        return columns

    def _evaluate(self, poses: LinkPoses, chosen: Integers, columns: CollisionColumns, target: Integers) -> None:
        """Compute pairs `chosen` for all frames into the columns `target`, a bounded number of link pairs at a time."""
        n = len(poses.local)
        for part, links in self._groups(chosen):
            relative = np.empty((len(links), n, 4, 4))
            for q, (a, b) in enumerate(links):
                relative[q] = poses.relative(a, b)
            bases = sorted({a for a, _ in links}) if self._uses_world else []
            turns = np.empty((max(1, len(bases)), n if self._uses_world else 0, 3, 3))
            for k, link in enumerate(bases):
                turns[k] = poses.world[:, link, :3, :3]
            link_row = {pair: q for q, pair in enumerate(links)}
            base_row = {link: k for k, link in enumerate(bases)}
            rows = np.empty((len(part), 4), dtype=np.int64)
            for k, pair in enumerate(part):
                a, b = self._rows[pair]
                links_of = (self._links[a], self._links[b])
                rows[k] = a, b, link_row[links_of], base_row.get(links_of[0], 0)
            self._run_kernels(rows, relative, turns, columns, target[np.searchsorted(chosen, part)])

    def _run_kernels(
        self, rows: Integers, relative: Floats, turns: Floats, columns: CollisionColumns, target: Integers
    ) -> None:
        assert self._decide is not None
        n, count = relative.shape[1], len(rows)
        part = _empty(n, count)
        task = np.zeros((n, count), dtype=np.uint8)
        sieved = np.zeros(broad.COUNTS, dtype=np.int64)
        decided = np.zeros(narrow.COUNTS, dtype=np.int64)
        if turns.shape[1] == 0:  # not read
            turns = np.zeros((1, n, 3, 3))
        broad.sieve(self._volumes, rows, relative, turns, self._limit, part.level, task, sieved)
        self._decide(rows, relative, self._limit, task, part.level, part.clearance, part.undecided, decided)
        part.evaluated[:] = ~np.isnan(part.clearance)
        for name in ("level", "clearance", "evaluated", "undecided"):
            getattr(columns, name)[:, target] = getattr(part, name)
        self._count(sieved.tolist(), decided.tolist())

    def _groups(self, chosen: Integers) -> Iterator[tuple[list[int], list[tuple[int, int]]]]:
        """Yield pairs and the link pairs they need, at most LINK_PAIRS_AT_ONCE of these a group."""
        by_links: dict[tuple[int, int], list[int]] = {}
        for pair in chosen.tolist():
            a, b = self._rows[pair]
            by_links.setdefault((self._links[a], self._links[b]), []).append(pair)
        links = list(by_links)
        for begin in range(0, len(links), LINK_PAIRS_AT_ONCE):
            group = links[begin : begin + LINK_PAIRS_AT_ONCE]
            yield sorted(pair for key in group for pair in by_links[key]), group

    def _count(self, sieved: list[int], decided: list[int]) -> None:
        counters = self.counters
        counters.pruned_by_block += sieved[broad.BY_BLOCK]
        counters.pruned_by_sphere += sieved[broad.BY_SPHERE]
        counters.pruned_by_volume += sieved[broad.BY_VOLUME]
        counters.repeated += sieved[broad.BY_REPEAT]
        counters.boxes += decided[traversal.BOXES]
        counters.gjk_queries += decided[traversal.QUERIES]
        counters.gjk_iterations += decided[traversal.ITERATIONS]
        counters.gjk_exact += decided[traversal.IN_DOUBLE_DOUBLE]
        counters.narrow += decided[narrow.RUNS]
        counters.contained += decided[narrow.SEEN_INSIDE]
        counters.contacts += decided[narrow.CONTACTS]
        counters.undecided += decided[narrow.UNDECIDEDS]


def _engine(name: str, bodies: Sequence[CollisionBody], arrays: Bodies) -> NarrowPhase:
    if name == "fcl":
        from replay.collision.fcl_engine import FclEngine

        return FclEngine(bodies, arrays)

    def decide(
        pairs: Integers,
        poses: Floats,
        limit: float,
        task: NDArray[np.uint8],
        level: NDArray[np.uint8],
        clearance: Floats,
        undecided: NDArray[np.bool_],
        counts: Integers,
    ) -> None:
        narrow.decide(arrays, pairs, poses, limit, task, level, clearance, undecided, counts)

    return decide


def _empty(n: int, count: int) -> CollisionColumns:
    return CollisionColumns(
        level=np.zeros((n, count), dtype=np.uint8),
        clearance=np.full((n, count), np.nan),
        evaluated=np.zeros((n, count), dtype=bool),
        undecided=np.zeros((n, count), dtype=bool),
    )


def _copy(source: CollisionColumns, columns: CollisionColumns, target: Integers) -> None:
    for name in ("level", "clearance", "evaluated", "undecided"):
        getattr(columns, name)[:, target] = getattr(source, name)[0]
