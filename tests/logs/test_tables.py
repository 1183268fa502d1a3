"""Topics as tables: what a column holds, and what it is called, from messages of which this test knows the values."""

from __future__ import annotations

import json

import numpy as np
import pytest

from replay import limits
from replay.logs.mcap_reader import McapLog
from replay.logs.tables import TIME, topic_table
from tests.logs import made_logs
from tests.logs.made_logs import Said


def table(messages, topic="/a", kind=("json", "Any", "jsonschema", b"{}")):
    """The table of messages at times 10, 20, ...: of JSON, or bytes of another kind."""
    data = [json.dumps(message).encode() if kind[0] == "json" else message for message in messages]
    made = made_logs.mcap_of([(0, 10 * (k + 1), one) for k, one in enumerate(data)], *kind, topic="/a")
    with McapLog("a.mcap", data=made) as log:
        return topic_table(log, topic)


def test_values_of_one_type_are_numbers_and_others_texts():
    columns, reason = table(
        [
            {"a": 1, "b": 1, "c": True, "d": "x", "e": 1, "f": None, "g": 2**63},
            {"a": -2, "b": 0.5, "c": False, "d": "y", "e": "z", "f": None, "g": -(2**63)},
        ]
    )
    assert reason == ""
    assert {name: (column.dtype.kind, column.tolist()) for name, column in columns.items()} == {
        TIME: ("i", [10, 20]),
        "a": ("i", [1, -2]),
        "b": ("f", [1.0, 0.5]),
        "c": ("b", [True, False]),
        "d": ("O", ["x", "y"]),
        "e": ("O", ["1", "z"]),
        "f": ("O", [None, None]),
        "g": ("O", [str(2**63), str(-(2**63))]),
    }
    assert table([{"g": 2**63 - 1}, {"g": -(2**63)}])[0]["g"].dtype == np.int64


def test_where_a_message_has_no_such_value_stands_none():
    columns, _ = table([{"first": 1, "all": 1}, {"all": 2, "late": 0.5}, {"all": 3, "first": 4}])
    assert {name: column.tolist() for name, column in columns.items()} == {
        TIME: [10, 20, 30],
        "first": [1, None, 4],
        "all": [1, 2, 3],
        "late": [None, 0.5, None],
    }
    assert columns["first"].dtype == object and columns["all"].dtype == np.int64


def test_paths_are_names_and_lists_of_many_entries_are_one_text():
    columns, _ = table([{"pose": {"at": [1, [2, 3]]}, "many": [*range(65)], "few": [*range(64)], TIME: 7, "": 5}])
    assert columns["pose.at[0]"].tolist() == [1] and columns["pose.at[1][1]"].tolist() == [3]
    assert columns["many"].tolist() == [json.dumps([*range(65)])]
    assert columns["few[63]"].tolist() == [63] and "few" not in columns
    assert columns[TIME].tolist() == [10] and columns[f"message {TIME}"].tolist() == [7]


@pytest.mark.parametrize(
    ("stamp", "column"),
    [
        ({"sec": 3, "nanosec": 4}, {"stamp [ns]": 3_000_000_004}),
        ({"seconds": "3", "nanos": 4}, {"stamp [ns]": 3_000_000_004}),
        ({"secs": 3, "nsecs": 4}, {"stamp [ns]": 3_000_000_004}),
        ({"nsec": 4, "sec": 3}, {"stamp [ns]": 3_000_000_004}),
        ({"sec": 3, "nanosec": 0.5}, {"stamp.sec": 3, "stamp.nanosec": 0.5}),
        ({"sec": 3}, {"stamp.sec": 3}),
    ],
)
def test_a_time_stamp_is_one_column(stamp, column):
    columns, _ = table([{"stamp": stamp}])
    assert {name: values.tolist()[0] for name, values in columns.items() if name != TIME} == column


