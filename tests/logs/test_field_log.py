"""Values of any messages over time: one motion in every encoding, excerpts that read as the log does."""

import json
import tracemalloc

import numpy as np
import pytest

from replay.errors import RecordingError
from replay.logs.field_log import in_window, read_fields
from replay.logs.message_log import open_message_log
from tests.logs import made_logs
from tests.logs.made_logs import Said

BEGIN = 1_700_000_000 * 10**9
ANGLES = [0.5, 0.25, 0.125, 0.0, -0.5]
SAID = [
    Said(BEGIN + k * 10**7, BEGIN + k * 10**7 + 1000, {"lift": 1.0, "elbow": angle}) for k, angle in enumerate(ANGLES)
]
ORIGIN = {"name": "log", "sha256": "0" * 64}


def fields(data, *places, stamped=True):
    return read_fields("log", open_message_log("log", data), places, stamped=stamped, max_gap=10**9)


def json_log(*messages):
    of_json = [(0, time, json.dumps(body).encode()) for time, body in messages]
    return made_logs.mcap_of(of_json, "json", "x", "jsonschema", b"{}", topic="/a")


@pytest.mark.parametrize("kind", made_logs.MESSAGES)
def test_one_motion_in_every_encoding(kind):
    path = "joints[elbow].position" if "protobuf" in kind else "position[elbow]"
    series = fields(made_logs.mcap(SAID, kind), ("/joint_states", path)).series["/joint_states", path]
    assert series.value.tolist() == ANGLES
    assert series.time.tolist() == [said.stamp for said in SAID]


def test_entries_by_number_are_those_by_name():
    log = fields(made_logs.mcap(SAID, "protobuf"), ("/joint_states", "joints[1].position"))
    assert log.series["/joint_states", "joints[1].position"].value.tolist() == ANGLES


def test_a_bag_says_the_same_as_mcap():
    place = ("/joint_states", "position[1]")
    assert fields(made_logs.db3(SAID), place).series[place].value.tolist() == ANGLES


def test_log_times_count_where_stamps_are_not_wanted():
    place = ("/joint_states", "position[1]")
    log = fields(made_logs.mcap(SAID), place, stamped=False)
    assert log.series[place].time.tolist() == [said.time for said in SAID]


def test_what_is_missing_is_no_sample_and_null_is_nothing():
    data = json_log((10, {"d": 1}), (20, {}), (30, {"d": None}), (40, {"d": "Infinity"}), (50, {"d": True}))
    series = fields(data, ("/a", "d")).series["/a", "d"]
    assert series.time.tolist() == [10, 30, 40, 50]
    assert np.array_equal(series.value, [1.0, np.nan, np.inf, 1.0], equal_nan=True)


@pytest.mark.parametrize(
    "odd", [[], [1.5], [1.5, None], [1.5, "NaN", 2.5], [1, True, 2**70], [1.5, 2.5, 3.5, 4.5], None, 7.0]
)
def test_entries_of_a_list_are_read_alike_whatever_other_messages_hold(odd):
    """Lists of plain numbers are taken together, others entry by entry."""
    plain = [(10 * k, {"d": [0.5 * k, 1.5 * k, float(k)]}) for k in range(1, 5)]
    mixed = [*plain, (50, {"d": odd}), (60, {})]
    places = [("/a", f"d[{k}]") for k in range(4 if odd == [1.5, 2.5, 3.5, 4.5] else 3)]
    series = fields(json_log(*mixed), *places).series
    words = {"NaN": np.nan, None: np.nan}
    for k, place in enumerate(places):
        expected = [(t, body["d"][k]) for t, body in mixed if isinstance(body.get("d"), list) and k < len(body["d"])]
        times, values = zip(*expected, strict=True)
        np.testing.assert_array_equal(series[place].time, times)
        np.testing.assert_array_equal(series[place].value, [float(words.get(value, value)) for value in values])


@pytest.mark.parametrize(
    "odd", [{}, {"a": 1.5}, {"a": 1.5, "b": None, "c": "NaN"}, {"a": 1, "b": True, "c": 2**70}, [1, 2]]
)
def test_fields_of_a_mapping_are_read_alike_whatever_other_messages_hold(odd):
    plain = [(10 * k, {"d": {"a": 0.5 * k, "b": 1.5 * k, "c": k}}) for k in range(1, 5)]
    mixed = [*plain, (50, {"d": odd}), (60, {}), (70, {"d": 7.0})]
    series = fields(json_log(*mixed), *(("/a", f"d.{name}") for name in "abc")).series
    words = {"NaN": np.nan, None: np.nan}
    for name in "abc":
        there = [(t, body["d"]) for t, body in mixed if isinstance(body.get("d"), dict) and name in body["d"]]
        assert series["/a", f"d.{name}"].time.tolist() == [t for t, _ in there]
        expected = [float(words.get(d[name], d[name])) for _, d in there]
        np.testing.assert_array_equal(series["/a", f"d.{name}"].value, expected)


