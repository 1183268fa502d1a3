"""From link poses to levels and clearances of all pairs, a block of frames at a time.

A block's candidates are all pairs where these are few, else the pairs that a tree over all bodies finds
(`candidates.near_pairs`). They are worked off in batches: relative poses, `broad.sieve`, narrow phase. Which way a
candidate was found does not show in the results.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np

from replay.collision import narrow, way_sieve
from replay.collision.batches import Batch, FrameDecider, batches
from replay.collision.bodies import Bounds, Pieces, collect, fit_volumes
from replay.collision.candidates import near_pairs
from replay.collision.columns import MARGIN, Between, CollisionColumns, CollisionEntries, Crossings
from replay.collision.counters import Counters
from replay.collision.engines import Engine, NarrowPhase, engine_of
from replay.collision.intervals import Course, Intervals, Told
from replay.collision.pair_frames import PairFrames
from replay.collision.pairs import CollisionBody, Pair, PairRules
from replay.collision.selection import Listed, Ruled, Selected
from replay.errors import InvalidValue
from replay.kinematics.linkage import Linkage, LinkPoses
from replay.kinematics.motion import Motion
from replay.numerics.arrays import Bytes, Flags, Floats, Integers

FEW_PAIRS = 512
"""Up to so many pairs all are candidates in every block: the sieve rules them out faster than a tree finds them."""


class CollisionPipeline:
    """Levels and clearances of pairs of bodies; everything that is constant is computed once, here.

    Args:
        bodies: shapes in their links' frames.
        pairs: pairs to test, see `pairs.plan_pairs`: the columns' order; or the rules they follow, for scenes of so
            many bodies that their pairs cannot be listed.
        linkage: whose links the bodies are on.
        bounds: bounding volumes, which define the level `bounds`.
        narrowphase: "gjk" (this package's own) or "fcl" (python-fcl).
        pieces: how concave bodies are collided, see `geometry.convex_sets`.
        clearance: "never"; "near": exact up to `margin`; "always": of every pair in every frame, however far, which
            costs n^2 of n bodies and needs listed pairs.
        margin: [m], for "near".
        savings: False decides every listed pair in every frame anew: no bodies, blocks or frames are ruled out by
            bounding volumes, nothing is taken from another frame, all convex sets of two bodies are compared, and
            clearances are computed however far. The columns are the same, to the last bit.
        motion: of the linkage; contacts between frames are proven absent or found by it, see `intervals`. Without it
            the frames are all that is looked at.

    Raises:
        InvalidValue: an unknown option, a margin that is not finite and positive, a pair that is listed twice, or
            "always" or no savings with rules.
        MissingPackageError: "fcl" without python-fcl.
    """

    def __init__(
        self,
        bodies: Sequence[CollisionBody],
        pairs: Sequence[Pair] | PairRules,
        linkage: Linkage,
        *,
        bounds: Bounds = "obb",
        narrowphase: Engine = "gjk",
        pieces: Pieces = "exact",
        clearance: Literal["never", "near", "always"] = "near",
        margin: float = MARGIN,
        savings: bool = True,
        motion: Motion | None = None,
    ) -> None:
        if clearance not in ("never", "near", "always"):
            raise InvalidValue("clearance", clearance, "must be one of never, near, always")
        if narrowphase not in ("gjk", "fcl"):
            raise InvalidValue("narrowphase", narrowphase, "must be one of gjk, fcl")
        if clearance == "near" and not 0.0 < margin < math.inf:
            raise InvalidValue("margin", margin, "must be finite and positive [m]")
        if clearance == "always" and isinstance(pairs, PairRules):
            raise InvalidValue("clearance", clearance, "needs listed pairs: with rules, write never or near")
        if not savings and isinstance(pairs, PairRules):
            raise InvalidValue("savings", savings, "needs listed pairs: with rules, leave it on")
        self._savings = savings
        self._limit = {"never": 0.0, "near": float(margin), "always": math.inf}[clearance]
        self._linkage = linkage
        self._uses_world = bounds == "aabb"
        # boxes along the world's axes turn with their links' common base: such pairs are evaluated in every frame
        self._pairs = (
            Ruled(pairs) if isinstance(pairs, PairRules) else Listed(pairs, turning=self._uses_world or not savings)
        )
        self.counters = Counters(pairs=self._pairs.count, static_pairs=self._pairs.static_count)
        self._used = self._pairs.bodies()
        chosen = [bodies[k] for k in self._used]
        self._links = np.array([body.link for body in chosen], dtype=np.int64)
        self._place = np.full(len(bodies), -1, dtype=np.int64)
        self._place[self._used] = np.arange(len(chosen))
        self._rest: _Rest | None = None
        # between frames distances are our own, whatever decides at the frames
        self._own: NarrowPhase | None = None
        self._cap = math.inf if clearance == "always" else float(margin)
        self._intervals: Intervals | None = None
        if chosen:
            arrays = collect(chosen, pieces=pieces)
            self._volumes = fit_volumes(chosen, arrays, bounds=bounds, pieces=pieces)
            self.narrow_phase = engine_of(narrowphase, chosen, arrays, savings=savings)
            if motion is not None:
                if narrowphase == "fcl":
                    self._own = partial(narrow.decide, arrays)
                self._intervals = Intervals(
                    linkage,
                    motion,
                    arrays,
                    self._volumes,
                    self._links,
                    limit=self._limit,
                    cap=self._cap,
                    savings=savings,
                    counters=self.counters,
                )
            self._frames = FrameDecider(
                way_sieve.roots_of(arrays),
                self._volumes,
                self._limit,
                savings=savings,
                turning=self._uses_world,
                by_ways=not self._uses_world and self._own is None,
                counters=self.counters,
            )
        self._all: Selected | None = None  # what every block looks at, where that is all pairs
        if isinstance(self._pairs, Listed) and (self._pairs.count <= FEW_PAIRS or clearance == "always" or not savings):
            self._all = self._pairs.all()
            self._always = self._batches(self._all.moving())

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """The listed pairs, in the columns' order; empty if rules were given."""
        return self._pairs.listed

    def follow(self, motion: Motion) -> None:
        """Go by another motion from here on, if the pipeline has one."""
        if self._intervals is not None:
            self._intervals.follow(motion)

    def run(self, poses: LinkPoses, *, lead: int = 0, time: Integers | None = None, first: int = 0) -> CollisionColumns:
        """Return the columns of a block of n frames; they depend on no other block.

        Args:
            poses: of its frames, after `lead` frames that come before it.
            lead: 0 or 1, how many frames before the block there are.
            time: (lead + n,) [ns] of the frames. What is between them is looked at if the pipeline has a motion, and is
                told when they are.
            first: frame of the scenario that the block begins at; `crossings` count from frame 0 of it.

        Raises:
            InvalidValue: a pose is not finite, or the pairs were given as rules: they have no columns.

        Accuracy: a clearance is right to 1e-12 of itself plus 1e-14 of the bodies' reach and offset
        (tests/collision/test_pipeline.py); levels are decided as `gjk.intersect` does, for the poses as they are
        computed: bodies that are written to touch may be 1e-16 of the way between them apart, and read that clearance,
        not contact. What is said of intervals is proven (tests/collision/test_intervals.py).
        """
        if isinstance(self._pairs, Ruled):
            raise InvalidValue("pairs", "rules", "columns need listed pairs; ask `contacts` instead")
        n = len(poses.local) - lead
        self._check(poses)
        course = told = None
        rest = self._at_rest(poses)
        level, clearance = rest.level.repeat(n, axis=0), rest.clearance.repeat(n, axis=0)
        evaluated, undecided = rest.evaluated.repeat(n, axis=0), rest.undecided.repeat(n, axis=0)
        if self._intervals is None or time is None or len(time) < 2:
            between = np.broadcast_to(np.uint8(Between.NOT_LOOKED), level.shape)
            bound = np.broadcast_to(np.nan, level.shape)
        else:
            course = self._intervals.course(poses, lead, time, first)
            between, bound = rest.between.repeat(n, axis=0), rest.bound.repeat(n, axis=0)
            between[: 1 - lead], bound[: 1 - lead] = Between.NOT_LOOKED, np.nan
            told = Told(between, bound, 1 - lead)
            self.counters.intervals += (len(time) - 1) * self._pairs.count
        crossings = []
        for found in self._moving(poses, lead, course, told):
            if len(found.columns):
                level[:, found.columns] = found.level
                clearance[:, found.columns] = found.clearance
                evaluated[:, found.columns] = ~np.isnan(found.clearance)
                undecided[:, found.columns] = found.undecided
            crossings.append(found.crossings)
        return CollisionColumns(
            level, clearance, evaluated, undecided, between, bound, crossings=Crossings.joined(crossings)
        )

    def contacts(self, poses: LinkPoses) -> CollisionEntries:
        """Return what `run` does without the clear pairs and frames: memory and time grow with those that are near.

        Raises:
            InvalidValue: a pose is not finite.

        Accuracy: as `run`.
        """
        n = len(poses.local)
        self._check(poses)
        frame, bodies = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 2), dtype=np.int64)]
        level, clearance = [np.zeros(0, dtype=np.uint8)], [np.zeros(0)]
        undecided = [np.zeros(0, dtype=bool)]
        for found in (*self._at_rest(poses).found, *self._moving(poses, 0, None, None)):
            asked = (n, len(found.columns))
            f, p = np.nonzero(np.broadcast_to((found.level > 0) | ~np.isnan(found.clearance), asked))
            source = np.minimum(f, len(found.level) - 1)
            frame.append(f)
            bodies.append(self._used[found.frames.pairs[p, :2]])
            level.append(found.level[source, p])
            clearance.append(found.clearance[source, p])
            undecided.append(found.undecided[source, p])
        frames, pairs = np.concatenate(frame), np.concatenate(bodies)
        order = np.lexsort((pairs[:, 1], pairs[:, 0], frames))
        return CollisionEntries(
            frame=frames[order],
            bodies=pairs[order],
            level=np.concatenate(level)[order],
            clearance=np.concatenate(clearance)[order],
            undecided=np.concatenate(undecided)[order],
        )

    def _check(self, poses: LinkPoses) -> None:
        if not np.isfinite(poses.local).all():
            frame, link = np.argwhere(~np.isfinite(poses.local).all(axis=(2, 3)))[0].tolist()
            place = f"poses.local[{frame}, {poses.linkage.link_names[link]}]"
            raise InvalidValue(place, poses.local[frame, link].tolist(), "link poses must be finite")

    def _moving(self, poses: LinkPoses, lead: int, course: Course | None, told: Told | None) -> Iterator[_Found]:
        """Yield what is known in a block of all pairs that can move and may be near; tell what is of its intervals."""
        n = len(poses.local) - lead
        self.counters.pair_frames += n * self._pairs.count
        self.counters.static += n * self._pairs.static_count
        if n == 0 or self._pairs.count == 0:
            return
        if self._all is None:
            moving = self._candidates(poses, course).moving()
            self.counters.pruned_by_block += n * (self._pairs.count - self._pairs.static_count - len(moving.rows))
        for batch in self._always if self._all is not None else self._batches(moving):
            yield self._work(batch, poses, lead, course, told)

    def _candidates(self, poses: LinkPoses, course: Course | None) -> Selected:
        if self._all is not None:
            return self._all
        reach, limit = np.zeros(len(self._links)), self._limit
        if course is not None and self._intervals is not None:
            reach, limit = self._intervals.half_steps(course), max(limit, self._cap)
        return self._pairs.choose(self._used[near_pairs(self._volumes, self._links, poses, limit, reach)])

    def _at_rest(self, poses: LinkPoses) -> _Rest:
        """Return what is known of pairs that cannot move, by one frame of the first block that has any."""
        if self._rest is not None:
            return self._rest
        told, found, course = Told.clear(1, self._pairs.count, self._cap), [], None
        if len(poses.local) and self._pairs.static_count:
            one, lead = poses.slice(0, 1), 0
            if self._intervals is not None:
                one, lead = one.joined([one, one]), 1
                course = self._intervals.still(one)
            fixed = self._candidates(one, course).fixed()
            self.counters.pruned_by_block += self._pairs.static_count - len(fixed.rows)
            found = [self._work(batch, one, lead, course, told) for batch in self._batches(fixed)]
        rest = _Rest.of(told, found)
        if len(poses.local):
            self._rest = rest
        return rest

    def _work(self, batch: Batch, poses: LinkPoses, lead: int, course: Course | None, told: Told | None) -> _Found:
        """Return what is found of a batch's pairs in a block, and tell what is known of its intervals."""
        if course is None or told is None or self._intervals is None:
            frames = self._frames.decide(self.narrow_phase, batch, batch.rows, poses)
            return _Found(batch.columns, frames, 0, Crossings.none())
        # of what the other engine says at the frames nothing is known
        found = self._intervals.sorted_out(batch.rows, batch.ways, batch.relative, course, quiet=self._own is None)
        rows = batch.rows[found.near]
        self.counters.pruned_by_block += (len(poses.local) - lead) * (len(batch.rows) - len(rows))
        frames = self._frames.decide(self.narrow_phase, batch, rows, poses, found)
        known = frames
        if self._own is not None:
            known = frames._replace(clearance=self._frames.decide(self._own, batch, rows, poses).clearance)
        crossings = self._intervals.answer(known, found, batch.columns, told)
        return _Found(batch.columns[found.near], frames, lead, crossings)

    def _batches(self, chosen: Selected) -> list[Batch]:
        rows = self._place[chosen.rows]
        return batches(
            rows, chosen.columns, self._links, self._linkage, turning=self._uses_world, intervals=self._intervals
        )


