"""Names of descriptions as names of the language: of letters, digits and `_.-`, at most 100 of them, each once."""

import re

import pytest

from replay.robots.names import RobotNames


@pytest.mark.parametrize(
    ("name", "called"),
    [
        ("arm", "arm"),
        ("a.b-c_D9", "a.b-c_D9"),
        ("left arm/ü", "left_arm__"),
        (".hidden", "_hidden"),
        ("-option", "_option"),
        ("", "_"),
        ("x" * 92, "x" * 92),
        ("x" * 93, "x" * 92),
    ],
)
def test_what_no_name_may_hold_becomes_an_underscore_and_what_is_long_is_cut(name, called):
    names = RobotNames()
    assert names.take(name) == called == names[name]
    assert name in names and "another" not in names
    assert [change.what for change in names.changes("link")] == ([] if called == name else [f"is called {called}"])


def test_a_name_that_is_taken_gets_the_next_number():
    names = RobotNames("left_")
    assert [names.take(name) for name in ("a b", "a_b", "a/b", "c")] == [
        "left_a_b",
        "left_a_b_2",
        "left_a_b_3",
        "left_c",
    ]
    assert names["a_b"] == "left_a_b_2"
    assert names.take("c") == "left_c_2" and names["c"] == "left_c"  # the first that is called so


def test_a_hundred_thousand_of_one_name_are_numbered_without_looking_through_all_of_them():
    names = RobotNames()
    called = [names.take("box") for _ in range(100_000)]
    assert called[:3] == ["box", "box_2", "box_3"] and called[-1] == "box_100000"
    assert names.take("box_2") == "box_2_2" and names.take("box") == "box_100001"


def test_long_names_that_begin_alike_stay_different_and_short_enough():
    names = RobotNames()
    called = [names.take("x" * 200 + str(k)) for k in range(1500)]
    assert len(set(called)) == 1500
    assert all(re.fullmatch(r"[A-Za-z0-9_][A-Za-z0-9_.\-]{0,99}", name) for name in called)
