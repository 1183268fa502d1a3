"""What begins and what ends in a recording: of pairs and of sensors, found from the columns.

An event is known by a bracket of time. Levels of pairs have narrow ones where their crossings were found; all that is
known of anything else is that a frame shows it and the frame before does not.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import NDArray

from replay.collision.columns import CollisionColumns, Crossings, Level
from replay.guarding.columns import EVENTS as GUARD_EVENTS
from replay.guarding.columns import EXCESS, Happening
from replay.numerics.arrays import Flags, Integers
from replay.sensing.kinds import KINDS
from replay.simulation import FrameBlock, Layout

_GUARDS = "/guards"
_FIELDS = [*CollisionColumns.fields(), *(field for kind in KINDS.values() for field in kind.columns.fields())]
SEVERITY = {event: severity for field in _FIELDS for event, severity in field.events.items()} | GUARD_EVENTS
"""Foxglove's log level of the beginning of each kind of event; the end of any is information (2)."""
_INFORMATION = 2
_EXACT = 1e-3
"""Moments of guards this near a nanosecond [ns] are that one: what seconds lose of it."""
_LEVELS = {"bounds": Level.BOUNDS, "contact": Level.CONTACT}
"""The kinds of events that crossings tell of, and the level that begins or ends."""


@dataclass(frozen=True)
class Transition:
    """What begins or ends, in no particular frame.

    Attributes:
        kind: "bounds" (the bounding volumes of a pair meet, whether or not the shapes do), "contact", "undecided", or
            what the columns of a sensor kind call it, such as "detection"; of a guard "trigger", "hold" or "release",
            and "excess acceleration" of a joint that guards slow down.
        begins: whether it begins; else it ends.
        subject: the pair, the sensor, the guard or the joint.
        source: the topic that says so.
    """

    kind: str
    begins: bool
    subject: str
    source: str

    @property
    def text(self) -> str:
        """The transition in words."""
        return f"{self.kind} {'begins' if self.begins else 'ends'}: {self.subject}"

    @property
    def severity(self) -> int:
        """Foxglove's log level."""
        return SEVERITY[self.kind] if self.begins else _INFORMATION


@dataclass(frozen=True)
class Event:
    """One thing that begins or ends; see `Transition`.

    Attributes:
        time: [ns] from the scenario's start, by which it has begun or ended.
        frame: index of the first frame at or after `time`.
        earliest: [ns], from when on it may have; None in a recording of format 1.
    """

    time: int
    frame: int
    kind: str
    begins: bool
    subject: str
    source: str
    earliest: int | None = None


