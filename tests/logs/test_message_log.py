"""Bags and folders of bags as logs of messages: what is damaged is told, in one line, and never a crash."""

import io
import itertools

import numpy as np
import pytest

from replay.errors import RecordingError
from replay.logs.joint_log import Choice, read_messages
from replay.logs.mcap_records import Schema
from replay.logs.mcap_writer import McapFileWriter
from replay.logs.message_log import open_bag_folder, open_message_log
from tests.logs import made_logs
from tests.logs.made_logs import Said

SAID = [Said(10**18 + k * 10**7, 10**18 + k * 10**7, {"a": 0.1 * k, "b": 1.0}) for k in range(1, 40)]


@pytest.fixture(scope="module")
def bags(tmp_path_factory):
    folder = tmp_path_factory.mktemp("bags")
    return {
        "made.bag": made_logs.bag(folder, SAID),
        "packed.bag": made_logs.bag(folder, SAID, "LZ4"),
        "made.db3": made_logs.db3(SAID),
    }


def positions(log):
    joints = read_messages("made", log, Choice()).joints
    return {name: series.value.tolist() for name, series in joints.items()}


TRUTH = {"a": [0.1 * k for k in range(1, 40)], "b": [1.0] * 39}


@pytest.mark.parametrize("name", ["made.bag", "packed.bag", "made.db3"])
def test_a_damaged_or_cut_bag_is_told_in_one_line(bags, name):
    whole = bags[name]
    assert positions(open_message_log(name, whole)) == TRUTH
    rng = np.random.default_rng(5)
    changed = [whole[: int(k)] for k in rng.integers(20, len(whole), 60)]
    for _ in range(200):
        data = bytearray(whole)
        data[int(rng.integers(13, len(data)))] ^= 1 << int(rng.integers(8))
        changed.append(bytes(data))
    refused = 0
    for data in changed:
        try:
            positions(open_message_log(name, data))  # bags have no checksums: another number may be read
        except RecordingError as error:
            refused += 1
            assert "\n" not in str(error)
            assert str(error).startswith(("made", name))
    assert refused > 60


def test_a_bag_that_nobody_closed_says_so(bags):
    data = bags["made.bag"]
    at = data.index(b"index_pos=") + len(b"index_pos=")
    with pytest.raises(RecordingError, match="not indexed, reindex"):
        open_message_log("made.bag", data[:at] + bytes(8) + data[at + 8 :])


@pytest.mark.parametrize("kind", ["db3", "mcap", "db3, packed by file", "db3, packed by message"])
def test_a_split_bag_is_one_log(kind):
    files = made_logs.bag_folder(SAID, kind)
    log, read = open_bag_folder("drive", files.__getitem__)
    assert read == files
    assert positions(log) == TRUTH
    assert len([c for c in log.channels.values() if c.topic == "/joint_states"]) == 1


def test_channels_that_have_another_id_in_the_next_file_are_the_same():
    """A recorder that is split numbers its channels anew in each file."""
    parts = [made_logs.mcap([Said(s.stamp, s.time, s.joints) for s in half]) for half in (SAID[:20], SAID[20:])]
    camera = made_logs.mcap_of([(0, 1, b"{}")], "json", "Image", "jsonschema", b"{}", topic="/camera")
    log, _ = open_bag_folder("drive", {"metadata.yaml": LISTED, "a": parts[0], "b": camera, "c": parts[1]}.__getitem__)
    assert sorted(channel.topic for channel in log.channels.values()) == ["/camera", "/joint_states"]
    assert positions(log) == TRUTH


@pytest.mark.parametrize("number", [0, 1, 7])
def test_a_topic_without_a_schema_has_none_in_a_split_bag_either(number):
    """Whatever numbers channels have, it must get no other topic's schema."""

    def part(time, schema=None):
        stream = io.BytesIO()
        writer = McapFileWriter(stream, "made")
        known = writer.schema(schema) if schema else 0
        writer.channel("/typed" if schema else "/note", known, encoding="json", number=number)
        writer.end_preamble()
        writer.messages(number, [time], [0], [b'{"a": 1}'])
        writer.finish()
        return stream.getvalue()

    schema = Schema("Any", "jsonschema", b"{}")
    for parts in itertools.permutations((part(1), part(2), part(3, schema))):
        files = {"metadata.yaml": LISTED, **dict(zip("abc", parts, strict=True))}
        log, _ = open_bag_folder("drive", files.__getitem__)
        assert len(log.channels) == 2
        schemas = {channel.topic: log.schema(channel) for channel in log.channels.values()}
        assert schemas == {"/typed": schema, "/note": None}


LISTED = b"rosbag2_bagfile_information:\n  relative_file_paths: [a, ../drive/b, c]\n"


@pytest.mark.parametrize(
    ("metadata", "message"),
    [
        (b"", "not that of a ROS 2 bag"),
        (b"\xff", "not that of a ROS 2 bag"),
        (b"{", "not that of a ROS 2 bag"),
        (b"rosbag2_bagfile_information: 3", "not that of a ROS 2 bag"),
        (b"rosbag2_bagfile_information: {relative_file_paths: []}", "lists no files"),
        (b"rosbag2_bagfile_information: {relative_file_paths: [a]}", "begins neither as an MCAP file nor as a ROS bag"),
        (b"rosbag2_bagfile_information: {relative_file_paths: [b]}", "cannot be unpacked"),
    ],
)
def test_a_folder_that_is_no_bag_is_told(metadata, message):
    files = {"metadata.yaml": metadata, "a": b"nothing", "b": b"\x28\xb5\x2f\xfd nothing"}
    with pytest.raises(RecordingError, match=message):
        open_bag_folder("drive", files.__getitem__)
