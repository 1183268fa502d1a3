"""YAML 1.2: core schema scalars, places, and what is refused."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from replay.language.node import Node
from replay.scenario.yaml_text import MAX_DEPTH, MAX_NODES, parse
from tests.amounts import cases


def read(text):
    problems = []
    node = parse(text if isinstance(text, bytes) else text.encode(), "f.yaml", problems)
    return node, [str(problem) for problem in problems]


@pytest.mark.parametrize(
    ("written", "value"),
    [
        ("1e-6", 1e-6),
        ("1e3", 1000.0),
        ("+12", 12),
        ("-0.5", -0.5),
        (".5", 0.5),
        ("5.", 5.0),
        ("007", 7),
        ("0o17", 15),
        ("0x1F", 31),
        (".inf", math.inf),
        ("-.INF", -math.inf),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        *[
            (text, text)
            for text in ("on", "off", "yes", "no", "y", "n", "On", "12:30", "1_000", "0b11", "-0x1F", "+0o7")
        ],
        *[(text, text) for text in ("2026-01-01", "1e", "e5", ".", "0x", "nan", "inf", "tRUE", "1.2.3", "=")],
        ("'1'", "1"),
        ('"on"', "on"),
        ("!!str 1", "1"),
        ("! 1", "1"),
        ("!!float 1", 1.0),
        ("!!int '1'", 1),
        ("|\n  a\n  b\n", "a\nb\n"),
        ("{a: [1, two]}", {"a": [1, "two"]}),
    ],
)
def test_scalars_follow_the_core_schema_of_yaml_1_2(written, value):
    node, problems = read(f"key: {written}")
    assert problems == []
    found = node.mapping["key"].data()
    assert found == value and type(found) is type(value)


def test_not_a_number_is_read_as_such():
    assert all(math.isnan(value) for value in read("[.nan, .NaN, .NAN]")[0].data())


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_doubles_survive_being_written(value):
    assert read(f"[{value!r}]")[0].data() == [value]


def test_every_key_and_value_knows_its_place():
    node, _ = read("a: 1\nbb:\n  - {c: &x x}\n  - *x\n")
    assert [(key, place.line, place.column) for key, place in node.keys.items()] == [("a", 1, 1), ("bb", 2, 1)]
    assert str(node.mapping["a"].place) == "f.yaml:1:4"
    first, second = node.mapping["bb"].sequence
    assert str(first.keys["c"]) == "f.yaml:3:6"
    assert str(first.mapping["c"].place) == str(second.place) == "f.yaml:3:9"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        (b"a: \xff", "f.yaml:1:4: byte 0xff is not UTF-8; save the file as UTF-8"),
        (b"a: 1\nb: \xe4\n", "f.yaml:2:4: byte 0xe4 is not UTF-8; save the file as UTF-8"),
        ("a: 1".encode("utf-16"), "f.yaml:1:1: UTF-16 text; save the file as UTF-8"),
        ("a:\n\t- x", "f.yaml:2:1: not YAML: a tab cannot indent YAML; use spaces"),
        ("a: [1,\nb: 2", "f.yaml:2:5: not YAML: expected ',' or ']', but got '<stream end>' "
         "(while parsing a flow sequence that starts at 1:4)"),
        ("a: b: c", "f.yaml:1:5: not YAML: mapping values are not allowed here"),
        ("a: \x01", "f.yaml:1:4: character U+0001 is not allowed in YAML; remove it"),
        ('a: "\\UFFFFFFFF"', "f.yaml:1:2: not YAML after this: Python int too large to convert to C int"),
        ('a: "\\ud800"', "f.yaml:1:4: half of a surrogate pair is not a character; write the character itself"),
        ("a: 1\n---\nb: 2", "f.yaml:2:1: a second document starts here; a file holds one"),
        ("%YAML 1.1\n---\na: on", "f.yaml:2:1: %YAML 1.1: only YAML 1.2 is read; remove this line"),
        ("a: 1\nb: 2\na: 3", "f.yaml:3:1: a: the key is written twice; the first is at f.yaml:1:1"),
        ("a: *b", "f.yaml:1:4: alias *b has no anchor &b above it"),
        ("a: &x [*x]", "f.yaml:1:8: alias *x is inside its own anchor"),
        ("<<: {a: 1}", "f.yaml:1:1: merge keys (<<) are not YAML 1.2; write the keys out, or use an alias for "
         "the whole"),
        ("1: a", "f.yaml:1:1: key 1 is not text; keys are text, write it in quotes"),
        ("a: !!python/object:os.system 1", "f.yaml:1:4: tag tag:yaml.org,2002:python/object:os.system is not part of "
         "the language; remove it"),
        ("a: !!set {b}", "f.yaml:1:4: tag tag:yaml.org,2002:set is not part of the language; remove it"),
        ("a: !!int b", "f.yaml:1:4: 'b' is not a YAML int, as its tag says"),
        ("a: 1e999", "f.yaml:1:4: 1e999 is too large for a number; write .inf where infinity is meant"),
        ("a: " + "9" * 401, "f.yaml:1:4: a number of 401 characters; at most 400 are read"),
        ("[" * 60, f"f.yaml:1:{MAX_DEPTH + 1}: collections nested more than {MAX_DEPTH} deep"),
        (b"a" * (5 << 20), "f.yaml: the file has 5242880 bytes; at most 1048576 are read"),
        ("", "f.yaml: the file is empty"),
        ("---\n# nothing\n", "f.yaml: the file is empty"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_one_line_with_its_place(text, line):
    assert read(text)[1] == [line]


def test_aliases_cannot_grow_without_bound():
    lines = ["a0: &a0 [1, 1, 1, 1, 1, 1, 1, 1, 1]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 9)}]" for k in range(1, 12)]
    node, problems = read("\n".join(lines))
    assert node is None
    assert problems[0].endswith(f"more than {MAX_NODES} values with every alias written out")


def test_a_byte_order_mark_is_no_content():
    assert read(b"\xef\xbb\xbfa: 1")[0].data() == {"a": 1}


SEED = b"a: &x {b: 1e-6, c: [1, 'two', !!str 3, on]}\nd: *x\n? [q]\n: 3\n12:30: |\n  text\n"
EDITS = st.lists(
    st.tuples(
        st.integers(0, len(SEED) - 1),
        st.integers(0, 2),
        st.sampled_from(list(b"{}[]:,&*!|>'\"%@`#-?\\ \t\nab1\x00\xff\x85")),
    ),
    max_size=6,
)


@settings(max_examples=cases(300))
@given(EDITS)
def test_damaged_text_is_a_tree_or_a_problem_and_never_a_crash(edits):
    text = bytearray(SEED)
    for position, removed, added in edits:
        text[position : position + removed] = bytes([added])
    node, problems = read(bytes(text))
    assert problems or isinstance(node, Node)


def test_a_text_read_again_is_a_tree_of_its_own_with_the_same_problems():
    text = b"a: &x {b: [1, 2]}\nc: *x\nd: 0\nd: 1\n"
    (first, found), (again, found_again) = read(text), read(text)
    assert first.data() == again.data() and found == found_again and len(found) == 1
    assert again.mapping["a"] is again.mapping["c"], "an alias is what its anchor is"
    first.mapping["a"].mapping["b"].sequence.append(first.mapping["d"])
    del first.mapping["d"], first.keys["d"]
    (last, _) = read(text)
    assert last.data() == again.data() == {"a": {"b": [1, 2]}, "c": {"b": [1, 2]}, "d": 0}
    assert set(last.keys) == {"a", "c", "d"}
