"""What is known of pairs between the frames of a block: proofs where they hold, a search where they do not."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from replay.collision import crossing_look, crossing_search, interval_proof
from replay.collision.bodies import AABB, SPHERE, Bodies, Volumes
from replay.collision.columns import Between, Crossings
from replay.collision.counters import Counters
from replay.collision.crossing_look import Questions
from replay.collision.interval_proof import Answers
from replay.collision.pair_frames import PairFrames
from replay.collision.relative import RelativePoses
from replay.collision.support import Sets, make_sets
from replay.collision.way_sieve import roots_of
from replay.collision.way_steps import Chains
from replay.collision.ways import NEAR, STRETCH, Ways, fill_stretches, first_ways, no_ways
from replay.kinematics.linkage import Linkage, LinkPoses
from replay.kinematics.motion import Motion
from replay.kinematics.timeline import timeline
from replay.kinematics.travel import link_travel
from replay.numerics.arrays import Bytes, Flags, Floats, Integers

RESOLUTION = 1_000
"""Longest bracket of a moment that is aimed at [ns]."""


@dataclass(frozen=True, eq=False)
class Course:
    """The way from one frame to the next, in a block.

    Attributes:
        time: (m + 1,) [ns] of the frames at both ends of m intervals.
        first: frame of the scenario that the first interval ends at.
        local: (m + 1, L, 4, 4) poses of the links in their parents.
        travel: (L, m, 2), see `travel.link_travel`.
        middle: (K + 1, L, 4, 4) poses in the middle frames of K stretches, see `ways.fill_stretches`.
        share, swept: (K,) and over the stretches, as there.
    """

    time: Integers
    first: int
    local: Floats
    travel: Floats
    middle: Floats
    share: Floats
    swept: Ways

    @cached_property
    def steps(self) -> Floats:
        """(V, K) no way in an interval of a stretch is longer [m]."""
        return self.swept.ways * self.share


@dataclass(frozen=True, eq=False)
class Sorted:
    """What the stretches of a block hold of c pairs.

    Attributes:
        pairs, rows: (c, 4) see `batches.Batch`.
        kinds: (c, K) FAR, QUIET or NEAR.
        wanted: (Q, m + 1) link pairs and frames in which a pair is NEAR.
        course: of the block.
    """

    pairs: Integers
    rows: Integers
    kinds: Bytes
    wanted: Flags
    course: Course

    @cached_property
    def near(self) -> Integers:
        """Pairs that are NEAR in any stretch."""
        return np.flatnonzero((self.kinds == NEAR).any(axis=1))


@dataclass(frozen=True, eq=False)
class Told:
    """Columns between, bound (n, P) that answers are written to: rows are intervals from `begin` on."""

    between: Bytes
    bound: Floats
    begin: int

    @staticmethod
    def clear(frames: int, pairs: int, cap: float) -> Told:
        """Return those of pairs that are clear, and farther apart than the largest bound that is told."""
        shape = frames, pairs
        return Told(np.full(shape, Between.CLEAR, dtype=np.uint8), np.full(shape, cap), 0)


class Intervals:
    """Answers for the intervals between frames.

    Args:
        linkage, motion: how the bodies' links move.
        bodies, volumes: of the scene.
        links: (B,) the bodies' links.
        limit: up to which the narrow phase finds distances [m].
        cap: largest bound that is told [m].
        savings: see `pipeline.CollisionPipeline`.
        counters: added to.
    """

    def __init__(
        self,
        linkage: Linkage,
        motion: Motion,
        bodies: Bodies,
        volumes: Volumes,
        links: Integers,
        *,
        limit: float,
        cap: float,
        savings: bool,
        counters: Counters,
    ) -> None:
        self._linkage = linkage
        self._line = timeline(linkage, motion)
        self._bodies, self._volumes, self._links = bodies, volumes, links
        self._corners, self._roots = _corners(volumes), roots_of(bodies)
        self._limit, self._cap, self._savings = limit, cap, savings
        self._counters = counters
        self._first = first_ways(links, self._line)
        self._ways = no_ways(int(self._first[-1]), STRETCH)
        self._paths = [linkage.ancestors(link)[::-1] for link in range(len(linkage.links))]

    def follow(self, motion: Motion) -> None:
        """Go by another motion of the same links from here on."""
        self._line = timeline(self._linkage, motion)

    def course(self, poses: LinkPoses, lead: int, time: Integers, first: int) -> Course:
        """Return how far bodies move in a block.

        Args:
            poses: of its frames, after `lead` frames (0 or 1) that come before it.
            lead: see above.
            time: [ns] of the poses.
            first: frame of the scenario that the block begins at.
        """
        m = len(time) - 1
        travel = np.empty((len(self._linkage.links), m, 2))
        link_travel(self._line, time / 1e9, travel)
        return self._course(poses, travel, time, first + 1 - lead)

    def still(self, poses: LinkPoses) -> Course:
        """Return a course of one interval in which nothing moves, between two frames that are the same."""
        travel = np.zeros((len(self._linkage.links), 1, 2))
        return self._course(poses, travel, np.zeros(2, dtype=np.int64), 0)

    def _course(self, poses: LinkPoses, travel: Floats, time: Integers, first: int) -> Course:
        local, count = np.ascontiguousarray(poses.local), -(-travel.shape[1] // STRETCH)
        middle, share = np.empty((count + 1, *local.shape[1:])), np.empty(count)
        swept = no_ways(int(self._first[-1]), count)
        scratch = np.empty((len(travel), count, 2))
        fill_stretches(
            self._line, self._volumes, self._links, local, travel, self._first, middle, scratch, share, swept
        )
        return Course(time, first, local, travel, middle, share, swept)

    def half_steps(self, course: Course) -> Floats:
        """Return half of how far each body moves between two frames at most, seen from the world (B,) [m]."""
        world = self._first[:-1]
        half: Floats = (0.5 * course.steps[world] + 4.0 * course.swept.rounding[world]).max(axis=1)
        return half

    def rows(self, pairs: Integers) -> Integers:
        """Return the rows (P, 4) of `Course.ways` of pairs (P, 2): seen from the nearest ancestor, and for boxes along
        the world's axes from the world."""
        links = self._links[pairs]
        known, place = np.unique(links, axis=0, return_inverse=True)
        shared = np.array([self._shared(a, b) for a, b in known.tolist()], dtype=np.int64)[place.reshape(-1)]
        near = self._first[pairs] + shared[:, None]
        return np.concatenate([near, self._first[pairs] if self._volumes.kind == AABB else near], axis=1)

    def sorted_out(
        self, pairs: Integers, rows: Integers, relative: RelativePoses, course: Course, *, quiet: bool
    ) -> Sorted:
        """Return what the stretches of a block hold of pairs: what is not NEAR is clear in them.

        Args:
            pairs, rows, relative: see `batches.Batch`, where rows are called ways.
            course: of the block.
            quiet: whether what is known of distances at the frames is our own.
        """
        shape = len(pairs), len(course.share)
        wanted = np.zeros((relative.count, len(course.time)), dtype=bool)
        if not self._savings:
            return Sorted(pairs, rows, np.full(shape, NEAR, dtype=np.uint8), wanted, course)
        kinds = np.empty(shape, dtype=np.uint8)
        interval_proof.sort_out(
            self._roots,
            self._volumes,
            pairs,
            relative.of(course.middle),
            rows,
            course.swept,
            len(course.time) - 1,
            self._limit if quiet else 0.0,
            self._cap,
            kinds,
            wanted,
            np.zeros((8, 4)),
            np.empty((3, 3)),
            np.empty(3),
        )
        return Sorted(pairs, rows, kinds, wanted, course)

    def answer(self, frames: PairFrames, found: Sorted, columns: Integers, told: Told) -> Crossings:
        """Tell what is known of pairs in a block, and return what crossed.

        Args:
            frames: the NEAR ones of them, decided in all frames.
            found: see there.
            columns: of the pairs.
            told: written to.
        """
        if not found.kinds.any():  # all FAR
            return Crossings.none()
        course = found.course
        counts, searched = np.zeros(interval_proof.COUNTS, np.int64), np.zeros(crossing_look.COUNTS, np.int64)
        doubt = np.zeros((len(course.time) - 1, len(found.near)), dtype=np.uint8)
        place = np.full(len(found.pairs), -1, dtype=np.int64)
        place[found.near] = np.arange(len(found.near))
        interval_proof.certify(
            self._line,
            self._volumes,
            self._links,
            course.local,
            course.travel,
            self._first,
            found.pairs,
            found.rows,
            found.kinds,
            place,
            frames,
            self._limit,
            self._cap,
            Answers(columns, told.between, told.bound, told.begin, doubt),
            counts,
            self._ways,
            np.empty(len(self._links), dtype=np.int64),
            np.zeros((8, 4)),
        )
        crossings = Crossings.none()
        if doubt.any():
            crossings = self._search(frames, course, columns[found.near], doubt, told, searched)
        self._counters.add_intervals(counts.tolist(), searched.tolist())
        return crossings

    def _search(
        self, frames: PairFrames, course: Course, columns: Integers, doubt: Bytes, told: Told, counts: Integers
    ) -> Crossings:
        f, p = np.nonzero(doubt)
        bodies = frames.pairs[p, :2].copy()
        chains, chain = self._chains(self._links[bodies])
        questions = Questions(
            bodies=bodies,
            chain=chain,
            time=np.array([course.time[f], course.time[f + 1]]).T.copy(),
            level=np.array([frames.level[f, p], frames.level[f + 1, p]]).T.copy(),
            doubt=doubt[f, p],
        )
        cells = f + told.begin, columns[p]
        found, least = told.between[cells], told.bound[cells]
        events = np.empty((4 * len(f), 5), dtype=np.int64)
        count = crossing_search.search(
            self._bodies,
            self._volumes,
            self._corners,
            self._line,
            chains,
            questions,
            self._cap,
            RESOLUTION,
            found,
            least,
            events,
            counts,
        )
        told.between[cells], told.bound[cells] = found, least
        question, level_, begins, earliest, latest = events[:count].T
        return Crossings(
            pair=columns[p[question]],
            level=level_.astype(np.uint8),
            begins=begins == 1,
            earliest=earliest,
            latest=latest,
            frame=course.first + f[question],
        )

    def _chains(self, links: Integers) -> tuple[Chains, Integers]:
        """Return the ways between pairs of links, and (k, 2) each pair's: the short and the wide one."""
        asked = [(a, b) for a, b in links.tolist()]
        known = {pair: k for k, pair in enumerate(dict.fromkeys(asked))}
        sides: list[list[int]] = []
        for a, b in known:
            shared = self._shared(a, b)
            sides += [self._paths[a][shared:], self._paths[b][shared:]]
        if self._volumes.kind == AABB:
            for a, b in known:
                sides += [self._paths[a], self._paths[b]]
        first = np.concatenate([[0], np.cumsum([len(side) for side in sides])]).astype(np.int64)
        chains = Chains(first, np.array([link for side in sides for link in side], dtype=np.int64))
        near = np.array([known[pair] for pair in asked], dtype=np.int64)
        return chains, np.stack([near, near + len(known) if self._volumes.kind == AABB else near], axis=1)

    def _shared(self, a: int, b: int) -> int:
        """Return how many links the paths from their roots to two links have in common."""
        count = 0
        for x, y in zip(self._paths[a], self._paths[b], strict=False):
            if x != y:
                break
            count += 1
        return count


def _corners(volumes: Volumes) -> Sets:
    """Return the corners of volumes as convex sets, of spheres the centres."""
    points = volumes.center[:, None, :]
    if volumes.kind != SPHERE:
        signs = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])
        steps = signs[None, :, :] * volumes.half[:, None, :]
        turned = [
            steps[..., 0] * volumes.axes[:, None, 0, k]
            + steps[..., 1] * volumes.axes[:, None, 1, k]
            + steps[..., 2] * volumes.axes[:, None, 2, k]
            for k in range(3)
        ]
        points = points + np.stack(turned, axis=-1)
    count = points.shape[1]
    return make_sets(points.reshape(-1, 3), np.arange(len(points) + 1, dtype=np.int64) * count, tables=False)
