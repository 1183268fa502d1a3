"""MCAP files opened with every checksum verified, and salvaged when they were cut.

The library's seekable reader checks chunks only: flipped bits in the rest of a file pass in silence. Here one pass
over the file checks the data section, the summary and attachments, and a chunk is checked whenever it is unpacked, so
that damage which any checksum in the file covers is an error and never a different number.

Whoever wrote a file, what its format allows is read: schemas and channels that stand in chunks alone, records that go
on after what is known of them, kinds of records that are not known, channels without a schema.
"""

from __future__ import annotations

import io
import stat
import struct
import zlib
from collections import deque
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import BinaryIO

from replay import limits
from replay.errors import LimitError, RecordingError
from replay.lfs_pointer import LARGEST_POINTER, LFS_POINTER, is_lfs_pointer
from replay.logs.loss import Loss
from replay.logs.mcap_chunks import MESSAGE_ROW, MessageRun, mixed_runs, regular_run, unpack
from replay.logs.mcap_records import (
    DATA_SECTION,
    MAGIC,
    MAX_CHUNK,
    MAX_RECORD,
    PREAMBLE,
    PRIVATE,
    RECORD_HEAD,
    Attachment,
    Channel,
    Chunk,
    Cursor,
    Op,
    Schema,
    check_crc,
    crc_after,
    read_attachment,
    read_channel,
    read_chunk,
    read_schema,
)
from replay.logs.mcap_summary import read_summary
from replay.logs.work import Work


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
        preamble_holds: whether everything before the first chunk is there and as `replay` wrote it; it decides where
            the data section has no end, and so no checksum. A file that another tool has written anew says no.
        loss: what was lost when the file was salvaged, else None.
        work: what reading it has cost, held against its bounds.
    """

    def __init__(self, path: str | Path, *, salvage: bool = False, data: bytes | None = None) -> None:
        """Walk and verify a file; with `salvage`, keep everything before the first damage instead of refusing it.

        Given its bytes as `data`, the file itself is not touched; `path` is its name in messages then. With `salvage`
        every chunk is unpacked, so that no damage is left to be found later.

        Raises:
            RecordingError: the file cannot be read, is not an MCAP file, or is damaged or cut (without `salvage`).
        """
        self.path = Path(path)
        self._file = str(path)
        self._salvage = salvage
        self._hint = "" if salvage or data is not None else "; `replay info` and `replay export` salvage what is whole"
        try:
            self._size = _size_of(self.path) if data is None else len(data)
            self._stream: BinaryIO = self.path.open("rb") if data is None else io.BytesIO(data)
        except OSError as error:
            raise RecordingError(self._file, f"cannot be read: {error.strerror}") from None
        self._forget()
        try:
            self._open()
        except OSError as error:
            self.close()
            raise RecordingError(self._file, f"cannot be read: {error.strerror}") from None
        except BaseException:
            self.close()
            raise

    def _forget(self) -> None:
        """Begin anew: nothing is read."""
        self.library = ""
        self.schemas: dict[int, Schema] = {}
        self.channels: dict[int, Channel] = {}
        self.chunks: list[Chunk] = []
        self.attachments: list[Attachment] = []
        self.metadata: list[tuple[str, dict[str, str]]] = []
        self.message_counts: dict[int, int] | None = None
        self.preamble_holds = False
        self.loss: Loss | None = None
        self.work = Work(self._file, self._size)
        self._defined: set[bytes] = set()

    def _open(self) -> None:
        head = self._bytes_at(0, min(self._size, LARGEST_POINTER))
        if is_lfs_pointer(head):
            raise RecordingError(self._file, LFS_POINTER)
        if not head.startswith(MAGIC):
            raise RecordingError(self._file, "is not an MCAP file (it does not begin as one)")
        try:
            self._walk()
        except RecordingError as error:
            if not self._salvage or not self.library or isinstance(error, LimitError):
                raise
            self._forget()  # what seemed whole may have been read past the damage
            self._walk_to(error)

    def attachment(self, attachment: Attachment) -> bytes:
        """Return an attachment's bytes."""
        return self._bytes_at(attachment.begin, attachment.size)

    @property
    def size(self) -> int:
        """Bytes of the file."""
        return self._size

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
        number = self.message_counts.get(channel, 0)
        if number > self.work.unpacked // MESSAGE_ROW:
            raise self._damage(f"its statistics claim {number} messages of one topic, more than it holds")
        return number

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

    def runs(self, chunk: Chunk) -> Iterator[MessageRun]:
        """Yield the messages of a chunk, unpacked and verified."""
        data = unpack(self._file, chunk, self._bytes_at(chunk.begin, chunk.compressed_size))
        run = regular_run(self._file, chunk, data)
        if run is not None:
            self.work.records_of(chunk.begin, len(run.time))
            self._known(run.channel)
            yield run
            return
        for run in mixed_runs(self._file, chunk, data, self._define, self.work):
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
        """Read the whole file; RecordingError when it is damaged."""
        at, crc = len(MAGIC), zlib.crc32(MAGIC)
        while True:
            op, content, end = self._next_record(at)
            if op == Op.DATA_END:
                stored = Cursor(self._file, "the end of the data", content).unsigned(4)
                check_crc(self._file, stored, crc, "data section")
                self._summary(end)
                break
            self._data_record(op, content, at, crc)
            crc = crc_after(op, content, crc)
            at = end
        self._define_from_chunks()

    def _walk_to(self, damage: RecordingError) -> None:
        """Read what comes before the first damage, when the file as a whole is known to be damaged."""
        at, crc = len(MAGIC), zlib.crc32(MAGIC)
        try:
            while True:
                op, content, end = self._next_record(at)
                if op == Op.DATA_END:
                    break
                if op not in DATA_SECTION and (op < PRIVATE or self.preamble_holds):
                    raise self._damage(f"the record at byte {at} is of an unknown kind")
                self._data_record(op, content, at, crc)
                crc = crc_after(op, content, crc)
                at = end
        except LimitError:
            raise
        except RecordingError as error:
            damage = error
        self.loss = Loss(damage.reason, self._size - at)

    def _define_from_chunks(self) -> None:
        """Unpack the chunks that may hold the schemas and channels which the rest of the file does not have."""
        for chunk in self.chunks:
            found = [self.channels.get(number) for number in chunk.channels]
            if not chunk.loose and not (
                found and all(c and (c.schema_id == 0 or c.schema_id in self.schemas) for c in found)
            ):
                deque(self.runs(chunk), maxlen=0)
        for channel in self.channels.values():
            if channel.schema_id and channel.schema_id not in self.schemas:
                raise self._damage(f"channel {channel.topic!r} refers to a schema that is not there")

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

    def _data_record(self, op: int, content: bytes, at: int, crc: int) -> None:
        """Take a record of the data section that begins at `at`; `crc` is that of everything before it."""
        cursor, begin = Cursor(self._file, f"the record at byte {at}", content), at + RECORD_HEAD
        self.work.record()
        if at == len(MAGIC) and op != Op.HEADER:
            raise self._damage("its first record is not a header")
        if op == Op.HEADER:
            cursor.text()
            self.library = cursor.text() or "unknown"
        elif op in (Op.SCHEMA, Op.CHANNEL):
            self._define(op, content)
        elif op == Op.CHUNK:
            chunk = read_chunk(cursor, begin)
            self.work.unpack(min(chunk.uncompressed_size, MAX_CHUNK))  # a larger one is refused by itself
            if self._salvage:
                deque(self.runs(chunk), maxlen=0)
            self.chunks.append(chunk)
        elif op == Op.MESSAGE:
            self._known(cursor.unsigned(2))
            self._loose_message(at, len(content) + RECORD_HEAD)
        elif op == Op.ATTACHMENT:
            attachment = read_attachment(cursor, begin)
            stored = cursor.unsigned(4)
            check_crc(
                self._file, stored, zlib.crc32(memoryview(content)[: cursor.at - 4]), f"attachment {attachment.name!r}"
            )
            self.attachments.append(attachment)
        elif op == Op.METADATA:
            self.work.define(len(content), 0)
            name, values = cursor.text(), cursor.mapping()
            if name == PREAMBLE:
                self.preamble_holds = values.get("crc32") == str(crc)
            self.metadata.append((name, values))
        elif op == Op.MESSAGE_INDEX:
            if self.chunks:
                self.chunks[-1].channels.append(cursor.unsigned(2))
        elif op == Op.FOOTER:
            raise self._damage(f"the data section has no end, at byte {at}")
        elif op == 0:
            raise self._damage(f"the record at byte {at} is of no kind: bytes are missing there")

    def _loose_message(self, begin: int, size: int) -> None:
        """Take messages outside chunks as an unpacked chunk without a checksum of its own."""
        self.work.unpacked += size
        last = self.chunks[-1] if self.chunks else None
        if last is not None and last.follows_on(begin) and last.compressed_size + size <= MAX_CHUNK:
            self.chunks.pop()
            begin, size = last.begin, last.compressed_size + size
        self.chunks.append(Chunk(size, 0, "", begin, size, loose=True))

    def _summary(self, start: int) -> None:
        size = self._size - len(MAGIC) - start
        if size > limits.SUMMARY:
            raise LimitError(self._file, f"has a summary of {size} bytes; at most {limits.SUMMARY} are read")
        if size < 0 or self._bytes_at(self._size - len(MAGIC), len(MAGIC)) != MAGIC:
            raise self._damage("its end is missing or is not that of an MCAP file")
        self.message_counts = read_summary(self._file, self._bytes_at(start, size), start, self._define, self.work)

    def _define(self, op: int, content: bytes) -> None:
        if content in self._defined:
            return
        self._defined.add(content)
        self.work.define(len(content), max(len(self.schemas), len(self.channels)))
        cursor = Cursor(self._file, "a schema or channel", content)
        if op == Op.SCHEMA:
            number, schema = read_schema(cursor)
            if number == 0:
                raise self._damage(f"schema {schema.name!r} has the number 0, which stands for none")
            if self.schemas.setdefault(number, schema) != schema:
                raise self._damage(f"schema {number} is defined twice, differently")
        else:
            channel = read_channel(cursor)
            if self.channels.setdefault(channel.id, channel) != channel:
                raise self._damage(f"channel {channel.id} is defined twice, differently")

    def _known(self, channel: int) -> None:
        if channel not in self.channels:
            raise self._damage(f"a message belongs to channel {channel}, which is not defined")

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
