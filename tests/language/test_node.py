"""The tree of a text: what it gives back, copies and shows."""

import pytest

from replay.language.decimal_comma import hint, parted, rule
from replay.language.node import Node, Place


def node(value, text="", line=1, column=1, **more):
    return Node(Place("f.yaml", line, column), value, text=text, **more)


def test_children_are_found_by_key_and_by_index_and_else_are_none():
    leaf = node(1.5, "1.5")
    tree = node({"a": node([leaf, node(None)]), "b": node("x", "x")})
    assert tree.child("a").child(0) is leaf and tree.child("a").child(1).value is None
    for missing in (
        tree.child("c"),
        tree.child(0),
        tree.child("a").child(2),
        tree.child("a").child(-1),
        leaf.child("a"),
    ):
        assert missing is None
    assert tree.data() == {"a": [1.5, None], "b": "x"}
    assert leaf.mapping == {} and leaf.sequence == [] and tree.sequence == []
    problem = Place("f.yaml", 3, 7).problem("is wrong")
    assert (problem.file, problem.line, problem.column) == ("f.yaml", 3, 7)
    assert str(Place("f.yaml", 3, 7)) == "f.yaml:3:7"


def test_a_copy_can_be_changed_by_itself_and_shares_what_was_shared():
    shared = node([node(1)])
    tree = node({"a": shared, "b": shared}, keys={"a": Place("f.yaml", 1, 1)}, whole=False, size=5)
    copy = tree.copy({})
    assert copy.data() == tree.data() and copy is not tree
    assert copy.child("a") is copy.child("b") and copy.child("a") is not shared
    assert (copy.size, copy.whole, copy.place) == (5, False, tree.place)
    copy.child("a").value.append(node(2))
    copy.keys["b"] = Place("f.yaml", 9, 9)
    assert tree.data() == {"a": [1], "b": [1]} and list(tree.keys) == ["a"]


@pytest.mark.parametrize(
    ("value", "text", "shown"),
    [
        ({}, "", "a mapping"),
        ([], "", "an empty list"),
        ([1, 2], "", "a list of 2"),
        (None, "", "null"),
        (1.0, "1.0e0", "1.0e0"),
        ("x", "x", "'x'"),
        ("y" * 58, "", repr("y" * 58)),
        ("y" * 59, "", "'" + "y" * 39 + "..." + "y" * 15 + "'"),
    ],
)
def test_a_value_is_shown_in_few_letters(value, text, shown):
    if isinstance(value, list):
        value = [node(v) for v in value]
    assert node(value, text).shown() == shown


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("1,5", "has a decimal comma; write 1.5"),
        (" -12,05 mm ", "has a decimal comma; write -12.05 mm"),
        ("+1,5e-3", "has a decimal comma; write +1.5e-3"),
        ("1,", ""),
        (",5", ""),
        ("1,5,6", ""),
        ("a,5", ""),
        ("1.5", ""),
    ],
)
def test_a_decimal_comma_is_told(text, said):
    assert rule(text) == said


def test_two_entries_that_may_be_one_number_are_told_where_nothing_but_a_comma_is_between_them():
    one, two, three = node(1, "1", 2, 5), node(5, "5", 2, 7), node(2, "2", 2, 10)
    assert hint([one, two, three]) == "; if 1,5 is one number, write 1.5"
    assert hint([one, node(5, "5", 2, 8)]) == hint([one, node(5, "5", 3, 7)]) == hint([one]) == hint([]) == ""
    assert hint([node("a", "a", 2, 5), two]) == ""
    assert hint([node(0, "0", 2, 2), node(7, "7", 2, 5), node(5, "5", 2, 7)]) == "; if 7,5 is one number, write 7.5"
    assert parted("1", "5") and parted("-1", "05 cm") and not parted("1.", "5") and not parted("1", "a")
