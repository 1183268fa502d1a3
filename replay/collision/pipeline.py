"""From link poses to levels and clearances of all pairs, a block of frames at a time."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from replay.collision import broad, narrow, traversal
from replay.collision.bodies import Bodies, Bounds, Pieces, collect, fit_volumes
from replay.collision.columns import CollisionColumns
from replay.collision.pairs import CollisionBody, Pair
from replay.collision.relative import RelativePoses
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
    ) -> None:
        """Finish level, clearance and undecided where task asks for it."""


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
        self._linkage = linkage
        self._moving = self._grouped(np.flatnonzero(~self._static))
        self._fixed = self._grouped(np.flatnonzero(self._static))
        self._static_columns: CollisionColumns | None = None
        self._decide: NarrowPhase | None = None
        if chosen:
            arrays = collect(chosen, pieces=pieces)
            self._volumes = fit_volumes(chosen, arrays, bounds=bounds, pieces=pieces)
            self._decide = _engine(narrowphase, chosen, arrays)

    def run(self, poses: LinkPoses) -> CollisionColumns:
        """Return the columns of a block of n frames; they depend on no other block.

        Raises:
            InvalidValue: a pose is not finite.

        Accuracy: a clearance is right to 1e-12 of itself plus 1e-14 of the bodies' reach and offset
        (tests/collision/test_pipeline.py); levels are decided as `gjk.intersect` does.
        """
        n, count = len(poses.local), len(self.pairs)
        if not np.isfinite(poses.local).all():
            frame, link = np.argwhere(~np.isfinite(poses.local).all(axis=(2, 3)))[0].tolist()
            place = f"poses.local[{frame}, {poses.linkage.link_names[link]}]"
            raise InvalidValue(place, poses.local[frame, link].tolist(), "link poses must be finite")
        self.counters.pair_frames += n * count
        columns = _empty(n, count)
        if n == 0:
            return columns
        if self._fixed:
            if self._static_columns is None:
                self._static_columns = _empty(1, count)
                self._evaluate(self._fixed, poses.slice(0, 1), self._static_columns)
            self.counters.static += n * self.counters.static_pairs
            _copy(self._static_columns, columns, np.flatnonzero(self._static))
        self._evaluate(self._moving, poses, columns)
        return columns

    def _evaluate(self, groups: Sequence[_Group], poses: LinkPoses, columns: CollisionColumns) -> None:
        for group in groups:
            relative = group.relative.of(poses.local)
            turns = np.zeros((1, len(poses.local), 3, 3))  # read for boxes along the world's axes only
            if self._uses_world:
                turns = np.ascontiguousarray(np.moveaxis(poses.world[:, group.bases, :3, :3], 1, 0))
            self._run_kernels(group, relative, turns, columns)

    def _run_kernels(self, group: _Group, relative: Floats, turns: Floats, columns: CollisionColumns) -> None:
        assert self._decide is not None
        rows, n, count = group.rows, relative.shape[1], len(group.rows)
        part = _empty(n, count)
        task = np.zeros((n, count), dtype=np.uint8)
        sieved = np.zeros(broad.COUNTS, dtype=np.int64)
        decided = np.zeros(narrow.COUNTS, dtype=np.int64)
        spreads, scratch = np.empty((len(relative), 2)), np.zeros((8, 4))
        broad.sieve(self._volumes, rows, relative, turns, self._limit, part.level, task, sieved, spreads, scratch)
        self._decide(rows, relative, self._limit, task, part.level, part.clearance, part.undecided, decided)
        part.evaluated[:] = ~np.isnan(part.clearance)
        for name in ("level", "clearance", "evaluated", "undecided"):
            getattr(columns, name)[:, group.pairs] = getattr(part, name)
        self._count(sieved.tolist(), decided.tolist())

    def _grouped(self, chosen: Integers) -> list[_Group]:
        """Return pairs in groups that share link pairs, at most LINK_PAIRS_AT_ONCE of these a group."""
        by_links: dict[tuple[int, int], list[int]] = {}
        for pair in chosen.tolist():
            a, b = self._rows[pair]
            by_links.setdefault((self._links[a], self._links[b]), []).append(pair)
        groups, links = [], list(by_links)
        for begin in range(0, len(links), LINK_PAIRS_AT_ONCE):
            part = links[begin : begin + LINK_PAIRS_AT_ONCE]
            bases = sorted({a for a, _ in part})
            base_row = {link: k if self._uses_world else 0 for k, link in enumerate(bases)}
            entries = sorted((pair, q, base_row[key[0]]) for q, key in enumerate(part) for pair in by_links[key])
            rows = np.array([[*self._rows[pair], q, base] for pair, q, base in entries], dtype=np.int64)
            pairs = np.array([pair for pair, _, _ in entries], dtype=np.int64)
            groups.append(_Group(pairs, rows, RelativePoses(self._linkage, part), bases))
        return groups

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


@dataclass(frozen=True, eq=False)
class _Group:
    """Pairs evaluated together: `rows` for `broad.sieve`, their relative poses, the links of their first bodies."""

    pairs: Integers
    rows: Integers
    relative: RelativePoses
    bases: list[int]


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
        getattr(columns, name)[:, target] = getattr(source, name)[0, target]
