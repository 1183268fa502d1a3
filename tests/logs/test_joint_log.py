"""What a log of messages says of a joint: which channels are read, when, and which publishers take turns."""

import numpy as np
import pytest

from replay.errors import RecordingError
from replay.logs.joint_log import EPOCH, Choice, Series, _joined, leading_zeros, read_messages
from replay.logs.message_log import open_message_log
from replay.logs.times import MAX_TIME
from tests.logs import made_logs
from tests.logs.made_logs import Said

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


def read(said, kind="cdr", **choice):
    return read_messages("log.mcap", open_message_log("log.mcap", made_logs.mcap(said, kind)), Choice(**choice))


SAID = [Said(10 * k, 10 * k, {"a": float(k)}, channel=k % 2) for k in range(1, 7)]


def test_all_channels_of_a_topic_are_read_or_the_one_that_is_chosen():
    assert sorted(read(SAID).joints["a"].value.tolist()) == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    odd, even = (read(SAID, channel=number).joints["a"].value.tolist() for number in (2, 1))
    assert odd == [1.0, 3.0, 5.0] and even == [2.0, 4.0, 6.0]
    with pytest.raises(RecordingError, match="has no channel 3 on that topic; its channels are 1, 2"):
        read(SAID, channel=3)
    with pytest.raises(RecordingError, match=r"has no topic '/other'; its topics are \['/joint_states'\]"):
        read(SAID, topic="/other")


def test_of_frame_ids_the_one_that_is_wanted_is_read():
    said = [Said(10 * k, 10 * k, {"a": float(k)}, frame_id="xy"[k % 2]) for k in range(1, 5)]
    assert read(said, frame_id="x").joints["a"].value.tolist() == [2.0, 4.0]
    with pytest.raises(
        RecordingError, match="no message with positions of joints on topic '/joint_states' with frame_id 'z'"
    ):
        read(said, frame_id="z")


def test_begin_end_and_anchor_are_those_of_the_stamps():
    said = [Said(stamp, 100 + k, {"a": 1.0 * k}) for k, stamp in enumerate((30, 20, 50, 40))]
    log = read(said)
    assert (log.begin, log.end, log.left_out, log.published) == (20, 50, 0, True)
    assert log.anchor == (1, 0, 2)  # rows: the first sample, one that is later, the last sample
    late = read([Said(0, 7, {"a": 1.0}), Said(0, 9, {"a": 2.0})])
    assert (late.begin, late.end) == (7, 9)  # without any stamp, log times


@pytest.mark.parametrize(("time", "works"), [(MAX_TIME, True), (MAX_TIME + 1, False)])
def test_times_are_read_up_to_146_years(time, works):
    said = [Said(0, 1, {"a": 1.0}), Said(0, time, {"a": 2.0})]
    if works:
        assert read(said, "json", max_gap=2**63).end == MAX_TIME
    else:
        with pytest.raises(RecordingError, match="times are read up to 146 years"):
            read(said, "json", max_gap=2**63)


@pytest.mark.parametrize(
    ("stamps", "zeros"),
    [
        ([0, 0, EPOCH, EPOCH + 1], 2),
        ([0, 5, 6], 0),
        ([0, 11, 12, 13], 1),  # more than a gap away, and ten times as far as the others from each other
        ([0, 11, 12], 0),  # of two nobody knows how far they are from each other
        ([0, 11, 22, 33], 0),
        ([0, 110, 121, 132], 0),
        ([0, 111, 122, 133], 1),
        ([0, 0, 0], 0),
        ([7, 0, 8], 0),
        ([], 0),
    ],
)
def test_first_stamps_are_no_times_when_the_clock_was_not_there_yet(stamps, zeros):
    assert leading_zeros(stamps, 10) == zeros


@pytest.mark.parametrize(
    ("encoding", "language", "told"),
    [
        ("protobuf", "protobuf", "holds a.B as protobuf with a schema in protobuf; read are"),
        ("cdr", "ros2msg", "holds a.B as cdr with a schema in ros2msg; read are"),
        ("", "", "holds a.B as bytes; read are"),
    ],
)
def test_messages_of_another_kind_are_told_with_how_they_are_written(encoding, language, told):
    data = made_logs.mcap_of([(0, 10, b"")], encoding, "a.B", language, b"")
    with pytest.raises(RecordingError, match=told):
        read_messages("log.mcap", open_message_log("log.mcap", data), Choice())
