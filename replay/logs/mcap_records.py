"""The records of an MCAP file (https://mcap.dev/spec), read from bytes that nobody vouches for yet."""

from __future__ import annotations

import enum
import struct
import zlib
from dataclasses import dataclass, field

from replay import limits
from replay.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"
RECORD_HEAD = 9
"""Bytes before a record's content: opcode (1) and content length (8)."""
MESSAGE_HEAD = 22
"""Bytes of a message record's content before its data: channel (2), sequence (4), log time (8), publish time (8)."""
FOOTER_BYTES = 20
"""Bytes of the footer's content: start of the summary (8), start of its offsets (8), checksum (4)."""
PRIVATE = 0x80
"""Opcodes from here on are an application's own."""
MAX_RECORD = limits.RECORD
"""Largest record [bytes] that is read or written; a larger length is damage or an attack."""
MAX_CHUNK = limits.CHUNK
"""Largest chunk [bytes, unpacked] that is read or written."""
PREAMBLE = "preamble"
"""Name of our metadata record that closes the part before the first chunk: `crc32` of all bytes before it.

The data section's checksum comes last in a file, so a file that was cut has none; chunks have their own, and this
covers schemas, channels, metadata and attachments there.
"""


class Op(enum.IntEnum):
    """What a record is."""

    HEADER = 0x01
    FOOTER = 0x02
    SCHEMA = 0x03
    CHANNEL = 0x04
    MESSAGE = 0x05
    CHUNK = 0x06
    MESSAGE_INDEX = 0x07
    CHUNK_INDEX = 0x08
    ATTACHMENT = 0x09
    ATTACHMENT_INDEX = 0x0A
    STATISTICS = 0x0B
    METADATA = 0x0C
    METADATA_INDEX = 0x0D
    SUMMARY_OFFSET = 0x0E
    DATA_END = 0x0F


DATA_SECTION = frozenset(op for op in Op if op <= Op.MESSAGE_INDEX or op in (Op.ATTACHMENT, Op.METADATA, Op.DATA_END))
"""What may stand before the summary; the footer is among it because its standing there is told in words of its own."""


@dataclass(frozen=True)
class Schema:
    """How the messages of a channel are encoded."""

    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True)
class Channel:
    """A stream of messages under one topic."""

    id: int
    schema_id: int
    topic: str
    encoding: str
    metadata: dict[str, str]


@dataclass(frozen=True)
class Chunk:
    """A compressed run of messages; the data lie at `begin` in the file.

    `channels` are the ids that the message indexes after the chunk name; empty when there are none. A `loose` one is
    no chunk of the file, but messages that stand outside of any, one after another.
    """

    uncompressed_size: int
    uncompressed_crc: int
    compression: str
    begin: int
    compressed_size: int
    channels: list[int] = field(default_factory=list)
    loose: bool = False

    def follows_on(self, begin: int) -> bool:
        """Return whether a message outside chunks that begins there belongs to these."""
        return self.loose and self.begin + self.compressed_size == begin


@dataclass(frozen=True)
class Attachment:
    """A file inside the file; its bytes lie at `begin`."""

    name: str
    media_type: str
    begin: int
    size: int


class Cursor:
    """Reads little-endian values one after another and never beyond the end of its bytes."""

    def __init__(self, file: str, what: str, data: bytes | memoryview) -> None:
        self._file = file
        self._what = what
        self._data = data
        self.at = 0

    def take(self, size: int) -> bytes:
        """Return the next `size` bytes; RecordingError when there are fewer."""
        self.skip(size)
        return bytes(self._data[self.at - size : self.at])

    def skip(self, size: int) -> None:
        """Pass over the next `size` bytes; RecordingError when there are fewer."""
        if size > len(self._data) - self.at:
            raise RecordingError(self._file, f"damaged: {self._what} ends inside a value")
        self.at += size

    def unsigned(self, size: int) -> int:
        """Return the next unsigned integer of `size` bytes."""
        return int.from_bytes(self.take(size), "little")

    def text(self) -> str:
        """Return the next length-prefixed text."""
        try:
            return self.take(self.unsigned(4)).decode()
        except UnicodeDecodeError:
            raise RecordingError(self._file, f"damaged: {self._what} holds a text that is not UTF-8") from None

    def mapping(self) -> dict[str, str]:
        """Return the next length-prefixed map of texts."""
        end = self.unsigned(4) + self.at
        result = {}
        while self.at < end:
            key = self.text()
            result[key] = self.text()
        if self.at != end:
            raise RecordingError(self._file, f"damaged: {self._what} holds a map of the wrong length")
        return result


def read_schema(cursor: Cursor) -> tuple[int, Schema]:
    """Return a schema record's id and content."""
    number = cursor.unsigned(2)
    name, encoding = cursor.text(), cursor.text()
    return number, Schema(name, encoding, cursor.take(cursor.unsigned(4)))


def read_channel(cursor: Cursor) -> Channel:
    """Return a channel record's content."""
    number, schema = cursor.unsigned(2), cursor.unsigned(2)
    topic, encoding = cursor.text(), cursor.text()
    return Channel(number, schema, topic, encoding, cursor.mapping())


def read_chunk(cursor: Cursor, begin: int) -> Chunk:
    """Return a chunk record's content without its data; the record's content begins at `begin` in the file."""
    cursor.take(16)  # times of the first and the last message
    size, crc = cursor.unsigned(8), cursor.unsigned(4)
    compression = cursor.text()
    compressed = cursor.unsigned(8)
    chunk = Chunk(size, crc, compression, begin + cursor.at, compressed)
    cursor.skip(compressed)
    return chunk


def read_attachment(cursor: Cursor, begin: int) -> Attachment:
    """Return an attachment record's content without its data; the cursor stands at the checksum then."""
    cursor.take(16)  # log and creation time
    name, media_type = cursor.text(), cursor.text()
    size = cursor.unsigned(8)
    attachment = Attachment(name, media_type, begin + cursor.at, size)
    cursor.skip(size)
    return attachment


def crc_after(op: int, content: bytes, crc: int) -> int:
    """Return the checksum of everything up to a record and the record."""
    return zlib.crc32(content, zlib.crc32(struct.pack("<BQ", op, len(content)), crc))


def check_crc(file: str, stored: int, computed: int, what: str) -> None:
    """Raise RecordingError when a checksum is there, which 0 says that it is not, and is not the computed one."""
    if stored not in (0, computed):
        raise RecordingError(file, f"damaged: the checksum of its {what} is wrong")
