"""State columns as events: what begins, ends or becomes another state, and how the events of two runs correspond."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from replay.numerics.arrays import Column, Integers
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
    """

    baseline: Column
    candidate: Column
    rest: int
    labels: dict[int | None, str]

    def label(self, state: int) -> str:
        """Return what happens when the state is entered."""
        return self.labels.get(state) or self.labels[None].format(state)


@dataclass(frozen=True, eq=False)
class Matched:
    """The E events of a track that are not in the same frame in both runs, by time.

    Attributes:
        state: (E,) the state that is entered.
        baseline, candidate: (E,) index of the frame in which it is, -1 in the run that lacks the event.
    """

    state: Integers
    baseline: Integers
    candidate: Integers


def tracks(field: Field, baseline: Column, candidate: Column, categories: tuple[str, ...]) -> Iterator[StateTrack]:
    """Yield the tracks of a pair of state columns.

    Ordered states give one track a threshold: a run that goes from clear to contact at once and one that touches the
    bounds a frame before differ in when the bounds overlap, and not in their contact.
    """
    if len(baseline) == 0:
        return
    baseline, candidate = baseline.astype(np.int64), candidate.astype(np.int64)
    if field.kind is Kind.CATEGORY:
        rest = 0 if field.name == "case" else -1
        labels: dict[int | None, str] = {k - 1: f"{field.name} becomes {text}" for k, text in enumerate(categories)}
        yield StateTrack(baseline, candidate, rest, labels | {None: f"{field.name} becomes {{}}"})
        return
    highest = max(len(field.begins), int(baseline.max()), int(candidate.max()))
    for threshold in range(1, highest + 1):
        name = field.begins[threshold - 1] if threshold <= len(field.begins) else f"{field.name} {threshold}"
        above = (baseline >= threshold).astype(np.int64), (candidate >= threshold).astype(np.int64)
        yield StateTrack(*above, rest=0, labels={1: f"{name} begins", 0: f"{name} ends"})


def match(track: StateTrack) -> Matched:
    """Return the events of a track that are not in the same frame in both runs, and which corresponds to which.

    Events that both runs have in the same frame are fixed. Between two of them, the events that lead to the same state
    correspond in order; where one run has more of them, the correspondence with the least total shift is taken, and the
    others are in one run only.
    """
    state_a, frame_a = _events(track.baseline, track.rest)
    state_b, frame_b = _events(track.candidate, track.rest)
    span = len(track.baseline)
    states = np.unique(np.concatenate((state_a, state_b)))
    all_a = np.sort(np.searchsorted(states, state_a) * span + frame_a)
    all_b = np.sort(np.searchsorted(states, state_b) * span + frame_b)
    fixed = np.intersect1d(all_a, all_b, assume_unique=True)
    key_a = np.setdiff1d(all_a, fixed, assume_unique=True)
    key_b = np.setdiff1d(all_b, fixed, assume_unique=True)
    partner = _partners(key_a, key_b, fixed, span)
    met = partner >= 0
    alone = np.ones(len(key_b), dtype=bool)
    alone[partner[met]] = False
    missing = np.full(len(key_a), -1, dtype=np.int64)
    missing[met] = key_b[partner[met]]
    in_a = np.concatenate((key_a, np.full(int(alone.sum()), -1, dtype=np.int64)))
    in_b = np.concatenate((missing, key_b[alone]))
    known = np.where(in_a >= 0, in_a, in_b)
    order = np.argsort(known % span, kind="stable")
    return Matched(
        states[known // span][order],
        np.where(in_a >= 0, in_a % span, -1)[order],
        np.where(in_b >= 0, in_b % span, -1)[order],
    )


def _events(column: Column, rest: int) -> tuple[Integers, Integers]:
    """Return the states entered and the frames in which they are."""
    before = np.empty_like(column)
    before[:1] = rest
    before[1:] = column[:-1]
    frames = np.flatnonzero(column != before)
    return column[frames], frames


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
