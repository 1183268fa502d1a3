"""What a written file says of itself, read by the `mcap` library: times, counts and places of every chunk."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import mcap.records
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader, get_chunk_data_stream

from replay.errors import InvalidValue
from replay.logs import mcap_writer
from replay.logs.mcap_records import MAX_RECORD, Schema
from replay.logs.mcap_writer import McapFileWriter, MessageRows

TIMES = {1: [30, 70, 50], 2: [10, 20], 3: [65, 90, 80, 40]}
"""Log times by channel: neither of one channel nor of all of them in order, and the last chunk ends first."""
ORDER = (3, 1, 2)


def written(times: dict[int, Sequence[int]] = TIMES, *, as_rows: bool) -> bytes:
    """Return a file with one chunk a channel, the messages of equal length or of changing length."""
    out = io.BytesIO()
    writer = McapFileWriter(out, "test")
    writer.metadata("note", {"b": "2", "a": "1"})
    writer.attachment("a.txt", "text/plain", b"attached")
    schema = writer.schema(Schema("made.Up", "protobuf", b"schema"))
    for number in times:
        assert writer.channel(f"/{number}", schema) == number
    writer.end_preamble()
    for number in ORDER if set(times) == set(ORDER) else times:
        stamps = times[number]
        if as_rows:
            rows = MessageRows(number, np.array(stamps, dtype=np.int64), 5, 4)
            rows.data[:] = np.arange(4 * len(stamps), dtype=np.uint8).reshape(-1, 4)
            writer.rows(rows)
        else:
            data = [bytes(range(k + number)) for k in range(len(stamps))]
            writer.messages(number, stamps, range(5, 5 + len(stamps)), data)
    writer.finish()
    return out.getvalue()


@pytest.mark.parametrize("as_rows", [True, False])
def test_times_of_chunks_and_of_the_whole_are_those_of_their_messages(as_rows: bool) -> None:
    data = written(as_rows=as_rows)
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None and summary.statistics is not None
    spans = [(min(TIMES[k]), max(TIMES[k])) for k in ORDER]
    assert [(one.message_start_time, one.message_end_time) for one in summary.chunk_indexes] == spans
    found = list(StreamReader(io.BytesIO(data), emit_chunks=True).records)
    chunks = [record for record in found if isinstance(record, mcap.records.Chunk)]
    assert [(one.message_start_time, one.message_end_time) for one in chunks] == spans
    told = summary.statistics
    assert (told.message_start_time, told.message_end_time) == (10, 90)
    assert told.channel_message_counts == {k: len(stamps) for k, stamps in TIMES.items()}
    counts = (told.message_count, told.chunk_count, told.channel_count, told.schema_count)
    assert (counts, told.attachment_count, told.metadata_count) == ((9, 3, 3, 1), 1, 2)


def test_who_reads_from_the_beginning_knows_schemas_and_channels_before_they_are_needed() -> None:
    """Without the summary, as of a file that was cut; each stands there once more, in the summary."""
    known: dict[type, list[Any]] = {}
    for record in StreamReader(io.BytesIO(written(as_rows=True)), emit_chunks=True).records:
        if isinstance(record, mcap.records.Chunk) and not known.get(mcap.records.Chunk):
            schemas, channels = known[mcap.records.Schema], known[mcap.records.Channel]
            assert [(one.id, one.name, one.encoding, one.data) for one in schemas] == [
                (1, "made.Up", "protobuf", b"schema")
            ]
            assert [(one.id, one.topic, one.schema_id) for one in channels] == [
                (1, "/1", 1),
                (2, "/2", 1),
                (3, "/3", 1),
            ]
            assert len(known[mcap.records.Metadata]) == 2 and len(known[mcap.records.Attachment]) == 1
        known.setdefault(type(record), []).append(record)
    assert len(known[mcap.records.Schema]) == 2 and len(known[mcap.records.Channel]) == 6


def record_at(data: bytes, offset: int) -> Any:
    return next(StreamReader(io.BytesIO(data[offset:]), skip_magic=True, emit_chunks=True).records)


@pytest.mark.parametrize("as_rows", [True, False])
def test_each_message_lies_where_the_indexes_say_with_its_time_and_number(as_rows: bool) -> None:
    data = written(as_rows=as_rows)
    summary = make_reader(io.BytesIO(data)).get_summary()
    assert summary is not None
    for chunk, number in zip(summary.chunk_indexes, ORDER, strict=True):
        packed = record_at(data, chunk.chunk_start_offset)
        assert packed.uncompressed_size == chunk.uncompressed_size and len(packed.data) == chunk.compressed_size
        body = get_chunk_data_stream(packed, validate_crc=True)[0].read(chunk.uncompressed_size)
        place = chunk.message_index_offsets[number]
        assert place == chunk.chunk_start_offset + chunk.chunk_length
        index = record_at(data, place)
        assert index.channel_id == number and [stamp for stamp, _ in index.records] == TIMES[number]
        for k, (stamp, offset) in enumerate(index.records):
            message = record_at(body, offset)
            assert (message.channel_id, message.sequence) == (number, 5 + k)
            assert message.log_time == message.publish_time == stamp
    (attached,) = summary.attachment_indexes
    assert (attached.name, attached.media_type, attached.data_size) == ("a.txt", "text/plain", 8)
    assert [one.name for one in summary.metadata_indexes] == ["note", "preamble"]
    for one in (*summary.metadata_indexes, attached):
        assert record_at(data, one.offset).name == one.name
        assert int.from_bytes(data[one.offset + 1 : one.offset + 9], "little") == one.length - 9


def test_a_file_without_messages_has_no_time() -> None:
    summary = make_reader(io.BytesIO(written({}, as_rows=True))).get_summary()
    assert summary is not None and summary.statistics is not None
    assert (summary.statistics.message_start_time, summary.statistics.message_end_time) == (0, 0)


def test_a_block_is_cut_where_a_chunk_is_full_and_no_message_is_lost(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(mcap_writer, "_CHUNK_BYTES", 3 * (31 + 4))
    times = {1: list(range(7))}
    reader = make_reader(io.BytesIO(written(times, as_rows=True)))
    summary = reader.get_summary()
    assert summary is not None
    spans = [(one.message_start_time, one.message_end_time) for one in summary.chunk_indexes]
    assert spans == [(0, 2), (3, 5), (6, 6)]
    messages = [message for _, _, message in reader.iter_messages()]
    assert [message.log_time for message in messages] == times[1]
    assert [message.data for message in messages] == [bytes(range(4 * k, 4 * k + 4)) for k in range(7)]


def test_what_readers_would_refuse_is_not_written() -> None:
    class Endless(bytes):
        def __len__(self) -> int:
            return MAX_RECORD - 4095

    with pytest.raises(InvalidValue, match=r"size of a\.bin"):
        McapFileWriter(io.BytesIO(), "test").attachment("a.bin", "", Endless())


@pytest.mark.parametrize(
    ("times", "numbers", "data"), [([1, 2], [1], [b"a", b"b"]), ([1], [1, 2], [b"a"]), ([1], [1], [b"a", b"b"])]
)
def test_no_message_is_lost_where_times_numbers_and_data_do_not_match(times, numbers, data) -> None:
    writer = McapFileWriter(io.BytesIO(), "test")
    channel = writer.channel("/a", writer.schema(Schema("a", "protobuf", b"")))
    with pytest.raises(ValueError):
        writer.messages(channel, times, numbers, data)
