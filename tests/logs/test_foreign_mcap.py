"""Whatever the MCAP format allows is read: the conformance files of foxglove/mcap, and files of their kinds."""

from __future__ import annotations

import itertools
import json
import struct
import zipfile
from pathlib import Path

import pytest

from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import MAGIC, Op
from tests.logs import mcap_bytes
from tests.logs.mcap_bytes import FEATURES, Stored, build

CONFORMANCE = Path(__file__).parents[3] / "shared" / "mcap_conformance.zip"

STORED = Stored(
    schemas={1: ("Example", "c", b"\4\5\6"), 7: ("Other", "", b"")},
    channels={1: (1, "example", "a"), 2: (0, "bare", ""), 9: (7, "other", "json")},
    messages=[(1, 4, b"abc"), (2, 1, b""), (1, 3, b"defg"), (1, 9, b"hij"), (9, 9, b"{}"), (2, 8, b"x")],
    attachments={"file": b"123", "empty": b""},
    metadata={"first": ("k", "v"), "second": ("", "")},
)


def found_in(log: McapLog) -> Stored:
    """Return what the reader finds, messages channel by channel in the order of the file."""
    messages = [
        (run.channel, time, data)
        for chunk in log.chunks
        for run in log.runs(chunk)
        for time, data in zip(run.time.tolist(), run.messages(), strict=True)
    ]
    return Stored(
        schemas={k: (s.name, s.encoding, s.data) for k, s in log.schemas.items()},
        channels={k: (c.schema_id, c.topic, c.encoding) for k, c in log.channels.items()},
        messages=sorted(messages, key=lambda message: message[0]),
        attachments={a.name: log.attachment(a) for a in log.attachments},
        metadata={name: next(iter(values.items())) for name, values in log.metadata},
    )


@pytest.mark.parametrize("salvage", [False, True])
def test_every_choice_that_the_format_leaves_is_read(salvage: bool) -> None:
    for count in range(len(FEATURES) + 1):
        for features in itertools.combinations(FEATURES, count):
            data = build(STORED, features)
            with McapLog("made.mcap", data=data, salvage=salvage) as log:
                assert log.loss is None, features
                found = found_in(log)
                assert log.count_of(1) == (3 if "counts" in features else None)
            assert found.messages == sorted(STORED.messages, key=lambda message: message[0]), features
            assert (found.attachments, found.metadata) == (STORED.attachments, STORED.metadata), features
            assert (found.schemas, found.channels) == (STORED.schemas, STORED.channels), features


@pytest.mark.parametrize("features", [(), ("chunks",), ("chunks", "indexes", "pad"), FEATURES])
def test_what_comes_before_a_cut_is_salvaged_and_true(features: tuple[str, ...]) -> None:
    whole = build(STORED, features)
    for size in range(40, len(whole), 3):
        with McapLog("cut.mcap", data=whole[:size], salvage=True) as log:
            assert log.loss is not None
            found = found_in(log)
        for number in STORED.channels:
            kept = [message for message in found.messages if message[0] == number]
            assert kept == [message for message in STORED.messages if message[0] == number][: len(kept)]
        with pytest.raises(RecordingError, match=r"cut at byte|end is missing"):
            McapLog("cut.mcap", data=whole[:size])


def test_a_flipped_bit_that_a_checksum_covers_is_damage() -> None:
    whole = build(STORED, FEATURES)
    for at in range(len(whole)):
        wound = bytearray(whole)
        wound[at] ^= 1 << at % 8
        try:
            with McapLog("flipped.mcap", data=bytes(wound)) as log:
                found = found_in(log)
        except RecordingError:
            continue
        assert found.messages == sorted(STORED.messages, key=lambda message: message[0]), at  # PAD of the footer


def test_a_gap_of_zeros_and_a_missing_schema_are_damage() -> None:
    head = MAGIC + mcap_bytes.record(Op.HEADER, mcap_bytes.text("") + mcap_bytes.text("test"))
    with pytest.raises(RecordingError, match="of no kind"):
        McapLog("zeros.mcap", data=head + bytes(900))
    lost = Stored({}, {1: (5, "topic", "")}, [(1, 1, b"x")], {}, {})
    with pytest.raises(RecordingError, match="'topic' refers to a schema that is not there"):
        McapLog("lost.mcap", data=build(lost, ("chunks", "channels again")))
    late = Stored({}, {1: (0, "topic", "")}, [(1, 2**63, b"x")], {}, {})
    with McapLog("late.mcap", data=build(late, ())) as log, pytest.raises(RecordingError, match="2262"):
        found_in(log)


def test_counts_that_do_not_say_of_which_channel_are_no_counts() -> None:
    data = bytearray(build(STORED, ("chunks", "channels again", "schemas again")))
    footer = data.rindex(struct.pack("<BQ", Op.FOOTER, 20))
    statistics = struct.pack("<QHIIIIQQ", 6, 0, 0, 0, 0, 0, 0, 0) + struct.pack("<I", 0)  # an empty map: not available
    data[footer:footer] = mcap_bytes.record(Op.STATISTICS, statistics)
    with McapLog("counts.mcap", data=bytes(data)) as log:
        assert log.count_of(1) is None
        assert len(found_in(log).messages) == 6


@pytest.mark.skipif(
    not CONFORMANCE.is_file(), reason="the conformance files of foxglove/mcap lie not beside the project"
)
@pytest.mark.parametrize("salvage", [False, True])
def test_conformance_files_are_read_as_their_json_says(salvage: bool) -> None:
    with zipfile.ZipFile(CONFORMANCE) as archive:
        names = [name for name in archive.namelist() if name.endswith(".mcap")]
        assert len(names) == 416
        for name in names:
            expected = json.loads(archive.read(name.removesuffix(".mcap") + ".json"))["records"]
            records = [(entry["type"], dict(entry["fields"])) for entry in expected]
            with McapLog(name, data=archive.read(name), salvage=salvage) as log:
                assert log.loss is None, name
                found = found_in(log)
                counts = log.message_counts
            of = lambda kind: [fields for type_, fields in records if type_ == kind]  # noqa: B023, E731
            data = lambda fields: bytes(map(int, fields["data"]))  # noqa: E731
            assert found.schemas == {int(f["id"]): (f["name"], f["encoding"], data(f)) for f in of("Schema")}, name
            channels = {int(f["id"]): (int(f["schema_id"]), f["topic"], f["message_encoding"]) for f in of("Channel")}
            assert found.channels == channels, name
            messages = [(int(f["channel_id"]), int(f["log_time"]), data(f)) for f in of("Message")]
            assert found.messages == messages, name
            assert found.attachments == {f["name"]: data(f) for f in of("Attachment")}, name
            assert found.metadata == {f["name"]: next(iter(f["metadata"].items())) for f in of("Metadata")}, name
            for statistics in of("Statistics"):
                assert counts == {int(k): int(n) for k, n in statistics["channel_message_counts"].items()}, name


def test_statistics_that_claim_more_than_a_file_can_hold_are_damage() -> None:
    data = bytearray(build(STORED, ("chunks", "counts", "schemas again", "channels again")))
    claimed = data.rindex(struct.pack("<HQ", 1, 3)) + 2
    data[claimed : claimed + 8] = struct.pack("<Q", 10**12)
    with McapLog("claims.mcap", data=bytes(data)) as log, pytest.raises(RecordingError, match="more than it holds"):
        log.count_of(1)
