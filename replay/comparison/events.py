"""State columns as events: what begins, ends or becomes another state, and how the events of two runs correspond.

An event has a frame, the first that shows it, and a bracket of time. Two events are the same if their frames are and
their brackets overlap; the shift of others is the gap between their brackets, or between their frames where neither
run knows more than these.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from replay.comparison.moments import Happenings, Moments, gap, happenings
from replay.numerics.arrays import Column, Flags, Integers
from replay.numerics.columns import Field, Kind

MAX_OPTIMAL = 2000
"""Unmatched events of one track up to which the correspondence of least total shift is searched; above, in order."""


@dataclass(frozen=True, eq=False)
class StateTrack:
    """One sequence of states whose changes are events.

    Attributes:
        baseline, candidate: (F,) int64 states in the frames that both runs have.
        rest: the state before the first frame; what a run starts with is an event unless it is this.
        labels: what happens when a state is entered; the label of None stands for all others, with "{}" for the state.
        time: (F,) [ns]; the frames' numbers when left out.
        known: what the baseline and the candidate know better than by frames.
        between: whether what lies between two frames counts: both runs can tell it.
    """

    baseline: Column
    candidate: Column
    rest: int
    labels: dict[int | None, str]
    time: Integers | None = None
    known: tuple[Moments | None, Moments | None] = (None, None)
    between: bool = True

    def label(self, state: int) -> str:
        """Return what happens when the state is entered."""
        return self.labels.get(state) or self.labels[None].format(state)


@dataclass(frozen=True, eq=False)
class Matched:
    """The E events of a track that are not the same in both runs, by time.

    Attributes:
        state: (E,) the state that is entered.
        baseline, candidate: (E,) index of the frame in which it is, -1 in the run that lacks the event.
        times: the same as times [ns], by which it has been entered.
        gap: (E,) [ns] from the baseline's bracket to the candidate's, 0 where they overlap.
        finer: (E,) whether one of the two is narrower than from frame to frame.
    """

    state: Integers
    baseline: Integers
    candidate: Integers
    times: tuple[Integers, Integers]
    gap: Integers
    finer: Flags


def tracks(
    field: Field,
    baseline: Column,
    candidate: Column,
    categories: tuple[str, ...],
    *,
    time: Integers | None = None,
    known: tuple[Moments | None, Moments | None] = (None, None),
    between: bool = True,
) -> Iterator[StateTrack]:
    """Yield the tracks of a pair of state columns; see `StateTrack` for the rest.

    Ordered states give one track a threshold: a run that goes from clear to contact at once and one that touches the
    bounds a frame before differ in when the bounds overlap, and not in their contact.
    """
    if len(baseline) == 0:
        return
    baseline, candidate = baseline.astype(np.int64), candidate.astype(np.int64)
    if field.kind is Kind.CATEGORY:
        names = dict(enumerate(categories, start=-1))
        names |= {state.value: state.name.lower().replace("_", " ") for state in field.states or ()}
        labels: dict[int | None, str] = {k: f"{field.name} becomes {text}" for k, text in names.items()}
        yield StateTrack(baseline, candidate, int(field.nothing), labels | {None: f"{field.name} becomes {{}}"}, time)
        return
    highest = max(len(field.begins), int(baseline.max()), int(candidate.max()))
    for threshold in range(1, highest + 1):
        name = field.begins[threshold - 1] if threshold <= len(field.begins) else f"{field.name} {threshold}"
        above = (baseline >= threshold).astype(np.int64), (candidate >= threshold).astype(np.int64)
        better = known[0] and known[0].at(threshold), known[1] and known[1].at(threshold)
        yield StateTrack(*above, 0, {1: f"{name} begins", 0: f"{name} ends"}, time, better, between)


def match(track: StateTrack) -> Matched:
    """Return the events of a track that are not the same in both runs, and which corresponds to which.

    Events that both runs have in the same frame are fixed. Between two of them, the events that lead to the same state
    correspond in order; where one run has more of them, the correspondence with the least total shift is taken, and the
    others are in one run only.
    """
    a, b = (_happenings(track, column, known) for column, known in zip(_columns(track), track.known, strict=True))
    states = np.unique(np.concatenate((a.state, b.state)))
    repeats = 1 + max(int(_repeats(run).max(initial=0)) for run in (a, b))
    span = repeats * len(track.baseline)
    keys_a, keys_b = (np.searchsorted(states, run.state) * span + run.row * repeats + _repeats(run) for run in (a, b))
    order_a, order_b = np.argsort(keys_a), np.argsort(keys_b)
    all_a, all_b = keys_a[order_a], keys_b[order_b]
    fixed = np.intersect1d(all_a, all_b, assume_unique=True)
    key_a = np.setdiff1d(all_a, fixed, assume_unique=True)
    key_b = np.setdiff1d(all_b, fixed, assume_unique=True)
    partner = _partners(key_a, key_b, fixed, span)
    met = partner >= 0
    alone = np.ones(len(key_b), dtype=bool)
    alone[partner[met]] = False
    missing = np.full(len(key_a), -1, dtype=np.int64)
    missing[met] = key_b[partner[met]]
    in_a = np.concatenate((key_a, np.full(int(alone.sum()), -1, dtype=np.int64), fixed))
    in_b = np.concatenate((missing, key_b[alone], fixed))
    of_a, of_b = _places(all_a, order_a, in_a), _places(all_b, order_b, in_b)
    paired = (of_a >= 0) & (of_b >= 0)
    gaps, finer = np.zeros(len(in_a), dtype=np.int64), np.zeros(len(in_a), dtype=bool)
    i, j = of_a[paired], of_b[paired]
    gaps[paired] = gap(a.earliest[i], a.latest[i], b.earliest[j], b.latest[j])
    finer[paired] = a.finer[i] | b.finer[j]
    known = np.where(in_a >= 0, in_a, in_b)
    told = (np.arange(len(in_a)) < len(in_a) - len(fixed)) | (gaps != 0)
    order = np.argsort(known % span, kind="stable")
    order = order[told[order]]
    return Matched(
        states[known // span][order],
        _of(a.row, of_a[order]),
        _of(b.row, of_b[order]),
        (_of(a.latest, of_a[order]), _of(b.latest, of_b[order])),
        gaps[order],
        finer[order],
    )


def _columns(track: StateTrack) -> tuple[Column, Column]:
    return track.baseline, track.candidate


def _happenings(track: StateTrack, column: Column, known: Moments | None) -> Happenings:
    time = np.arange(len(column)) if track.time is None else track.time
    return happenings(column, track.rest, time, known, between=track.between)


def _repeats(run: Happenings) -> Integers:
    """Return how often each state has been entered before in the same frame; zeros where frames tell all."""
    repeats = np.zeros(len(run.row), dtype=np.int64)
    (again,) = np.nonzero(run.row[1:] == run.row[:-1])
    for k in again.tolist():  # states take turns: the one before last is the same
        repeats[k + 1] = repeats[k - 1] + 1 if k and run.row[k - 1] == run.row[k + 1] else 0
    return repeats


def _places(keys: Integers, order: Integers, wanted: Integers) -> Integers:
    """Return where, in the order of time, the events of some keys are; -1 for the key -1."""
    found: Integers = np.where(wanted >= 0, order[np.searchsorted(keys, wanted)] if len(keys) else -1, -1)
    return found


def _of(values: Integers, places: Integers) -> Integers:
    """Return values at places, -1 at those that are -1."""
    found: Integers = np.where(places >= 0, values[places] if len(values) else -1, -1)
    return found


def _partners(key_a: Integers, key_b: Integers, fixed: Integers, span: int) -> Integers:
    """Return for each event of a the index of the corresponding event of b, or -1; keys are state · span + frame."""
    partner = np.full(len(key_a), -1, dtype=np.int64)
    if not len(key_a) or not len(key_b):
        return partner
    gap_a, gap_b = _gaps(key_a, fixed, span), _gaps(key_b, fixed, span)
    gaps, start_a, count_a = np.unique(gap_a, return_index=True, return_counts=True)
    start_b = np.searchsorted(gap_b, gaps)
    count_b = np.searchsorted(gap_b, gaps, side="right") - start_b
    which = np.repeat(np.arange(len(gaps)), count_a)
    rank = np.arange(len(key_a)) - start_a[which]
    in_order = rank < count_b[which]
    partner[in_order] = (start_b[which] + rank)[in_order]
    if len(key_a) + len(key_b) <= MAX_OPTIMAL:
        for k in np.flatnonzero((count_a != count_b) & (count_b > 0)):
            a = slice(start_a[k], start_a[k] + count_a[k])
            b = slice(start_b[k], start_b[k] + count_b[k])
            chosen = _least_shift(key_a[a], key_b[b])
            partner[a] = np.where(chosen >= 0, chosen + start_b[k], -1)
    return partner


def _gaps(keys: Integers, fixed: Integers, span: int) -> Integers:
    """Return a number per event: equal where the same state is entered between the same fixed events; ascending."""
    gap: Integers = np.searchsorted(fixed, keys) + (len(fixed) + 1) * (keys // span)
    return gap


def _least_shift(a: Integers, b: Integers) -> Integers:
    """Match all of the shorter of two ascending sequences to the longer, in order, with the least sum of |a - b|.

    Dynamic programme over (short, long): cost[i][j] = min(cost[i][j - 1], cost[i - 1][j - 1] + |short_i - long_j|).

    Returns:
        For each element of a the index of its partner in b, or -1.
    """
    short, long = (a, b) if len(a) <= len(b) else (b, a)
    cost = np.zeros(len(long) + 1)
    improves = np.zeros((len(short), len(long)), dtype=bool)
    for i, value in enumerate(short):
        take = cost[:-1] + np.abs(long - value)
        best = np.minimum.accumulate(take)
        improves[i, 0] = True
        improves[i, 1:] = take[1:] < best[:-1]
        cost = np.concatenate(([np.inf], best))
    chosen = np.full(len(short), -1, dtype=np.int64)
    end = len(long)
    for i in range(len(short) - 1, -1, -1):
        end = int(np.flatnonzero(improves[i, :end])[-1])
        chosen[i] = end
    if len(a) <= len(b):
        return chosen
    partner = np.full(len(a), -1, dtype=np.int64)
    partner[chosen] = np.arange(len(b))
    return partner
