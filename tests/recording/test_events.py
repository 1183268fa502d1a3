"""Events as columns, their messages, and readings of single topics."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from replay.errors import InvalidValue, RecordingError
from replay.logs.columns import read_topics
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_writer import McapFileWriter
from replay.recording import messages
from replay.recording.event_messages import encode, read_events
from replay.recording.events import SEVERITY, Events, Transition
from replay.recording.reader import read
from tests.recording.test_round_trip import write

KINDS = ("bounds", "contact", "undecided", "detection", "too close", "saturation", "unresolved")
KINDS += ("trigger", "hold", "release", "excess acceleration")
# The last ones end in bytes that look like the field of the frame, or like the words of an event.
NAMES = ("arm/a|table/b", "left ä", "s5five", "5\x05\0\0\0", "5", "x begins: y", "")
TRANSITIONS = st.builds(Transition, st.sampled_from(KINDS), st.booleans(), st.sampled_from(NAMES), st.text(max_size=3))
FRAMES = st.one_of(st.integers(0, 300), st.sampled_from([127, 128, 16383, 16384, 2**21, 2**28, 2**32 - 1]))
TIMES = st.one_of(st.integers(0, 5 * 10**9), st.integers(0, 10**15))


def log_message(time: int, frame: int, what: Transition, earliest: int | None = None) -> bytes:
    """Return the message as the protobuf library writes it in one piece; format 1 has no `earliest`."""
    data: bytes = messages.message_class(messages.LOG)(
        timestamp={"seconds": time // 10**9, "nanos": time % 10**9},
        level=what.severity,
        message=what.text,
        name=what.subject,
        file=what.source,
        line=frame,
        earliest=earliest,
    ).SerializeToString(deterministic=True)
    return data


def test_how_severe_each_beginning_is_and_that_an_end_is_information() -> None:
    """In Foxglove's levels: 2 is information, 3 a warning, 4 an error."""
    severe = {"bounds": 3, "contact": 4, "undecided": 3, "detection": 2, "too close": 3, "saturation": 3}
    severe |= {"unresolved": 3, "trigger": 3, "hold": 3, "release": 2, "excess acceleration": 4}
    assert severe == SEVERITY and set(severe) == set(KINDS)
    for kind, level in severe.items():
        assert Transition(kind, True, "x", "/y").severity == level
        assert Transition(kind, False, "x", "/y").severity == 2


def log_file(path: Path, times: list[int], payloads: list[bytes], schema: str = messages.LOG) -> Path:
    parts: list[bytes] = []
    writer = McapFileWriter(type("Sink", (), {"write": staticmethod(lambda data: parts.append(bytes(data)))}), "test")
    channel = writer.channel("/events", writer.schema(messages.schema(schema)))
    writer.end_preamble()
    writer.messages(channel, times, [0] * len(times), payloads)
    writer.finish()
    path.write_bytes(b"".join(parts))
    return path


