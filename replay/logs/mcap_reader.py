"""MCAP files opened with every checksum verified, and salvaged when they were cut.

The library's seekable reader checks chunks only: flipped bits in the rest of a file pass in silence. Here one pass
over the file checks the data section, the summary, attachments and the preamble, and a chunk is checked whenever it
is unpacked, so that damage anywhere is an error and never a different number.
"""

from __future__ import annotations

import io
import stat
import struct
import zlib
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from replay.errors import RecordingError
from replay.logs.loss import Loss
from replay.logs.mcap_chunks import Run, mixed_runs, records, regular_run, unpack
from replay.logs.mcap_records import (
    MAGIC,
    MAX_RECORD,
    MESSAGE_HEAD,
    PREAMBLE,
    RECORD_HEAD,
    Attachment,
    Channel,
    Chunk,
    Cursor,
    Op,
    Schema,
    read_attachment,
    read_channel,
    read_chunk,
    read_schema,
)


class McapLog:
    """An MCAP file whose structure and checksums hold.

    Attributes:
        path: the file.
        library: what wrote it.
        schemas: by id.
        channels: by id.
        chunks: in the order of the file.
        attachments: in the order of the file.
        metadata: name and values, in the order of the file.
        message_counts: messages by channel id as the file's statistics say, or None.
        checked: whether the file carries every checksum that the format provides for.
        loss: what was lost when the file was salvaged, else None.
    """

    def __init__(self, path: str | Path, *, salvage: bool = False, data: bytes | None = None) -> None:
        """Walk and verify a file; with `salvage`, keep everything before the first damage instead of refusing it.

        Given its bytes as `data`, the file itself is not touched; `path` is its name in messages then.

        Raises:
            RecordingError: the file cannot be read, is not an MCAP file, or is damaged or cut (without `salvage`).
        """
        self.path = Path(path)
        self.library = ""
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.chunks: list[Chunk] = []
        self.attachments: list[Attachment] = []
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.message_counts: dict[int, int] | None = None
        self.checked = True
        self.loss: Loss | None = None
        self._file = str(path)
        self._salvage = salvage
        self._hint = "" if salvage or data is not None else "; `replay info` and `replay export` salvage what is whole"
        try:
            self._size = _size_of(self.path) if data is None else len(data)
            self._stream: BinaryIO = self.path.open("rb") if data is None else io.BytesIO(data)
        except OSError as error:
            raise RecordingError(self._file, f"cannot be read: {error.strerror}") from None
        try:
            self._walk()
        except OSError as error:
            self.close()
            raise RecordingError(self._file, f"cannot be read: {error.strerror}") from None
        except BaseException:
            self.close()
            raise

    @property
    def preamble_checked(self) -> bool:
        """Whether everything before the first chunk is there and as it was written; so in any whole recording."""
        return any(name == PREAMBLE for name, _ in self.metadata)

    def attachment(self, attachment: Attachment) -> bytes:
        """Return an attachment's bytes."""
        return self._bytes_at(attachment.begin, attachment.size)

    def schema_name(self, channel: Channel) -> str:
        """Return the name of a channel's message type, "" when it has none."""
        schema = self.schemas.get(channel.schema_id)
        return schema.name if schema else ""

    def count_of(self, channel: int) -> int | None:
        """Return how many messages a channel has by the statistics; None without them or in a salvaged file.

        Raises:
            RecordingError: more than the chunks can hold.
        """
        if self.message_counts is None or self.loss is not None:
            return None
        count = self.message_counts.get(channel, 0)
        if count > sum(chunk.uncompressed_size for chunk in self.chunks) // (RECORD_HEAD + MESSAGE_HEAD):
            raise self._damage(f"its statistics claim {count} messages of one topic, more than it holds")
        return count

    def chunks_with(self, channels: Collection[int]) -> list[Chunk]:
        """Return the chunks that may hold messages of these channels, so that the others need not be unpacked.

        A message index that keeps a channel quiet hides messages that the statistics count, so it is trusted where
        there are statistics.
        """
        trusted = self.message_counts is not None and self.loss is None
        return [
            chunk
            for chunk in self.chunks
            if not trusted or not chunk.channels or any(channel in channels for channel in chunk.channels)
        ]

    def runs(self, chunk: Chunk) -> Iterator[Run]:
        """Yield the messages of a chunk, unpacked and verified."""
        data = unpack(self._file, chunk, self._bytes_at(chunk.begin, chunk.compressed_size))
        run = regular_run(self._file, chunk, data)
        if run is not None:
            self._known(run.channel)
            yield run
            return
        for run in mixed_runs(self._file, chunk, data, self._define):
            self._known(run.channel)
            yield run

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def __enter__(self) -> McapLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _walk(self) -> None:
        if self._stream.read(len(MAGIC)) != MAGIC:
            raise RecordingError(self._file, "is not an MCAP file (it does not begin as one)")
        at, crc, finished = len(MAGIC), zlib.crc32(MAGIC), False
        try:
            while not finished:
                op, content, end = self._next_record(at)
                if op == Op.DATA_END:
                    self._check_crc(Cursor(self._file, "the end of the data", content).unsigned(4), crc, "data section")
                    self._summary(end)
                    finished = True
                elif op == Op.FOOTER:
                    raise self._damage(f"the data section has no end, at byte {at}")
                else:
                    self._data_record(op, content, at + RECORD_HEAD, crc)
                    crc = zlib.crc32(content, zlib.crc32(struct.pack("<BQ", op, len(content)), crc))
                at = end
            if not self.channels and self.chunks:
                for chunk in self.chunks:  # a file that does not repeat its channels in the summary
                    list(self.runs(chunk))
        except RecordingError as error:
            if not self._salvage or not self.library:
                raise
            self.loss = Loss(error.reason, self._size - at)

    def _next_record(self, at: int) -> tuple[int, bytes, int]:
        head = self._bytes_at(at, RECORD_HEAD) if at + RECORD_HEAD <= self._size else b""
        op, length = struct.unpack("<BQ", head) if head else (0, 0)
        if not head or at + RECORD_HEAD + length > self._size:
            raise RecordingError(
                self._file,
                f"cut at byte {self._size}, in the record at byte {at}: its run was stopped, or it is damaged"
                f"{self._hint}",
            )
        if length > MAX_RECORD:
            raise self._damage(
                f"the record at byte {at} claims {length} bytes, more than the {MAX_RECORD} that are read"
            )
        return op, self._bytes_at(at + RECORD_HEAD, length), at + RECORD_HEAD + length

    def _data_record(self, op: int, content: bytes, begin: int, crc: int) -> None:
        cursor = Cursor(self._file, f"the record at byte {begin - RECORD_HEAD}", content)
        if begin == len(MAGIC) + RECORD_HEAD and op != Op.HEADER:
            raise self._damage("its first record is not a header")
        if op == Op.HEADER:
            cursor.text()
            self.library = cursor.text() or "unknown"
        elif op in (Op.SCHEMA, Op.CHANNEL):
            self._define(op, content)
        elif op == Op.CHUNK:
            chunk = read_chunk(cursor, begin)
            self.checked = self.checked and chunk.uncompressed_crc != 0
            if self._salvage:
                list(self.runs(chunk))
            self.chunks.append(chunk)
        elif op == Op.MESSAGE:
            self._loose_message(begin - RECORD_HEAD, len(content) + RECORD_HEAD)
        elif op == Op.ATTACHMENT:
            attachment = read_attachment(cursor, begin)
            stored = int.from_bytes(content[-4:], "little")
            self._check_crc(stored, zlib.crc32(content[:-4]), f"attachment {attachment.name!r}")
            self.attachments.append(attachment)
        elif op == Op.METADATA:
            name, values = cursor.text(), cursor.mapping()
            if name == PREAMBLE:
                self._check_crc(int(values.get("crc32", "")) if values.get("crc32", "").isdecimal() else -1, crc, name)
            self.metadata.append((name, values))
        elif op == Op.MESSAGE_INDEX:
            if self.chunks:
                self.chunks[-1].channels.append(cursor.unsigned(2))
        elif self._salvage:
            raise self._damage(f"the record at byte {begin - RECORD_HEAD} is of an unknown kind")

    def _loose_message(self, begin: int, size: int) -> None:
        """Take messages outside chunks as an unpacked chunk without a checksum of its own."""
        if self.chunks and self.chunks[-1].uncompressed_crc == 0 and not self.chunks[-1].compression:
            last = self.chunks[-1]
            if last.begin + last.compressed_size == begin and last.end_time == 2**64 - 1:
                begin, size = last.begin, last.compressed_size + size
                self.chunks.pop()
        self.chunks.append(Chunk(0, 2**64 - 1, size, 0, "", begin, size))
        self.checked = False

    def _summary(self, start: int) -> None:
        size = self._size - len(MAGIC) - start
        if size < 0 or size > MAX_RECORD or self._bytes_at(self._size - len(MAGIC), len(MAGIC)) != MAGIC:
            raise self._damage("its end is missing or is not that of an MCAP file")
        data = self._bytes_at(start, size)
        footer = b""
        for op, begin, end in records(self._file, data):
            if footer:
                raise self._damage("something follows its footer")
            if op == Op.FOOTER:
                footer = data[begin:end]
            elif op in (Op.SCHEMA, Op.CHANNEL):
                self._define(op, data[begin:end])
            elif op == Op.STATISTICS:
                self._statistics(data[begin:end])
        if len(footer) != 20:
            raise self._damage("its footer is missing")
        summary_start, _, crc = struct.unpack("<QQI", footer)
        if summary_start not in (start, 0) or (summary_start == 0 and size != RECORD_HEAD + 20):
            raise self._damage("its footer does not point to its summary")
        self._check_crc(crc, zlib.crc32(data[:-4]), "summary")

    def _statistics(self, content: bytes) -> None:
        cursor = Cursor(self._file, "the statistics", content)
        cursor.take(8 + 2 + 4 + 4 + 4 + 4 + 8 + 8)
        end = cursor.unsigned(4) + cursor.at
        self.message_counts = {}
        while cursor.at < end:
            channel = cursor.unsigned(2)
            self.message_counts[channel] = cursor.unsigned(8)

    def _define(self, op: int, content: bytes) -> None:
        cursor = Cursor(self._file, "a schema or channel", content)
        if op == Op.SCHEMA:
            number, schema = read_schema(cursor)
            if number == 0 or self.schemas.setdefault(number, schema) != schema:
                raise self._damage(f"schema {number} is defined twice, differently")
        else:
            channel = read_channel(cursor)
            if channel.schema_id and channel.schema_id not in self.schemas:
                raise self._damage(f"channel {channel.topic!r} refers to a schema that is not there")
            if self.channels.setdefault(channel.id, channel) != channel:
                raise self._damage(f"channel {channel.id} is defined twice, differently")

    def _known(self, channel: int) -> None:
        if channel not in self.channels:
            raise self._damage(f"a message belongs to channel {channel}, which is not defined")

    def _check_crc(self, stored: int, computed: int, what: str) -> None:
        if stored == 0:
            self.checked = False
        elif stored != computed:
            raise self._damage(f"the checksum of its {what} is wrong")

    def _bytes_at(self, begin: int, size: int) -> bytes:
        self._stream.seek(begin)
        data = self._stream.read(size)
        if len(data) != size:
            raise self._damage("it became shorter while it was read")
        return data

    def _damage(self, reason: str) -> RecordingError:
        return RecordingError(self._file, f"damaged: {reason}")


def _size_of(path: Path) -> int:
    """Return the size of a file [bytes]; RecordingError for a pipe, which would be waited for, or a device."""
    found = path.stat()
    if not stat.S_ISREG(found.st_mode) and not stat.S_ISDIR(found.st_mode):
        raise RecordingError(str(path), "is a pipe or a device; recordings are read from files")
    return found.st_size
