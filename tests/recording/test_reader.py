"""Recordings whose topics do not belong together: refused by name, whatever their checksums say."""

from __future__ import annotations

import io
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer

from replay.errors import RecordingError
from replay.recording.reader import read
from tests.comparison import edited
from tests.recording.test_round_trip import write

FRAMES = 300
TOPICS = ("/tf", "/collision", "/distance/left", "/distance/right ä", "/capacitive/guard")


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write(tmp_path_factory.mktemp("reader") / "made_up.mcap", FRAMES)


def with_times(source: Path, target: Path, change: Callable[[str, int], int | None]) -> Path:
    """Write a recording again by the `mcap` library; `change` gives each message its time, or None to leave it out."""
    reader, out = make_reader(io.BytesIO(source.read_bytes())), io.BytesIO()
    writer = Writer(out)
    writer.start(library="test")
    for found in reader.iter_attachments():
        writer.add_attachment(0, 0, found.name, found.media_type, found.data)
    numbers: dict[str, int] = {}
    for schema, channel, message in reader.iter_messages():
        assert schema is not None
        if channel.topic not in numbers:
            kind = writer.register_schema(schema.name, schema.encoding, schema.data)
            numbers[channel.topic] = writer.register_channel(channel.topic, channel.message_encoding, kind)
        time = change(channel.topic, message.log_time)
        if time is not None:
            writer.add_message(numbers[channel.topic], time, message.data, time, message.sequence)
    for metadata in reader.iter_metadata():
        writer.add_metadata(metadata.name, metadata.metadata)
    writer.finish()
    target.write_bytes(out.getvalue())
    return target


def test_a_recording_written_again_is_read(whole: Path, tmp_path: Path) -> None:
    again = read(with_times(whole, tmp_path / "again.mcap", lambda topic, time: time))
    assert np.array_equal(again.time, read(whole).time)


@pytest.mark.parametrize("topic", TOPICS)
@pytest.mark.parametrize("frame", [0, 150, FRAMES - 1])
def test_a_topic_with_another_time_or_without_one_has_other_frames(
    whole: Path, tmp_path: Path, topic: str, frame: int
) -> None:
    at = int(read(whole, topics=[]).time[frame])

    def later(name: str, time: int) -> int:
        return time + 1 if name == topic and time == at else time

    def left_out(name: str, time: int) -> int | None:
        return None if name == topic and time == at else time

    for change in (later, left_out):
        path = with_times(whole, tmp_path / "other.mcap", change)
        for topics in (None, [topic]):
            with pytest.raises(RecordingError, match=f"topic '{topic}' has other frames than /joint_states"):
                read(path, topics=topics)
        read(path, topics=[])  # the others are whole


def test_one_frame_less_in_all_topics_or_two_at_one_time_is_damage(whole: Path, tmp_path: Path) -> None:
    first, second = read(whole, topics=[]).time[:2].tolist()
    fewer = with_times(whole, tmp_path / "fewer.mcap", lambda topic, time: time if time != second else None)
    with pytest.raises(RecordingError, match=f"it holds {FRAMES - 1} frames, its scenario has {FRAMES}"):
        read(fewer)
    twice = with_times(whole, tmp_path / "twice.mcap", lambda topic, time: first if time == second else time)
    with pytest.raises(RecordingError, match="its frames are not in the order of time"):
        read(twice)


@pytest.mark.parametrize(
    ("names", "topic"),
    [("links", "/tf"), ("joints", "/joint_states")],
)
@pytest.mark.parametrize("which", [0, -1])
def test_names_in_a_topic_are_those_of_the_metadata(
    whole: Path, tmp_path: Path, names: str, topic: str, which: int
) -> None:
    def rename(known: dict[str, Any]) -> None:
        known["layout"][names][which] += "_2"

    path = edited.write(whole, tmp_path / "renamed.mcap", provenance=rename)
    with pytest.raises(RecordingError, match=f"the names in topic '{topic}' are not those of its metadata"):
        read(path)


def test_a_cut_recording_whose_beginning_was_damaged_keeps_nothing(whole: Path, tmp_path: Path) -> None:
    """The checksum of the whole comes last in a file, so a cut one has that of its beginning alone."""
    data = whole.read_bytes()
    cut = data[: len(data) * 19 // 20]
    path = tmp_path / "cut.mcap"
    path.write_bytes(cut)
    assert len(read(path, salvage=True).time) == 256
    for word in (b"rotation", b"patient", b"arm/beam"):
        at = cut.index(word) + 2
        path.write_bytes(cut[:at] + bytes([cut[at] ^ 1]) + cut[at + 1 :])
        with pytest.raises(RecordingError, match="nothing can be salvaged"):
            read(path, salvage=True)
