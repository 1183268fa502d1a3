"""Which publishers of a joint take turns, and which follow one another."""

import numpy as np
import pytest

from replay.logs.joint_log import Series, _joined

A, B = (1, ""), (2, "")


def series(times, first_row=0, value=0.0):
    rows = np.arange(first_row, first_row + len(times))
    return Series(np.array(times, dtype=np.int64), np.full(len(times), value) + rows, rows)


@pytest.mark.parametrize(
    ("first", "second", "turns"),
    [
        ([0, 10, 20], [21, 30], False),
        ([0, 10, 20], [20, 30], True),  # which of the two is right at 20 nobody can say
        ([0, 10, 20], [19, 30], True),
        ([20, 30], [0, 10, 20], True),
        ([21, 30], [0, 10, 20], False),
        ([0, 10, 20], [5, 6], True),
        ([10], [10], True),
    ],
)
def test_publishers_take_turns_when_the_later_begins_before_the_other_is_over(first, second, turns):
    joined = _joined({A: [series(first)], B: [series(second, 10, 100.0)]})
    assert joined.by_turns == (((A, B) if min(first) <= min(second) else (B, A)) if turns else ())
    assert sorted(joined.time.tolist()) == sorted([*first, *second])
    if not turns:
        assert joined.time.tolist() == sorted([*first, *second])


def test_what_a_second_publisher_repeats_is_the_first_one_s():
    same = Series(np.array([0, 10]), np.array([1.0, 2.0]), np.array([2, 3]))
    joined = _joined({A: [Series(same.time, same.value, np.array([0, 1]))], B: [same]})
    assert joined.by_turns == () and joined.row.tolist() == [0, 1]
