"""When the states of a field begin and end, by brackets of time, where a recording knows it better than by its frames.

A frame-only event has the bracket (frame before, frame]; an event whose crossing was found has one within it, and two
events may lie between two frames that show nothing of them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from replay.numerics.arrays import Flags, Integers
from replay.numerics.columns import Field
from replay.recording.events import Events


@dataclass(frozen=True, eq=False)
class Moments:
    """What begins and ends in the k columns of a field, by column, state and time.

    Attributes:
        column: (n,) of the signal.
        state: (n,) threshold that is reached or left.
        begins: (n,) whether it is reached.
        frame: (n,) of the recording, the first at or after `latest`.
        earliest, latest: (n,) [ns].
    """

    column: Integers
    state: Integers
    begins: Flags
    frame: Integers
    earliest: Integers
    latest: Integers

    def of(self, column: int) -> Moments:
        """Return those of one column."""
        begin, end = np.searchsorted(self.column, [column, column + 1])
        return self._taken(slice(int(begin), int(end)))

    def at(self, state: int) -> Moments:
        """Return those of one state."""
        return self._taken(self.state == state)

    def in_rows(self, rows: Integers | None, count: int) -> Moments:
        """Return these with `frame` counted in the `count` frames `rows` that are compared; None are all."""
        frame = self.frame if rows is None else np.searchsorted(rows, self.frame)
        kept = frame < count
        return Moments(self.column, self.state, self.begins, frame, self.earliest, self.latest)._taken(kept)

    def count_between(self, state: int) -> int:
        """Return how often a state begins and ends, or ends and begins, between two frames."""
        of = self.at(state)
        _, counts = np.unique(np.stack([of.column, of.frame]), axis=1, return_counts=True)
        return int((counts // 2).sum())

    def _taken(self, which: slice | Flags) -> Moments:
        values = self.column[which], self.state[which], self.begins[which]
        return Moments(*values, self.frame[which], self.earliest[which], self.latest[which])


def moments(field: Field, names: tuple[str, ...], topic: str, events: Events, time: Integers) -> Moments | None:
    """Return what a recording's events know better than its frames at `time` (F,) [ns]; None if they know nothing.

    Args:
        field: whose states they are, by the names in `field.events`.
        names: of the k signals, in the order of the columns.
        topic: of the signals.
        events: of the recording.
        time: of its frames.
    """
    if events.earliest is None or not len(events):
        return None
    inside = events.frame < len(time)
    frame = np.where(inside, events.frame, 0)
    before = time[np.maximum(frame - 1, 0)]
    finer = inside & ((events.earliest > before) | (events.time < time[frame]))
    states = {kind: state for state, kind in enumerate(field.events, start=1)}
    place = {name: column for column, name in enumerate(names)}
    known = [
        (place.get(what.subject, -1), states.get(what.kind, 0), what.begins) if what.source == topic else (-1, 0, False)
        for what in events.transitions
    ]
    column, state, begins = np.array(known, dtype=np.int64).reshape(-1, 3)[events.code].T
    (kept,) = np.nonzero(finer & (column >= 0) & (state > 0))
    if not len(kept):
        return None
    kept = kept[np.lexsort((kept, state[kept], column[kept]))]  # events are in the order of time
    values = column[kept], state[kept], begins[kept] > 0, events.frame[kept], events.earliest[kept], events.time[kept]
    return Moments(*values)


@dataclass(frozen=True, eq=False)
class Happenings:
    """What happens in one column, by time.

    Attributes:
        state: (n,) the state that is entered.
        row: (n,) frame, of those that are compared, that shows it, or the first after it.
        earliest, latest: (n,) [ns].
        finer: (n,) whether the bracket is narrower than from frame to frame.
    """

    state: Integers
    row: Integers
    earliest: Integers
    latest: Integers
    finer: Flags


def happenings(column: Integers, rest: int, time: Integers, known: Moments | None, *, between: bool) -> Happenings:
    """Return what happens in a column of states.

    What is known of an interval counts if it agrees with what the column shows at the interval's ends.

    Args:
        column: (F,) in the frames that are compared, at `time` [ns].
        rest: the state before the first frame.
        known: what is known better, of a column that is 0 and 1.
        between: whether to tell what begins and ends between two frames, so that neither shows it.
    """
    before = np.concatenate([[rest], column[:-1]])
    (row,) = np.nonzero(column != before)
    latest, earliest = time[row], time[np.maximum(row - 1, 0)]
    found = np.stack([column[row], row, earliest, latest, np.zeros(len(row), dtype=np.int64)], axis=1)
    if known is None or not len(known.frame):
        return _happenings(found)
    extra, replaced = [], np.zeros(len(row), dtype=bool)
    rows, starts = np.unique(known.frame, return_index=True)
    for at, begin, end in zip(rows.tolist(), starts.tolist(), [*starts[1:].tolist(), len(known.frame)], strict=True):
        enters = known.begins[begin:end].astype(np.int64)
        if enters[0] == before[at] or enters[-1] != column[at] or (enters[1:] == enters[:-1]).any():
            continue
        brackets = known.earliest[begin:end], known.latest[begin:end]
        if not between:
            if before[at] == column[at]:
                continue
            enters, brackets = enters[-1:], (brackets[0][:1], brackets[1][-1:])
        place, finer = np.full(len(enters), at), np.ones(len(enters), dtype=np.int64)
        extra.append(np.stack([enters, place, *brackets, finer], axis=1))
        replaced |= row == at
    found = np.concatenate([found[~replaced], *extra])
    return _happenings(found[np.lexsort((found[:, 3], found[:, 1]))])


def _happenings(table: Integers) -> Happenings:
    return Happenings(table[:, 0], table[:, 1], table[:, 2], table[:, 3], table[:, 4] > 0)


def gap(a_earliest: Integers, a_latest: Integers, b_earliest: Integers, b_latest: Integers) -> Integers:
    """Return the time [ns] from brackets a to brackets b, negative where b are before a; 0 where they overlap."""
    shift: Integers = np.maximum(b_earliest - a_latest, 0) - np.maximum(a_earliest - b_latest, 0)
    return shift
