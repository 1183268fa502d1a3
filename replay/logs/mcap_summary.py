"""The summary of an MCAP file, which follows its data: definitions again, counts of messages, and the footer."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable

from replay.errors import RecordingError
from replay.logs.mcap_chunks import records
from replay.logs.mcap_records import FOOTER_BYTES, RECORD_HEAD, Cursor, Op, check_crc
from replay.logs.work import Work


def read_summary(
    file: str, data: bytes, start: int, define: Callable[[int, bytes], None], work: Work
) -> dict[int, int] | None:
    """Check the summary of a file and its footer.

    Args:
        file: for messages.
        data: everything between the end of the data and the magic bytes at the end.
        start: where that stands in the file.
        define: is called with the schema and channel records.
        work: bounds the records.

    Returns:
        The number of messages by channel id as the statistics say; None when they do not.

    Raises:
        RecordingError: damage.
    """
    counts: dict[int, int] | None = None
    footer = -1
    for op, begin, end in records(file, data, work.most_records):
        if footer >= 0:
            raise RecordingError(file, "damaged: something follows its footer")
        if op == Op.FOOTER:
            footer = begin
        elif op in (Op.SCHEMA, Op.CHANNEL):
            define(op, data[begin:end])
        elif op == Op.STATISTICS:
            counts = _counts(file, Cursor(file, "the statistics", data[begin:end]))
    if footer < 0 or len(data) - footer < FOOTER_BYTES:
        raise RecordingError(file, "damaged: its footer is missing")
    summary, _, crc = struct.unpack_from("<QQI", data, footer)
    if summary not in (start, 0) or (summary == 0 and footer != RECORD_HEAD):
        raise RecordingError(file, "damaged: its footer does not point to its summary")
    check_crc(file, crc, zlib.crc32(memoryview(data)[: footer + FOOTER_BYTES - 4]), "summary")
    return counts


_ENTRY_BYTES = 10
"""Bytes of a channel id and its number of messages."""


def _counts(file: str, cursor: Cursor) -> dict[int, int] | None:
    """Return the messages by channel id; None when there are some and it is not said of which."""
    messages = cursor.unsigned(8)
    cursor.take(2 + 4 + 4 + 4 + 4 + 8 + 8)
    size = cursor.unsigned(4)
    if size > _ENTRY_BYTES << 16:
        raise RecordingError(file, "damaged: its statistics count more channels than there can be")
    end = size + cursor.at
    counts = {}
    while cursor.at < end:
        channel = cursor.unsigned(2)
        counts[channel] = cursor.unsigned(8)
    return counts if counts or not messages else None
