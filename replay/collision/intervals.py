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
from replay.collision.pair_frames import PairFrames
from replay.collision.support import Sets, make_sets
from replay.collision.way_steps import Chains
from replay.collision.ways import fill_ways, first_ways
from replay.kinematics.linkage import Linkage, LinkPoses
from replay.kinematics.motion import Motion
from replay.kinematics.timeline import timeline
from replay.kinematics.travel import link_travel
from replay.numerics.arrays import Bytes, Floats, Integers

RESOLUTION = 1_000
"""Longest bracket of a moment that is aimed at [ns]."""


@dataclass(frozen=True, eq=False)
class Course:
    """The way from one frame to the next, in a block.

    Attributes:
        time: (m + 1,) [ns] of the frames at both ends of m intervals.
        first: frame of the scenario that the first interval ends at.
        begin: frame of the block that the first interval ends at: 0, or 1 where there is no frame before the block.
        centers, ways, rounding: see `ways.fill_ways`.
    """

    time: Integers
    first: int
    begin: int
    centers: Floats
    ways: Floats
    rounding: Floats

    @cached_property
    def sums(self) -> tuple[Floats, Floats]:
        """Each way from the block's middle frame to its ends, the larger one, and in its longest interval (V,) [m]."""
        middle = (self.ways.shape[1] + 1) // 2
        parts = [self.ways[:, :middle].sum(axis=1), self.ways[:, middle:].sum(axis=1)]
        return np.maximum(*parts) * (1.0 + 2.0**-40), self.ways.max(axis=1, initial=0.0)

    @cached_property
    def largest_rounding(self) -> Floats:
        """(V,) the largest of each row of `rounding` [m]."""
        largest: Floats = self.rounding.max(axis=1, initial=0.0)
        return largest

    @cached_property
    def blur(self) -> Floats:
        """(V,) the largest rounding of a centre in each row of `centers` [m]."""
        largest: Floats = self.centers[:, :, 3].max(axis=1)
        return largest