@pytest.mark.parametrize("kind", ["json", "protobuf"])
def test_joints_have_columns_of_their_own(kind):
    said = [Said(5 * 10**9 + 1, 7, {"shoulder": 0.5, "elbow": -0.25}), Said(5 * 10**9 + 2, 8, {"elbow": 2.0})]
    with McapLog("a.mcap", data=made_logs.mcap(said, kind)) as log:
        columns, reason = topic_table(log, "/joint_states")
    assert reason == "" and columns[TIME].tolist() == [7, 8]
    assert columns["shoulder position"].tolist() == [0.5, None] and columns["elbow position"].tolist() == [-0.25, 2.0]
    (stamp,) = (name for name in columns if name.endswith("stamp [ns]"))
    assert columns[stamp].tolist() == [5 * 10**9 + 1, 5 * 10**9 + 2]


def test_lists_of_another_length_than_the_names_stay_lists():
    """Such as the efforts of these messages."""
    with McapLog("a.mcap", data=made_logs.mcap([Said(5, 7, {"shoulder": 0.5, "elbow": -0.25})], "cdr")) as log:
        columns, _ = topic_table(log, "/joint_states")
    found = {name: values.tolist()[0] for name, values in columns.items() if name not in (TIME, "header.frame_id")}
    names = {"name[0]": "shoulder", "name[1]": "elbow"}
    assert found == {"header.stamp [ns]": 5, **names, "position[0]": 0.5, "position[1]": -0.25, "effort[0]": 0.5}


@pytest.mark.parametrize(
    "message",
    [
        {"name": ["a", "b"], "position": [1.0]},
        {"name": ["a"], "velocity": [1.0]},
        {"name": "a", "position": [1.0]},
        {"joints": [{"position": 1.0}]},
        {"joints": []},
        {"joints": [{"name": 3}]},
    ],
)
def test_what_only_looks_like_joint_states_is_taken_as_it_is(message):
    assert not any(" " in name for name in table([message])[0] if name != TIME)


def test_messages_are_in_the_order_of_time():
    made = made_logs.mcap_of(
        [(k % 2, time, b"%d" % time) for k, time in enumerate((30, 10, 20))], "json", "Any", "jsonschema", b"{}"
    )
    with McapLog("a.mcap", data=made) as log:
        columns, _ = topic_table(log, "/joint_states")
    assert columns[TIME].tolist() == columns["value"].tolist() == [10, 20, 30]


def test_messages_that_cannot_be_taken_apart_are_bytes_and_why_is_told(monkeypatch):
    monkeypatch.setattr(limits, "MESSAGE", 8)
    assert table([{"a": 1}])[1] == ""
    monkeypatch.setattr(limits, "MESSAGE", 7)
    columns, reason = table([{"a": 1}, {"a": 22}])
    assert reason == "a message has 8 bytes; at most 7 are taken apart"
    assert columns["data"].tolist() == [b'{"a": 1}'.hex(), b'{"a": 22}'.hex()]
    monkeypatch.undo()
    columns, reason = table([b"\x01" * 256, b"\x02" * 257], kind=("cbor", "Any", "", b""))
    assert reason == "messages as cbor with such a schema are not decoded"
    assert columns["data"][0] == "01" * 256 and columns["data"][1].startswith("257 bytes, sha256 ")


def test_a_table_has_as_many_cells_as_are_kept_and_not_one_more(monkeypatch):
    rows = [{"a": 1, "b": 2}, {"a": 3, "b": 4}]
    monkeypatch.setattr(limits, "CELLS", 6)
    assert table(rows)[1] == ""
    monkeypatch.setattr(limits, "CELLS", 5)
    assert "more than" in table(rows)[1]
    monkeypatch.undo()
    monkeypatch.setattr(limits, "COLUMNS", 3)
    assert table(rows)[1] == ""
    monkeypatch.setattr(limits, "COLUMNS", 2)
    assert "more than 2 columns" in table(rows)[1]