@given(rows=st.lists(st.tuples(TIMES, FRAMES, TRANSITIONS), max_size=12), dated=st.booleans())
def test_messages_are_those_of_the_protobuf_library_and_come_back(
    tmp_path_factory: pytest.TempPathFactory, rows: list[tuple[int, int, Transition]], dated: bool
) -> None:
    table = tuple(dict.fromkeys(what for _, _, what in rows))
    columns = [np.array([row[k] for row in rows], dtype=np.int64) for k in (0, 1)]
    earliest = columns[0] // 3 if dated or not rows else None
    codes = np.array([table.index(what) for _, _, what in rows], dtype=np.int64)
    events = Events(columns[0], columns[1], codes, table, earliest)
    encoded = encode(events)
    assert encoded == [log_message(*row, row[0] // 3 if dated else None) for row in rows]
    with McapLog(log_file(tmp_path_factory.mktemp("e") / "e.mcap", columns[0].tolist(), encoded)) as log:
        found = read_events(log)
    assert found == events and list(found) == list(events)
    assert [(e.time, e.frame, e.kind, e.begins, e.subject, e.source, e.earliest) for e in found] == [
        (time, frame, what.kind, what.begins, what.subject, what.source, time // 3 if dated else None)
        for time, frame, what in rows
    ]


def test_a_time_that_only_some_messages_have_is_damage(tmp_path: Path) -> None:
    what = Transition("contact", True, "a|b", "/collision")
    payloads = [log_message(1, 1, what, 0), log_message(2, 2, what)]
    with (
        McapLog(log_file(tmp_path / "e.mcap", [1, 2], payloads)) as log,
        pytest.raises(RecordingError, match="/events"),
    ):
        read_events(log)


def test_events_of_another_type_are_damage(tmp_path: Path) -> None:
    payload = log_message(1, 1, Transition("contact", True, "a|b", "/collision"))
    with (
        McapLog(log_file(tmp_path / "e.mcap", [1], [payload], messages.COLLISION)) as log,
        pytest.raises(RecordingError, match=r"topic '/events' does not hold foxglove\.Log"),
    ):
        read_events(log)


def test_messages_put_together_otherwise_mean_what_protobuf_says(tmp_path: Path) -> None:
    what = Transition("contact", True, "a|b", "/collision")
    plain = log_message(7, 5, what)
    log = messages.message_class(messages.LOG)
    line = log(line=9).SerializeToString()
    odd = [
        plain,
        log(line=300).SerializeToString() + plain,  # the frame twice: the last one holds
        plain + line,
        plain + log(name="c", message="contact ends: c").SerializeToString() + line,
        plain[:1] + b"\x82\x00" + plain[2:],  # a length, written longer than needed
        plain + log(timestamp={"seconds": 3}).SerializeToString(),
    ]
    with McapLog(log_file(tmp_path / "e.mcap", [7] * 6, odd)) as opened:
        events = list(read_events(opened))
    parsed = [log.FromString(data) for data in odd]
    assert [(e.frame, e.subject) for e in events] == [(m.line, m.name) for m in parsed]
    assert [e.begins for e in events] == [True, True, True, False, True, True]


@pytest.mark.parametrize(
    "payload", [b"", b"\x0a", b"\x0a\x7f", b"\xff\xff", log_message(1, 1, Transition("contact", True, "a", "b"))[:-3]]
)
def test_what_is_no_event_is_damage(tmp_path: Path, payload: bytes) -> None:
    with McapLog(log_file(tmp_path / "e.mcap", [7], [payload])) as log, pytest.raises(RecordingError, match="/events"):
        read_events(log)


def test_events_are_equal_by_what_they_mean() -> None:
    a, b = Transition("contact", True, "p", "/collision"), Transition("contact", False, "p", "/collision")
    time = np.arange(4)
    one = Events(time, time, np.array([0, 1, 0, 1]), (a, b))
    other = Events(time, time, np.array([1, 0, 1, 0]), (b, a))
    assert one == other
    assert one[1:3] == other[1:3] and list(one[::2]) == [one[0], one[2]]
    shifted = Events(time, time + 1, one.code, (a, b))
    assert one != shifted and one.count_missing_in(shifted) == 4
    assert one.count_missing_in(one[:3]) == 1 and one[:3].count_missing_in(one) == 0
    assert Events.none() == one[:0] and one != list(one)
    dated = dataclasses.replace(one, earliest=time)
    assert dated != one and dated == dataclasses.replace(one, earliest=time) and dated[1:2][0].earliest == 1


def test_frames_do_not_show_what_lies_between_them() -> None:
    a, b = Transition("contact", True, "p", "/collision"), Transition("contact", False, "p", "/collision")
    other = Transition("contact", True, "q", "/collision")
    frame = np.array([1, 1, 3, 3, 3, 3, 4])  # begins and ends before 1; begins, ends and begins before 3; ends before 4
    events = Events(10 * frame - 2, frame, np.array([0, 1, 0, 2, 1, 0, 1]), (a, b, other), 10 * frame - 3)
    time = 10 * np.arange(5)
    assert [(e.time, e.frame, e.begins, e.subject) for e in events.at_frames(time)] == [
        (30, 3, True, "p"),
        (30, 3, True, "q"),
        (40, 4, False, "p"),
    ]
    assert dataclasses.replace(events, time=events.time + 5).at_frames(time)[0].time == 33, "not before its frame"
    assert Events.none().at_frames(time) == Events.none()


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("topics") / "made_up.mcap")


def equal(a: Any, b: Any) -> bool:
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(equal(a[key], b[key]) for key in a)
    if dataclasses.is_dataclass(a):
        return all(equal(getattr(a, f.name), getattr(b, f.name)) for f in dataclasses.fields(a))
    return bool(a.tobytes() == b.tobytes() and a.shape == b.shape) if isinstance(a, np.ndarray) else bool(a == b)


def test_single_topics_are_the_same_columns(path: Path) -> None:
    whole = read(path)
    assert whole.collision is not None and whole.distance is not None and whole.capacitive is not None
    joints, events = read(path, topics=["/joint_states"]), read(path, topics=["/events"])
    assert equal(joints.joint_positions, whole.joint_positions) and joints.layout.links == ()
    assert events.events == whole.events and len(events.events) > 0 and len(joints.events) == 0
    assert events.layout.joints == () and events.joint_positions.shape == (len(whole.time), 0)
    some = read(path, topics=["/tf", "/collision", "/distance/right ä"])
    assert equal(some.link_poses, whole.link_poses) and equal(some.collision, whole.collision)
    assert some.layout.distance_sensors == ("right ä",) and some.capacitive is None
    right = whole.layout.distance_sensors.index("right ä")
    for field in dataclasses.fields(whole.distance):
        column = getattr(whole.distance, field.name)
        if column is None:  # no sensor has a signal
            assert getattr(some.distance, field.name) is None
        else:
            assert getattr(some.distance, field.name).tobytes() == column[:, right : right + 1].tobytes()
    for one in (joints, events, some, read(path, topics=[])):
        assert equal(one.time, whole.time) and one.files == whole.files
    with McapLog(path) as log:
        everything = {channel.topic for channel in log.channels.values()}
    assert equal(read(path, topics=everything), whole)
    with pytest.raises(InvalidValue, match=r"/distance/midle.*/distance/left"):
        read(path, topics=["/distance/midle"])


def test_topics_that_are_not_read_are_verified_too(path: Path, tmp_path: Path) -> None:
    with McapLog(path) as log:
        tf = next(c.id for c in log.channels.values() if c.topic == "/tf")
        (chunk, *_) = [chunk for chunk in log.chunks if chunk.channels == [tf]]
    data = bytearray(path.read_bytes())
    data[chunk.begin + chunk.compressed_size // 2] ^= 1
    (tmp_path / "flipped.mcap").write_bytes(data)
    with pytest.raises(RecordingError, match="checksum"):
        read(tmp_path / "flipped.mcap", topics=["/joint_states"])


def test_an_index_that_hides_messages_is_damage(path: Path) -> None:
    with McapLog(path) as log:
        joints = next(c.id for c in log.channels.values() if c.topic == "/joint_states")
        hidden = next(chunk for chunk in log.chunks if chunk.channels == [joints])
        hidden.channels[:] = [joints + 100]
        with pytest.raises(RecordingError, match="not as many as counted"):
            read_topics(log, {"/joint_states"})
