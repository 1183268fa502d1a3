"""Answers are kept by what was asked, and no longer than there is room."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pytest

from replay.numerics import kept
from replay.numerics.kept import forget


class Pair(NamedTuple):
    first: object
    second: object


@dataclass(frozen=True)
class Body:
    corners: object
    name: str = ""


@pytest.fixture
def asked():
    """Return a kept function and the list of what it was called with."""
    forget()
    calls = []

    @kept.kept
    def answer(*args, **kwargs):
        calls.append((args, kwargs))
        return np.full(1000, float(len(calls)))

    return answer, calls


ALL_DIFFERENT = [
    (),
    (1,),
    (1.0,),
    (True,),
    ("1",),
    (b"1",),
    (None,),
    (0.0,),
    (-0.0,),
    (1, 2),
    ((1, 2),),
    ([1, 2],),
    (Pair(1, 2),),
    (Body(1, "2"),),
    ("a", "bc"),
    ("ab", "c"),
    (np.zeros(6),),
    (-np.zeros(6),),
    (np.zeros((2, 3)),),
    (np.zeros((3, 2)),),
    (np.zeros(6, dtype=np.int64),),
    (np.zeros(12, dtype=np.float32),),
    (np.zeros(0), np.zeros(1)),
    (np.zeros(1), np.zeros(0)),
    (Body(np.arange(3.0)),),
    (Body(np.arange(4.0)),),
    (Pair(np.arange(3.0), None),),
]


def test_each_question_is_answered_once(asked):
    answer, calls = asked
    first = [answer(*question) for question in ALL_DIFFERENT] + [answer(1, two=2), answer(1, two=3)]
    again = [answer(*question) for question in ALL_DIFFERENT] + [answer(1, two=2), answer(1, two=3)]
    assert len(calls) == len(ALL_DIFFERENT) + 2
    assert all(a is b for a, b in zip(first, again, strict=True))


def test_what_is_equal_is_one_question(asked):
    answer, calls = asked
    table = np.arange(12.0).reshape(3, 4)
    assert answer(table) is answer(np.asfortranarray(table)) is answer(np.repeat(table, 2, axis=0)[::2])
    table[0, 0] = 5.0
    answer(table)
    assert len(calls) == 2


def test_functions_do_not_share_answers():
    assert kept.kept(lambda x: x + 1)(1) == 2
    forget()

    @kept.kept
    def other(x):
        return x + 2

    assert other(1) == 3


def test_the_latest_answers_are_kept_as_long_as_there_is_room(asked, monkeypatch):
    answer, calls = asked
    monkeypatch.setattr(kept, "MOST", 3 * 9100)
    for question in (1, 2, 3, 1, 4):
        answer(question)
    assert len(calls) == 4
    answer(1)
    assert len(calls) == 4, "asked for lately"
    answer(2)
    assert len(calls) == 5, "the one that was not asked for longest made room"


def test_large_questions_are_not_told_apart(asked, monkeypatch):
    answer, calls = asked
    monkeypatch.setattr(kept, "_LARGEST", 100)
    assert answer(np.zeros(20)) is not answer(np.zeros(20)) and len(calls) == 2


def test_errors_are_not_kept():
    calls = []

    @kept.kept
    def fails(x):
        calls.append(x)
        raise ValueError(x)

    for _ in range(2):
        with pytest.raises(ValueError):
            fails(1)
    assert calls == [1, 1]


def test_what_it_does_not_know_is_asked_each_time(asked):
    ask, calls = asked
    for thing in (object(), 1j):
        ask(thing)
        ask(thing)
    assert len(calls) == 4
