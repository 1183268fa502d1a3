"""MCAP files written column-wise: a chunk is the messages of one channel in one block, made by NumPy.

The library's writer takes one message at a time, about 20 us each; here a block of messages is one array of bytes and
costs what its compression costs. All other records are the library's. The bytes depend on nothing but the arguments.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from typing import Protocol

import mcap.records
import numpy as np
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from numpy.typing import NDArray

from replay.errors import InvalidValue
from replay.logs.mcap_records import MAGIC, MAX_CHUNK, MAX_RECORD, MESSAGE_HEAD, PREAMBLE, RECORD_HEAD, Op, Schema
from replay.numerics.arrays import Integers

_ZSTD_LEVEL = 3
_CHUNK_BYTES = 1 << 26  # beyond, a block of one topic is cut into several chunks: readers hold a chunk in memory


class Sink(Protocol):
    """Where the bytes go."""

    def write(self, data: bytes | memoryview, /) -> object:
        """Append bytes."""


def rows_of_chunk(length: int) -> int:
    """Return how many messages of a length one chunk takes."""
    return max(1, _CHUNK_BYTES // (RECORD_HEAD + MESSAGE_HEAD + length))


class MessageRows:
    """The message records of one channel in one block, of equal length, as rows of bytes.

    Attributes:
        data: (n, length) the messages' own bytes, to be filled by the caller.
    """

    def __init__(self, channel: int, time: Integers, first_sequence: int, length: int) -> None:
        """Make n records for messages at `time` [ns], numbered from `first_sequence` on."""
        n = len(time)
        self.channel = channel
        self.time = time
        self.records = np.empty((n, RECORD_HEAD + MESSAGE_HEAD + length), dtype=np.uint8)
        head = np.frombuffer(struct.pack("<BQH", Op.MESSAGE, MESSAGE_HEAD + length, channel), dtype=np.uint8)
        self.records[:, :11] = head
        sequence = np.arange(first_sequence, first_sequence + n).astype("<u4")
        self.records[:, 11:15] = sequence[:, None].view(np.uint8)
        stamp = time.astype("<u8")[:, None].view(np.uint8)
        self.records[:, 15:23] = stamp
        self.records[:, 23:31] = stamp
        self.data = self.records[:, RECORD_HEAD + MESSAGE_HEAD :]


class McapFileWriter:
    """Writes one MCAP file into a sink: `preamble` records first, then chunks, then `finish`."""

    def __init__(self, sink: Sink, library: str) -> None:
        self._sink = sink
        self._size = 0
        self._crc = 0
        self._compressor = zstandard.ZstdCompressor(level=_ZSTD_LEVEL)
        self._schemas: list[mcap.records.Schema] = []
        self._channels: list[mcap.records.Channel] = []
        self._counts: dict[int, int] = {}
        self._times: tuple[int, int] | None = None
        self._chunk_indexes: list[mcap.records.ChunkIndex] = []
        self._attachment_indexes: list[mcap.records.AttachmentIndex] = []
        self._metadata_indexes: list[mcap.records.MetadataIndex] = []
        self._put(MAGIC)
        self._put_record(mcap.records.Header(profile="", library=library))

    def metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Add a metadata record; its keys are sorted."""
        offset = self._size
        length = self._put_record(mcap.records.Metadata(name=name, metadata=dict(sorted(values.items()))))
        self._metadata_indexes.append(mcap.records.MetadataIndex(offset=offset, length=length, name=name))

    def attachment(self, name: str, media_type: str, data: bytes) -> None:
        """Add a file; InvalidValue when it is too large for a record that readers accept."""
        if len(data) > MAX_RECORD - 4096:
            raise InvalidValue(f"size of {name}", len(data), f"a file in a recording has at most {MAX_RECORD} bytes")
        offset = self._size
        record = mcap.records.Attachment(create_time=0, log_time=0, name=name, media_type=media_type, data=data)
        length = self._put_record(record)
        self._attachment_indexes.append(
            mcap.records.AttachmentIndex(
                offset=offset,
                length=length,
                log_time=0,
                create_time=0,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )

    def schema(self, schema: Schema) -> int:
        """Add a message schema and return its id."""
        number = len(self._schemas) + 1
        record = mcap.records.Schema(id=number, data=schema.data, encoding=schema.encoding, name=schema.name)
        self._schemas.append(record)
        self._put_record(record)
        return number

    def channel(self, topic: str, schema_id: int, *, encoding: str = "protobuf", number: int | None = None) -> int:
        """Add a channel of messages and return its id: `number`, or the next one."""
        number = len(self._channels) + 1 if number is None else number
        record = mcap.records.Channel(
            id=number, topic=topic, message_encoding=encoding, metadata={}, schema_id=schema_id
        )
        self._channels.append(record)
        self._put_record(record)
        return number

    def end_preamble(self) -> None:
        """Close the part before the first chunk by its checksum."""
        self.metadata(PREAMBLE, {"crc32": str(self._crc)})

    def rows(self, rows: MessageRows) -> None:
        """Write a block of messages of equal length as one chunk, or as several when it is very large."""
        n, stride = rows.records.shape
        step = rows_of_chunk(rows.data.shape[1])
        for begin in range(0, n, step):
            part = rows.records[begin : begin + step]
            offsets = np.arange(0, part.size, stride, dtype=np.uint64)
            self._chunk(rows.channel, rows.time[begin : begin + step], offsets, part.tobytes())

    def messages(self, channel: int, time: Sequence[int], sequence: Sequence[int], data: Sequence[bytes]) -> None:
        """Write messages of any length as one chunk; nothing when there are none."""
        if not data:
            return
        heads = [
            struct.pack("<BQHIQQ", Op.MESSAGE, MESSAGE_HEAD + len(content), channel, number, stamp, stamp)
            for stamp, number, content in zip(time, sequence, data, strict=True)
        ]
        records = [head + content for head, content in zip(heads, data, strict=True)]
        offsets = np.cumsum([0, *(len(record) for record in records[:-1])]).astype(np.uint64)
        self._chunk(channel, np.array(time, dtype=np.int64), offsets, b"".join(records))

    def finish(self) -> None:
        """Write the end of the data, the summary and the footer."""
        self._put_record(mcap.records.DataEnd(data_section_crc=self._crc))
        start = self._size
        groups: list[tuple[Opcode, Sequence[mcap.records.McapRecord]]] = [
            (Opcode.SCHEMA, self._schemas),
            (Opcode.CHANNEL, self._channels),
            (Opcode.STATISTICS, [self._statistics()]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.ATTACHMENT_INDEX, self._attachment_indexes),
            (Opcode.METADATA_INDEX, self._metadata_indexes),
        ]
        summary = RecordBuilder()
        offsets = []
        for opcode, records in groups:
            begin = summary.count
            for record in records:
                record.write(summary)
            if records:
                offsets.append(
                    mcap.records.SummaryOffset(
                        group_opcode=opcode, group_start=start + begin, group_length=summary.count - begin
                    )
                )
        offset_start = start + summary.count
        for offset in offsets:
            offset.write(summary)
        data: bytes = summary.end()  # type: ignore[no-untyped-call]
        footer_head = struct.pack("<BQQQ", Op.FOOTER, 20, start, offset_start)
        crc = zlib.crc32(footer_head, zlib.crc32(data))
        self._put(data)
        self._put(footer_head + struct.pack("<I", crc) + MAGIC)

    def _statistics(self) -> mcap.records.Statistics:
        start, end = self._times or (0, 0)
        return mcap.records.Statistics(
            attachment_count=len(self._attachment_indexes),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=len(self._chunk_indexes),
            message_count=sum(self._counts.values()),
            message_end_time=end,
            message_start_time=start,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )

    def _chunk(self, channel: int, time: Integers, offsets: NDArray[np.uint64], data: bytes) -> None:
        if len(data) > MAX_CHUNK:
            raise InvalidValue(
                "size of a message", len(data), f"a message in a recording has at most {MAX_CHUNK} bytes"
            )
        self.packed(channel, time, offsets, data, self._compressor.compress(data))

    def packed(self, channel: int, time: Integers, offsets: NDArray[np.uint64], data: bytes, compressed: bytes) -> None:
        """Write message records of one channel, and the same compressed by zstd, as one chunk.

        Args:
            channel: the channel's id.
            time: (n,) log times [ns].
            offsets: (n,) where each record begins in `data`.
            data: the records.
            compressed: the same as a zstd frame.
        """
        start, end = int(time.min()), int(time.max())
        at = self._size
        head = struct.pack("<QQQI", start, end, len(data), zlib.crc32(data))
        head += struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(compressed))
        self._put(struct.pack("<BQ", Op.CHUNK, len(head) + len(compressed)) + head)
        self._put(compressed)
        chunk_length = self._size - at
        index_at = self._size
        entries = np.stack([time.astype("<u8"), offsets.astype("<u8")], axis=1).tobytes()
        self._put(struct.pack("<BQHI", Op.MESSAGE_INDEX, 6 + len(entries), channel, len(entries)) + entries)
        self._chunk_indexes.append(
            mcap.records.ChunkIndex(
                chunk_length=chunk_length,
                chunk_start_offset=at,
                compression="zstd",
                compressed_size=len(compressed),
                message_end_time=end,
                message_index_length=self._size - index_at,
                message_index_offsets={channel: index_at},
                message_start_time=start,
                uncompressed_size=len(data),
            )
        )
        self._counts[channel] = self._counts.get(channel, 0) + len(time)
        first, last = self._times or (start, end)
        self._times = (min(first, start), max(last, end))

    def _put_record(self, record: mcap.records.McapRecord) -> int:
        builder = RecordBuilder()
        record.write(builder)
        data: bytes = builder.end()  # type: ignore[no-untyped-call]
        self._put(data)
        return len(data)

    def _put(self, data: bytes) -> None:
        self._crc = zlib.crc32(data, self._crc)
        self._size += len(data)
        self._sink.write(data)