@dataclass(frozen=True, eq=False)
class Events(Sequence[Event]):
    """n events, in the order of time, held as columns; an `Event` is made when it is asked for.

    Attributes:
        time: (n,) [ns] from the scenario's start, by which it has begun or ended.
        frame: (n,) index of the first frame at or after `time`.
        code: (n,) index into `transitions`.
        transitions: each is different.
        earliest: (n,) [ns], from when on it may have; None in a recording of format 1.
    """

    time: Integers
    frame: Integers
    code: Integers
    transitions: tuple[Transition, ...]
    earliest: Integers | None = None

    @staticmethod
    def none() -> Events:
        """Return no events."""
        empty = np.zeros(0, dtype=np.int64)
        return Events(empty, empty, empty, (), empty)

    def __len__(self) -> int:
        return len(self.time)

    @overload
    def __getitem__(self, index: int) -> Event: ...
    @overload
    def __getitem__(self, index: slice) -> Events: ...
    def __getitem__(self, index: int | slice) -> Event | Events:
        if isinstance(index, slice):
            return self._taken(index)
        what = self.transitions[self.code[index]]
        time, frame = int(self.time[index]), int(self.frame[index])
        earliest = None if self.earliest is None else int(self.earliest[index])
        return Event(time, frame, what.kind, what.begins, what.subject, what.source, earliest)

    def _taken(self, which: slice | Integers) -> Events:
        earliest = None if self.earliest is None else self.earliest[which]
        return Events(self.time[which], self.frame[which], self.code[which], self.transitions, earliest)

    def __eq__(self, other: object) -> bool:
        """Whether both hold the same events in the same order."""
        if not isinstance(other, Events):
            return NotImplemented
        mine, theirs = _table(self, other)
        return bool(np.array_equal(mine, theirs))

    __hash__ = None  # type: ignore[assignment]

    def in_order(self, layout: Layout) -> Events:
        """Return these in the order in which they are found: by time, and at one time by kind and name.

        A file that another tool has written anew may hold those of one time in any order.
        """
        place = {(kind, name): at for at, (kind, name, _) in enumerate(_subjects(layout))}
        ranks = [place.get((what.kind, what.subject), len(place)) for what in self.transitions]
        return self._taken(np.lexsort((np.array(ranks, dtype=np.int64)[self.code], self.time)))

    def count_missing_in(self, other: Events) -> int:
        """Return how many of these events the other does not have."""
        mine, theirs = (rows.view("i8,i8,i8,i8")[:, 0] for rows in _table(self, other))
        return int((~np.isin(mine, theirs)).sum())

    def of_source(self, topic: str) -> Events:
        """Return those that a topic tells."""
        mine = np.array([what.source == topic for what in self.transitions], dtype=np.bool_)
        return self._taken(np.flatnonzero(mine[self.code]))

    def at_frames(self, time: Integers) -> Events:
        """Return what frames show of these, by frame: what begins and ends between two is not among them.

        Args:
            time: of the recording's frames [ns]. What happens before a frame, after the one before, is told at its
                time.
        """
        if not len(self):
            return Events.none()
        subjects = {(what.kind, what.subject, what.source): k for k, what in enumerate(self.transitions)}
        of = np.array([subjects[what.kind, what.subject, what.source] for what in self.transitions], dtype=np.int64)
        begins = np.array([what.begins for what in self.transitions], dtype=np.bool_)
        order = np.lexsort((np.arange(len(self)), of[self.code], self.frame))
        rows = np.stack([self.frame, of[self.code]])[:, order]
        new = np.ones(len(order), dtype=np.bool_)
        new[1:] = (rows[:, 1:] != rows[:, :-1]).any(axis=0)
        (first,) = np.nonzero(new)
        last = np.append(first[1:], len(order)) - 1
        first, last = order[first], order[last]
        shown = self._taken(last[begins[self.code[first]] == begins[self.code[last]]])
        frame = np.minimum(shown.frame, len(time) - 1)
        inside = (shown.time <= time[frame]) & (shown.time > np.where(frame > 0, time[frame - 1], -1))
        told = Events(np.where(inside, time[frame], shown.time), shown.frame, shown.code, self.transitions)
        ranks = {what: rank for rank, what in enumerate(sorted(self.transitions, key=repr))}
        rank = np.array([ranks[what] for what in self.transitions], dtype=np.int64)[told.code]
        return told._taken(np.lexsort((rank, told.frame)))

    def columns(self) -> dict[str, NDArray[np.generic]]:
        """Return time and earliest [ns], frame, kind, begins and subject of all events, (n,) each.

        A recording of format 1 has no `earliest`.
        """
        return {
            "time": self.time,
            **({} if self.earliest is None else {"earliest": self.earliest}),
            "frame": self.frame,
            "kind": np.array([what.kind for what in self.transitions], dtype=np.str_)[self.code],
            "begins": np.array([what.begins for what in self.transitions], dtype=np.bool_)[self.code],
            "subject": np.array([what.subject for what in self.transitions], dtype=np.str_)[self.code],
        }


def _table(a: Events, b: Events) -> tuple[Integers, Integers]:
    """Return both as rows (n, 4) of time, earliest time, frame and a code that means the same in both."""
    common = {what: code for code, what in enumerate(dict.fromkeys((*a.transitions, *b.transitions)))}
    tables = []
    for events in (a, b):
        codes = np.array([common[what] for what in events.transitions], dtype=np.int64)
        earliest = np.full(len(events), -1) if events.earliest is None else events.earliest
        rows = np.stack([events.time, earliest, events.frame, codes[events.code]], axis=1)
        tables.append(np.ascontiguousarray(rows))
    return tables[0], tables[1]