@dataclass(frozen=True, eq=False)
class _Found:
    """Results of pairs of a batch, which are these c columns; the others are clear in all frames, without clearances.

    `frames` holds them in all frames after `lead` ones.
    """

    columns: Integers
    frames: PairFrames
    lead: int
    crossings: Crossings

    @property
    def level(self) -> Bytes:
        return self.frames.level[self.lead :]

    @property
    def clearance(self) -> Floats:
        return self.frames.clearance[self.lead :]

    @property
    def undecided(self) -> Flags:
        return self.frames.undecided[self.lead :]


@dataclass(frozen=True, eq=False)
class _Rest:
    """What is found of pairs that cannot move in one frame, and (1, P) columns in which all others are clear."""

    found: list[_Found]
    level: Bytes
    clearance: Floats
    evaluated: Flags
    undecided: Flags
    between: Bytes
    bound: Floats

    @staticmethod
    def of(told: Told, found: list[_Found]) -> _Rest:
        shape = told.between.shape
        level, clearance = np.zeros(shape, dtype=np.uint8), np.full(shape, np.nan)
        undecided = np.zeros(shape, dtype=bool)
        for each in found:
            level[:, each.columns], clearance[:, each.columns] = each.level, each.clearance
            undecided[:, each.columns] = each.undecided
        return _Rest(found, level, clearance, ~np.isnan(clearance), undecided, told.between, told.bound)
