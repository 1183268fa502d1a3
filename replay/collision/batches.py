"""Pairs worked off together: cut into batches that share relative poses, and decided at frames."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from replay.collision import broad, narrow, way_sieve
from replay.collision.bodies import Volumes
from replay.collision.counters import Counters
from replay.collision.engines import NarrowPhase
from replay.collision.intervals import Intervals, Sorted
from replay.collision.pair_frames import PairFrames, unanswered
from replay.collision.relative import RelativePoses
from replay.kinematics.linkage import Linkage, LinkPoses
from replay.numerics.arrays import Integers

LINK_PAIRS_AT_ONCE = 512
"""Relative poses held at a time: 512 link pairs of 256 frames are 16 MiB."""

PAIRS_AT_ONCE = 16_384
"""Pairs worked off at a time: of 256 frames, 50 MiB."""


@dataclass(frozen=True, eq=False)
class Batch:
    """Pairs evaluated together.

    Attributes:
        columns: (c,) of the result that they are.
        rows: (c, 4) for `broad.sieve`.
        relative: poses of their links.
        bases: links of their first bodies, where boxes turn with them.
        ways: (c, 4) rows of `ways.Ways`; none if nothing is asked of intervals.
    """

    columns: Integers
    rows: Integers
    relative: RelativePoses
    bases: Integers
    ways: Integers


def batches(
    rows: Integers, columns: Integers, links: Integers, linkage: Linkage, *, turning: bool, intervals: Intervals | None
) -> list[Batch]:
    """Return pairs in batches that share link pairs.

    Args:
        rows: (c, 2) bodies of each pair.
        columns: (c,) of the result.
        links: of the bodies.
        linkage: whose links they are.
        turning: whether boxes turn with the first body's link.
        intervals: what is asked between frames, if anything.
    """
    pairs = links[rows]
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    rows, pairs, columns = rows[order], pairs[order], columns[order]
    starts = np.ones(len(rows), dtype=bool)
    starts[1:] = (pairs[1:] != pairs[:-1]).any(axis=1)
    number = np.cumsum(starts) - 1  # of each pair's link pair
    found, begin = [], 0
    while begin < len(rows):
        end = int(np.searchsorted(number, number[begin] + LINK_PAIRS_AT_ONCE))
        end = min(end, begin + PAIRS_AT_ONCE)
        part = slice(begin, end)
        _, first, q = np.unique(number[part], return_index=True, return_inverse=True)
        bases, base = np.unique(pairs[part, 0], return_inverse=True)
        table = np.stack([rows[part, 0], rows[part, 1], q, base if turning else 0 * base], axis=1)
        ways = np.zeros((0, 4), dtype=np.int64) if intervals is None else intervals.rows(rows[part])
        found.append(Batch(columns[part], table, RelativePoses(linkage, pairs[part][first]), bases, ways))
        begin = end
    return found


@dataclass(frozen=True, eq=False)
class FrameDecider:
    """Levels and clearances of a batch's pairs at frames: sieved by bounding volumes, the rest decided by an engine.

    Attributes:
        roots, volumes: of all pairs.
        limit: largest clearance that is asked for [m].
        savings: see `pipeline.CollisionPipeline`.
        turning: whether boxes turn with the first body's link.
        by_ways: whether frames may be ruled out by the ways between them.
        counters: what it costs is added to them.
    """

    roots: way_sieve.Roots
    volumes: Volumes
    limit: float
    savings: bool
    turning: bool
    by_ways: bool
    counters: Counters

    def decide(
        self,
        engine: NarrowPhase,
        batch: Batch,
        rows: Integers,
        poses: LinkPoses,
        found: Sorted | None = None,
    ) -> PairFrames:
        """Return what an engine finds of pairs (P, 4) of a batch in frames.

        Args:
            engine, batch, rows, poses: see above.
            found: if it is known the pairs are those that are NEAR, and may be left out elsewhere.
        """
        if len(rows) == 0:
            return unanswered(rows, np.empty((0, len(poses.local), 4, 4)), np.zeros((1, 1, 3, 3)))
        by_ways = found if self.savings and self.by_ways else None
        chosen = wanted = None
        if found is not None:
            asked = np.zeros(batch.relative.count, dtype=bool)
            asked[rows[:, 2]] = True
            chosen, rows = np.flatnonzero(asked), rows.copy()
            rows[:, 2] = (np.cumsum(asked) - 1)[rows[:, 2]]
        if by_ways is not None:
            wanted = by_ways.wanted[chosen]
        relative = batch.relative.of(poses.local, chosen, wanted)
        turns = np.zeros((1, len(poses.local), 3, 3))  # read for boxes along the world's axes only
        if self.turning:
            turns = np.ascontiguousarray(np.moveaxis(poses.world[:, batch.bases, :3, :3], 1, 0))
        frames = unanswered(rows, relative, turns)
        sieved, decided = np.zeros(broad.COUNTS, dtype=np.int64), np.zeros(narrow.COUNTS, dtype=np.int64)
        scratch, limit = np.zeros((8, 4)), self.limit
        if by_ways is not None:
            way_sieve.sieve_by_way(
                self.roots,
                self.volumes,
                frames,
                by_ways.kinds[by_ways.near],
                by_ways.rows[by_ways.near],
                by_ways.course.steps,
                by_ways.course.swept.rounding,
                limit,
                sieved,
                scratch,
                np.empty((3, 3)),
                np.empty(3),
            )
        elif self.savings:
            broad.sieve(self.volumes, frames, limit, sieved, np.empty((len(relative), 2)), scratch)
        else:
            broad.keep_all(self.volumes, frames, scratch)
            limit = math.inf if limit > 0.0 else 0.0
        engine(frames, limit, decided)
        if not self.savings:
            frames.clearance[frames.clearance > self.limit] = np.nan
        self.counters.add(sieved.tolist(), decided.tolist())
        return frames