class EventFinder:
    """Finds the events of blocks given in order; what is already so in the first frame begins there."""

    def __init__(self, layout: Layout) -> None:
        self._first: dict[str, int] = {}
        self._last: dict[str, Flags] = {}
        self._before = 0  # [ns], the frame before the next block
        self._subjects = list(_subjects(layout))
        for at, (kind, _, _) in enumerate(self._subjects):
            self._first.setdefault(kind, 2 * at)
        counts = Counter(kind for kind, _, _ in self._subjects)
        for kind in SEVERITY:
            self._last[kind] = np.zeros(counts[kind], dtype=np.bool_)

    def find(self, block: FrameBlock) -> Events:
        """Return the events of the next block, by time, and at one time by kind and name."""
        crossings = Crossings.none() if block.collision is None else block.collision.crossings
        before = np.concatenate([[min(self._before, int(block.time[0]))], block.time[:-1]])
        self._before = int(block.time[-1])
        columns: list[tuple[Integers, ...]] = [
            (np.zeros(0, dtype=np.int64),) * 4
        ]  # number, frame in the block, time, earliest
        for kind, state in _states(block):
            changed = np.empty(state.shape, dtype=np.bool_)
            np.not_equal(state[0], self._last[kind], out=changed[0])
            np.not_equal(state[1:], state[:-1], out=changed[1:])
            self._last[kind] = state[-1].copy()
            if kind in _LEVELS:
                mine = np.flatnonzero(crossings.level == _LEVELS[kind])
                frame, pair = crossings.frame[mine] - block.first, crossings.pair[mine]
                number = self._first.get(kind, 0) + 2 * pair + crossings.begins[mine]
                columns.append((number, frame, crossings.latest[mine], crossings.earliest[mine]))
                changed[frame, pair] = False  # the crossings tell it
            found = np.flatnonzero(changed)
            if len(found):
                frame, subject = found // state.shape[1], found % state.shape[1]
                number = self._first[kind] + 2 * subject + state.reshape(-1)[found]
                columns.append((number, frame, block.time[frame], before[frame]))
        if block.guards is not None and block.guards.happenings:
            columns.append(self._of_guards(block, block.guards.happenings))
        number, frame, time, earliest = (np.concatenate(parts) for parts in zip(*columns, strict=True))
        order = np.lexsort((number // 2, time))  # what begins and ends at one time stays in the order of its crossings
        numbers, code = np.unique(number, return_inverse=True)
        transitions = tuple(self._transition(number) for number in numbers.tolist())
        return Events(time[order], block.first + frame[order], code[order], transitions, earliest[order])

    def _of_guards(self, block: FrameBlock, happenings: Sequence[Happening]) -> tuple[Integers, ...]:
        """Return number, frame in the block, time and earliest time of what happened to guards."""
        known = {(kind, subject): at for at, (kind, subject, _) in enumerate(self._subjects)}
        number = [2 * known[item.kind, item.subject] + item.begins for item in happenings]
        latest = np.array([math.ceil(1e9 * item.time - _EXACT) for item in happenings], dtype=np.int64)
        latest = np.clip(latest, 0, block.time[-1])
        earliest = np.array([math.floor(1e9 * item.time + _EXACT) for item in happenings], dtype=np.int64)
        frame: Integers = np.searchsorted(block.time, latest)
        return np.array(number, dtype=np.int64), frame, latest, np.minimum(earliest, latest)

    def _transition(self, number: int) -> Transition:
        kind, subject, source = self._subjects[number // 2]
        return Transition(kind, number % 2 == 1, subject, source)


def _subjects(layout: Layout) -> Iterator[tuple[str, str, str]]:
    """Yield kind, name and topic of whatever may begin or end, in the order in which it is told."""
    groups = [(CollisionColumns.fields(), dict.fromkeys(layout.pairs, "/collision"))]
    for kind in KINDS.values():
        names = layout.sensors.get(kind.name, ())
        groups.append((kind.columns.fields(), {name: kind.topic(name) for name in names}))
    for fields, topics in groups:
        for field in fields:
            for event in field.events:
                yield from ((event, name, topic) for name, topic in topics.items())
    if layout.guards:
        for event in GUARD_EVENTS:
            names = layout.joints if event == EXCESS else layout.guards
            yield from ((event, name, _GUARDS) for name in names)


def _states(block: FrameBlock) -> Iterator[tuple[str, Flags]]:
    for columns in (block.collision, *(block.readings.get(kind) for kind in KINDS)):
        for field in () if columns is None else columns.present():
            for state, event in enumerate(field.events, start=1):
                yield event, getattr(columns, field.name) >= state
