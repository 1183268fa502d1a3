"""What is kept of how pairs meet, in frames and between them, while results stream past, and what it says then."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import Between, CollisionColumns, Level
from replay.errors import count
from replay.language.fields import When
from replay.numerics.arrays import Flags, Floats, Integers
from replay.numerics.constants import SECOND
from replay.scenario.measures import Measure
from replay.scenario.tallies import Extremes, frames_measure, shown_seconds

_NARROW = 10_000
"""A bracket up to so many nanoseconds is told by the shortest number in it, a wider one by its end."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What a block of n frames says of how k pairs meet, at one level or a higher one.

    Attributes:
        reached: (n, k) whether a frame shows it.
        inside: (n, k) whether it is so at some moment of the interval that ends at the frame, its ends included.
        unproven: (n,) whether it is undecided of some pair in that interval.
        pair, begins, frame, earliest, latest: of its crossings, (c,) by time: which of the pairs, see `Crossings`.
    """

    reached: Flags
    inside: Flags
    unproven: Flags
    pair: Integers
    begins: Flags
    frame: Integers
    earliest: Integers
    latest: Integers


def seen(collision: CollisionColumns, columns: NDArray[np.intp], level: Level) -> Seen:
    """Return what a block says of the pairs in some columns, in ascending order."""
    reached = collision.level[:, columns] >= level
    inside, unproven = reached, np.zeros(len(reached), dtype=bool)
    if level == Level.CONTACT and collision.between is not None:
        between = collision.between[:, columns]
        inside, unproven = between == Between.CONTACT, _any(between == Between.UNDECIDED)
    crossings = collision.crossings
    place = np.searchsorted(columns, crossings.pair)
    mine = (crossings.level == level) & np.isin(crossings.pair, columns)
    of = (place, crossings.begins, crossings.frame, crossings.earliest, crossings.latest)
    return Seen(reached, inside, unproven, *(values[mine] for values in of))


def _any(flags: Flags) -> Flags:
    """Return whether any of the pairs is so, (n,) of (n, k)."""
    result: Flags = np.any(flags, axis=1)
    return result


@dataclass
class _Intervals:
    """Intervals between frames of which something is to be told: how many, and the frame that ends the first."""

    number: int = 0
    first: int = 0

    def add(self, frames: Integers) -> None:
        if len(frames):
            self.first = self.first if self.number else int(frames[0])
            self.number += len(frames)

    def __str__(self) -> str:
        more = ("", " and once more", f" and {self.number - 1} times more")[min(self.number, 3) - 1]
        return f"between frames {self.first - 1} and {self.first}{more}"


@dataclass
class Meetings:
    """In how many frames pairs met, and when they did between two frames that do not show it.

    Attributes:
        when: what is expected; None when only the first meeting counts, see `begins_within`.
        names: of the pairs, as people read them.
        which: the pair that meets first.
    """

    when: When | None = None
    window: tuple[int, int] = (0, 0)
    count: int = 0
    frames: int = 0
    first: tuple[int, int] | None = None
    until: tuple[int, int] | None = None
    first_not: tuple[int, int] | None = None
    alone: _Intervals = field(default_factory=_Intervals)
    unproven: _Intervals = field(default_factory=_Intervals)
    surely_first: bool = True
    names: Sequence[str] = ()
    which: int | None = None
    _last: Flags | None = None

    def update(self, time_ns: Integers, block: Seen) -> None:
        """See `Tally`."""
        begin = self.frames
        last = np.zeros_like(block.reached[:1]) if self._last is None else self._last
        before = np.concatenate([last, block.reached[:-1]])
        self._last = block.reached[-1:].copy()
        so, was, alone = _any(block.reached), _any(before), _any(block.inside)
        alone[block.frame[block.begins] - begin] = True
        alone &= ~so & ~was
        self.count += int(np.count_nonzero(so))
        self.frames += len(so)
        if self.first is None:
            self._find_first(time_ns, block, so | alone, begin)
        self.alone.add(begin + np.flatnonzero(alone))
        self.unproven.add(begin + np.flatnonzero(block.unproven))
        if self.first_not is None:
            self.first_not = next(self._apart(time_ns, block, before, begin), None)

    def result(self, what: str) -> tuple[bool, str]:
        """See `Tally`."""
        if self.when is None:
            return self._begins(what)
        text = f"{what} in {self.count} of {count(self.frames, 'frame')}"
        if self.when == "always":
            text += "" if self.first_not is None else f", first not at {shown(self.first_not)}"
            return self.first_not is None, text
        met = self.count + self.alone.number > 0
        if self.alone.number:
            text = f"{what} {self.alone}" if not self.count else f"{text} and {self.alone}"
        text += "" if self.first is None else f", {self._who}first at {shown(self.first)}"
        text += "" if self.until is None else f", until {shown(self.until)}"
        if self.when == "never" and not met and self.unproven.number:
            return False, f"{text}, not proven {self.unproven}"
        return met == (self.when == "sometimes"), text

    def _begins(self, what: str) -> tuple[bool, str]:
        doubt = f", not proven {self.unproven}" if self.unproven.number and not self.surely_first else ""
        if self.first is None:
            return False, f"{what} in no frame{doubt}"
        inside = self.window[0] <= self.first[1] and self.first[0] <= self.window[1]
        who = f" of {self.subject}" if self.subject else ""
        return inside and not doubt, f"{what}{who} begins at {shown(self.first)}{doubt}"

    def measure(self, name: str) -> Measure:
        """See `Tally`: in how many frames and intervals between them pairs met, or when they first did."""
        first = None if self.first is None else self.first[1]
        if self.when is not None:
            at = first if self.when != "always" else None if self.first_not is None else self.first_not[1]
            number = self.count + self.alone.number
            subject = self.subject if self.when != "always" else ""
            return frames_measure(name, self.when, number, self.frames, at, subject)
        if first is None:
            return Measure(name, None, "s", limit=self.window[0] / SECOND)
        early, late = (first - self.window[0]) / SECOND, (self.window[1] - first) / SECOND
        limit = self.window[0 if early < late else 1] / SECOND
        return Measure(name, first / SECOND, "s", first / SECOND, self.subject, limit, min(early, late))

    @property
    def subject(self) -> str:
        """The pair that meets first; "" when none does, or where pairs have no names."""
        return "" if self.which is None or not self.names else self.names[self.which]

    @property
    def _who(self) -> str:
        return f"{self.subject} " if self.subject else ""

    def _find_first(self, time_ns: Integers, block: Seen, met: Flags, begin: int) -> None:
        """Look for the first meeting: the crossing with which it begins, else the frame that shows it."""
        at = int(np.argmax(met)) if met.any() else len(met)
        self.surely_first = self.surely_first and not block.unproven[: at + 1].any()
        if at == len(met):
            return
        self.first = int(time_ns[at]), int(time_ns[at])
        mine = np.flatnonzero(block.frame == begin + at)
        begins = mine[block.begins[mine]]
        shown_ = block.reached[at] if block.reached[at].any() else block.inside[at]
        self.which = int(np.argmax(shown_)) if shown_.any() else None
        if len(begins):
            one = begins[0]
            self.which = int(block.pair[one])
            self.first = int(block.earliest[one]), int(block.latest[one])
            ends = mine[~block.begins[mine] & (block.pair[mine] == block.pair[one]) & (mine > one)]
            if len(ends) and not block.reached[at].any():
                self.until = int(block.earliest[ends[0]]), int(block.latest[ends[0]])

    def _apart(self, time_ns: Integers, block: Seen, before: Flags, begin: int) -> Iterator[tuple[int, int]]:
        """Yield when all pairs are apart: in a frame, or between two of which one pair ends before the other begins."""
        so = _any(block.reached)
        handed = so & _any(before) & ~_any(block.reached & before)
        for at in np.flatnonzero(~so | handed).tolist():
            if not so[at]:
                yield int(time_ns[at]), int(time_ns[at])
                return
            mine = block.frame == begin + at
            ends, begins = mine & ~block.begins, mine & block.begins
            if ends.any() and begins.any() and block.latest[ends].max() < block.earliest[begins].min():
                yield int(block.latest[ends].max()), int(block.latest[ends].max())
                return


@dataclass
class Clearances:
    """The smallest clearance of pairs in frames, what is proven of it between them, and whether they meet there.

    Attributes:
        sampled: of the frames.
        bound: smallest proven lower bound [m].
        meetings: of the pairs.
    """

    sampled: Extremes
    bound: float = np.inf
    meetings: Meetings = field(default_factory=lambda: Meetings("never"))

    def update(self, time_ns: Integers, block: tuple[Floats, Floats, Seen, Integers]) -> None:
        """Take smallest clearances and bounds, (n,) [m] each, NaN for none, and how the pairs meet; see `Tally`.

        The last is (n,) which of the pairs has the smallest.
        """
        values, bounds, meetings, which = block
        names = self.meetings.names
        self.sampled.update(time_ns, values, [names[k] for k in which.tolist()] if names else None)
        self.meetings.update(time_ns, meetings)
        self.bound = float(np.nanmin(bounds, initial=self.bound))

    def result(self, what: str) -> tuple[bool, str]:
        """See `Tally`."""
        passed, text = self.sampled.result(what)
        met = self.meetings
        if met.alone.number:
            assert met.first is not None
            who = f"{met.subject} " if met.subject else ""
            return False, f"{text}; 0 m {met.alone}, {who}first at {shown(met.first)}"
        if met.unproven.number:
            return False, f"{text}, not proven {met.unproven}"
        if 0.0 < self.bound < np.inf:
            text += f", proven at least {self.bound:.6g} m between frames"
        return passed, text

    def measure(self, name: str) -> Measure:
        """See `Tally`."""
        met, limit = self.meetings, self.sampled.low
        if met.alone.number and met.first is not None:
            margin = None if limit is None else -limit
            return Measure(name, 0.0, "m", met.first[1] / SECOND, met.subject, limit, margin)
        return self.sampled.measure(name)


def shown(bracket: tuple[int, int]) -> str:
    """Return a moment [ns] that is known by a bracket for a message: the shortest number of seconds in a narrow one."""
    earliest, latest = bracket
    if not 0 < latest - earliest <= _NARROW:
        return shown_seconds(latest)
    for digits in range(10):
        step = 10 ** (9 - digits)
        whole = -(-earliest // step) * step
        if whole <= latest:
            break
    return f"{whole // 10**9}.{whole % 10**9:09d}".rstrip("0").rstrip(".") + " s"
