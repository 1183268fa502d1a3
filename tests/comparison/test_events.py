"""Events of state columns against brute force and by what must always hold."""

import itertools

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.collision.columns import CollisionColumns
from replay.comparison.events import StateTrack, _least_shift, match, tracks
from replay.sensing.distance.columns import DistanceColumns
from tests.amounts import cases

LEVEL = CollisionColumns.fields()[0]
STATUS, SHAPE, TRIANGLE = (DistanceColumns.fields()[k] for k in (0, 5, 6))
ascending = st.lists(st.integers(0, 60), unique=True, max_size=6).map(sorted)


def track(a, b):
    return StateTrack(np.array(a, dtype=np.int64), np.array(b, dtype=np.int64), 0, {None: "{}"})


def events(a, b):
    found = match(track(a, b))
    return list(zip(found.state.tolist(), found.baseline.tolist(), found.candidate.tolist(), strict=True))


@given(ascending, ascending)
def test_least_shift_is_the_least_of_all_correspondences_in_order(a, b):
    if not a or not b:
        return
    partner = _least_shift(np.array(a), np.array(b))
    pairs = [(k, int(j)) for k, j in enumerate(partner) if j >= 0]
    assert len(pairs) == min(len(a), len(b))
    assert all(x[1] < y[1] for x, y in itertools.pairwise(pairs))
    total = sum(abs(a[k] - b[j]) for k, j in pairs)
    short, long = sorted((a, b), key=len)
    best = min(
        sum(abs(x - y) for x, y in zip(short, chosen, strict=True))
        for chosen in itertools.combinations(long, len(short))
    )
    assert total == best


@settings(max_examples=cases(200))
@given(st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3)), max_size=40))
def test_events_are_told_once_and_nothing_is_told_of_equal_columns(columns):
    a, b = ([pair[k] for pair in columns] for k in (0, 1))
    assert events(a, a) == []

    def starts(states):
        return {(state, k) for k, (before, state) in enumerate(itertools.pairwise([0, *states])) if state != before}

    found = events(a, b)
    told_a = [(state, at) for state, at, _ in found if at >= 0]
    told_b = [(state, at) for state, _, at in found if at >= 0]
    assert len(set(told_a)) == len(told_a)
    assert set(told_a) == starts(a) - starts(b)
    assert set(told_b) == starts(b) - starts(a)
    swapped = events(b, a)
    assert sorted((s, j, k) for s, k, j in swapped if -1 in (k, j)) == sorted(
        (s, k, j) for s, k, j in found if -1 in (k, j)
    ) or len(swapped) == len(found)


def test_a_lost_event_is_the_one_that_makes_the_others_move_least():
    a, b = np.zeros(100, dtype=int), np.zeros(100, dtype=int)
    for begin in (10, 30, 50):
        a[begin : begin + 5] = 1
    for begin in (31, 50):
        b[begin : begin + 5] = 1
    assert events(a, b) == [(1, 10, -1), (0, 15, -1), (1, 30, 31), (0, 35, 36)]


def test_events_do_not_correspond_across_one_that_both_have():
    a, b = np.zeros(60, dtype=int), np.zeros(60, dtype=int)
    a[[10, 30]] = 1
    b[[30, 50]] = 1
    assert [found for found in events(a, b) if found[0] == 1] == [(1, 10, -1), (1, -1, 50)]


def test_a_state_that_holds_from_the_start_begins_in_the_first_frame():
    assert events([1, 1, 1, 0], [0, 1, 1, 0]) == [(1, 0, 1)]
    assert events([1, 1, 1], [0, 0, 0]) == [(1, 0, -1)]


def test_many_events_correspond_in_order_and_quickly():
    a = np.arange(60_000) % 7 < 3
    found = events(a, np.roll(a, 2))
    assert len(found) > 17_000
    assert all(abs(k - j) <= 7 for _, k, j in found if -1 not in (k, j))


def labels(field, a, b, categories=()):
    found = []
    for one in tracks(field, np.array(a), np.array(b), categories):
        matched = match(one)
        found += [
            (one.label(int(state)), int(k), int(j))
            for state, k, j in zip(matched.state, matched.baseline, matched.candidate, strict=True)
        ]
    return found


def test_levels_are_told_by_threshold():
    assert labels(LEVEL, [0, 1, 2, 2, 0], [0, 0, 2, 2, 0]) == [("overlap of bounds begins", 1, 2)]
    assert labels(LEVEL, [0, 2, 0, 0], [0, 1, 0, 0]) == [("contact begins", 1, -1), ("contact ends", 2, -1)]
    assert labels(STATUS, [1, 1, 2, 1], [1, 2, 2, 1]) == [("too close begins", 2, 1)]


def test_states_beyond_the_known_ones_are_told_too():
    assert labels(LEVEL, [0, 2, 2], [0, 3, 2]) == [("level 3 begins", -1, 1), ("level 3 ends", -1, 2)]


def test_categories_are_told_by_the_state_they_become():
    shape = SHAPE
    assert labels(shape, [-1, 0, 0, 1], [-1, 0, 1, 1], ("nothing", "a/b", "c/d")) == [("shape becomes c/d", 3, 2)]
    triangle = TRIANGLE
    assert labels(triangle, [-1, 5, 5], [-1, 5, 9]) == [("triangle becomes 9", -1, 2)]