def test_of_long_lists_the_entries_that_are_asked_for_are_kept():
    """All of them took six times the log."""
    data = json_log(*((10 * k, {"d": [k + 0.5 * n for n in range(10_000)]}) for k in range(1, 101)))
    tracemalloc.start()
    series = fields(data, ("/a", "d[0]"), ("/a", "d[9999]")).series
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert series["/a", "d[9999]"].value.tolist() == [k + 4999.5 for k in range(1, 101)]
    assert peak < 2 * len(data)


def test_samples_are_put_in_order_and_repeated_ones_are_one():
    series = fields(json_log((30, {"d": 3}), (10, {"d": 1}), (30, {"d": 3})), ("/a", "d")).series["/a", "d"]
    assert series.time.tolist() == [10, 30]


def test_leading_stamps_of_zero_are_left_out():
    zero = {"header": {"stamp": {"sec": 0, "nanosec": 0}}, "d": 9}
    later = [(k, {"header": {"stamp": {"sec": 1_700_000_000 + k, "nanosec": 5}}, "d": k}) for k in (1, 2, 3)]
    log = fields(json_log((0, zero), *later), ("/a", "d"))
    assert log.left_out == 1
    assert log.series["/a", "d"].value.tolist() == [1, 2, 3]


@pytest.mark.parametrize(
    ("messages", "place", "rule"),
    [
        ([(1, {"d": 1})], ("/b", "d"), r"has no topic '/b'; its topics are \['/a'\]"),
        ([(1, {"d": 1})], ("/a", "e"), "has no message with a field 'e'"),
        ([(1, {"d": "far"})], ("/a", "d"), "d is no number but text"),
        ([(1, {"d": [1, 2]})], ("/a", "d"), r"a list: name one of its 2 values, such as d\[0\]"),
        ([(1, {"d": {"x": 1}})], ("/a", "d"), "no number but a message"),
        ([(1, {"d": [{"x": 1}, {"x": 2}]})], ("/a", "d[1]"), "no number but a message"),
        ([(7, {"d": 1}), (7, {"d": 2})], ("/a", "d"), "has two values at 7e-09 s: 1 and 2"),
        ([(2**62 + 1, {"d": 1})], ("/a", "d"), "beyond 146 years"),
    ],
)
def test_what_cannot_be_used_is_refused(messages, place, rule):
    with pytest.raises(RecordingError, match=rule):
        fields(json_log(*messages), place)


def test_bytes_that_are_no_message_are_refused():
    data = made_logs.mcap_of([(0, 5, b"{")], "json", "x", "jsonschema", b"{}", topic="/a")
    with pytest.raises(RecordingError, match="holds a message that cannot be read"):
        fields(data, ("/a", "d"))


def test_an_excerpt_needs_a_sample_on_either_side_and_the_first_two():
    time = np.arange(0, 110, 10)
    kept = in_window(time, (35, 55), 0)
    assert time[kept].tolist() == [0, 10, 30, 40, 50, 60]
    assert in_window(time, None, 0).all()


@pytest.mark.parametrize("window", [None, (BEGIN + 2 * 10**7, BEGIN + 3 * 10**7 - 1)])
@pytest.mark.parametrize("kind", ["cdr", "protobuf", "json"])
def test_an_excerpt_reads_as_the_log_does_and_is_its_own_excerpt(kind, window):
    place = ("/joint_states", "joints[elbow].position" if kind == "protobuf" else "position[elbow]")
    log = fields(made_logs.mcap(SAID, kind), place)
    excerpt = log.cut(window, ORIGIN)
    again = fields(excerpt, place)
    assert again.begin == log.begin
    assert again.origin == ORIGIN
    assert again.cut(window, again.origin) == excerpt
    first, last = window or (0, 2**62)
    inside = [
        series.time[(series.time >= first) & (series.time <= last)]
        for series in (log.series[place], again.series[place])
    ]
    assert np.array_equal(*inside)