@dataclass(frozen=True, eq=False)
class Known:
    """What is known of c pairs over the intervals that end at n frames; crossings count from pair 0 of these."""

    between: Bytes
    bound: Floats
    crossings: Crossings


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
        self._corners = _corners(volumes)
        self._limit, self._cap, self._savings = limit, cap, savings
        self._counters = counters
        self._first = first_ways(links, self._line)
        self._depth = np.diff(self._first) - 1
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
        travel = np.zeros((len(self._linkage.links), m, 2))
        link_travel(self._line, time / 1e9, travel)
        return self._course(np.ascontiguousarray(poses.local), travel, time, first + 1 - lead, 1 - lead)

    def _course(self, local: Floats, travel: Floats, time: Integers, first: int, begin: int) -> Course:
        ways, rounding = np.empty((2, self._first[-1], len(local) - 1))
        centers = np.empty((self._first[-1], len(local), 4))
        fill_ways(self._line, self._volumes, self._links, local, travel, self._first, centers, ways, rounding)
        return Course(time, first, begin, centers, ways, rounding)

    def still(self) -> Course:
        """Return a course of one interval on which nothing moves, whatever the poses: pairs that cannot move ask it."""
        joints, free, links = (len(part) for part in (self._linkage.joints, self._linkage.free_joints, self._paths))
        poses = self._linkage.forward(np.zeros((2, joints)), np.tile(np.identity(4), (2, free, 1, 1)))
        travel = np.zeros((links, 1, 2))
        return self._course(np.ascontiguousarray(poses.local), travel, np.zeros(2, dtype=np.int64), 0, 0)

    def clear(self, shape: tuple[int, int], course: Course) -> tuple[Bytes, Floats]:
        """Return the columns of pairs that are clear and farther apart than the largest bound that is told."""
        between, bound = np.full(shape, Between.CLEAR, dtype=np.uint8), np.full(shape, self._cap)
        between[: course.begin], bound[: course.begin] = Between.NOT_LOOKED, np.nan
        return between, bound

    def half_steps(self, course: Course) -> Floats:
        """Return half of how far each body moves between two frames at most, seen from the world (B,) [m]."""
        world = self._first[:-1]
        half: Floats = 0.5 * course.ways[world].max(axis=1, initial=0.0) + course.largest_rounding[world]
        return half

    def rows(self, pairs: Integers) -> Integers:
        """Return the rows (P, 4) of `Course.ways` of pairs (P, 2): seen from the nearest ancestor, and for boxes along
        the world's axes from the world."""
        links = self._links[pairs]
        known, place = np.unique(links, axis=0, return_inverse=True)
        shared = np.array([self._shared(a, b) for a, b in known.tolist()], dtype=np.int64)[place.reshape(-1)]
        near = self._first[pairs] + shared[:, None]
        return np.concatenate([near, self._first[pairs] if self._volumes.kind == AABB else near], axis=1)

    def sorted_out(self, pairs: Integers, middle: Floats, rows: Integers, course: Course) -> Bytes:
        """Return what a block may hold of pairs (P,): `interval_proof.FAR`, QUIET or NEAR.

        Those that are not NEAR are clear in all its frames and intervals.

        Args:
            pairs: (P, 4) as `PairFrames.pairs`.
            middle: (Q, 1, 4, 4) T_a_b of the links in the block's middle frame.
            rows: of `Course.ways`.
            course: of the block.
        """
        kinds = np.empty(len(pairs), dtype=np.uint8)
        half, longest = course.sums
        scratch = np.zeros((8, 4)), np.empty((3, 3)), np.empty(3)
        interval_proof.sort_out(
            self._bodies,
            self._volumes,
            course.centers,
            pairs,
            middle,
            rows,
            half,
            longest,
            course.largest_rounding,
            course.blur,
            self._limit,
            self._cap,
            kinds,
            *scratch,
        )
        return kinds

    def quiet(self, pairs: Integers, rows: Integers, course: Course) -> Floats:
        """Return the bounds (m, c) of QUIET pairs over the m intervals of a block, as `certify` has them."""
        bound = np.empty((course.ways.shape[1], len(pairs)))
        interval_proof.fill_quiet(
            self._volumes,
            course.centers,
            pairs,
            rows,
            course.ways,
            course.rounding,
            self._limit,
            self._cap,
            bound,
        )
        return bound

    def answer(self, frames: PairFrames, head: PairFrames | None, rows: Integers, course: Course) -> Known:
        """Return what is known of pairs that were decided in all frames of a block, and in the frame before it."""
        n, count = frames.level.shape
        between = np.full((n, count), Between.NOT_LOOKED, dtype=np.uint8)
        bound, doubt = np.full((n, count), np.nan), np.zeros((n, count), dtype=np.uint8)
        counts = np.zeros(interval_proof.COUNTS, dtype=np.int64)
        head = frames if head is None else head
        interval_proof.certify(
            self._volumes,
            frames,
            head,
            course.begin,
            rows,
            course.centers,
            course.ways,
            course.rounding,
            self._limit,
            self._cap,
            between,
            bound,
            doubt,
            counts,
            np.empty((8, 4)),
        )
        crossings = Crossings.none()
        searched = np.zeros(crossing_look.COUNTS, dtype=np.int64)
        if doubt.any():
            crossings = self._search(frames, head, course, doubt, between, bound, searched)
        self._counters.add_intervals(counts.tolist(), searched.tolist())
        return Known(between, bound, crossings)

    def _search(
        self,
        frames: PairFrames,
        head: PairFrames,
        course: Course,
        doubt: Bytes,
        between: Bytes,
        bound: Floats,
        counts: Integers,
    ) -> Crossings:
        f, p = np.nonzero(doubt)
        bodies = frames.pairs[p, :2]
        level = np.stack([np.where(f > 0, frames.level[f - 1, p], head.level[0, p]), frames.level[f, p]], axis=1)
        interval = f - course.begin
        chains, chain = self._chains(self._links[bodies])
        questions = Questions(
            bodies=np.ascontiguousarray(bodies),
            chain=chain,
            time=np.ascontiguousarray(np.stack([course.time[interval], course.time[interval + 1]], axis=1)),
            level=np.ascontiguousarray(level),
            doubt=doubt[f, p],
        )
        found, least = between[f, p], bound[f, p]
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
        between[f, p], bound[f, p] = found, least
        question, level_, begins, earliest, latest = events[:count].T
        return Crossings(
            pair=p[question],
            level=level_.astype(np.uint8),
            begins=begins == 1,
            earliest=earliest,
            latest=latest,
            frame=course.first + interval[question],
        )

    def _chains(self, links: Integers) -> tuple[Chains, Integers]:
        """Return the ways between pairs of links, and (k, 2) each pair's: the short and the wide one."""
        known, place = np.unique(links, axis=0, return_inverse=True)
        sides: list[list[int]] = []
        for a, b in known.tolist():
            shared = self._shared(a, b)
            sides += [self._paths[a][shared:], self._paths[b][shared:]]
        count = len(known)
        if self._volumes.kind == AABB:
            for a, b in known.tolist():
                sides += [self._paths[a], self._paths[b]]
        first = np.concatenate([[0], np.cumsum([len(side) for side in sides])]).astype(np.int64)
        chains = Chains(first, np.array([link for side in sides for link in side], dtype=np.int64))
        near = place.reshape(-1)
        return chains, np.stack([near, near + count if self._volumes.kind == AABB else near], axis=1).astype(np.int64)

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
