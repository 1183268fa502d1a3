"""Checksums that only one place in a file has: nothing else would notice what they cover."""

from __future__ import annotations

import struct
import zlib

import pytest

from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import MAGIC, PREAMBLE, Op
from tests.logs.mcap_bytes import attachment, channel, message, metadata, record, schema, text

HEAD = MAGIC + record(Op.HEADER, text("") + text("test"))


def without_other_checksums(data: bytes) -> bytes:
    """Return a file whose data section and summary have no checksum."""
    data += record(Op.DATA_END, struct.pack("<I", 0))
    return data + record(Op.FOOTER, struct.pack("<QQI", 0, 0, 0)) + MAGIC


@pytest.mark.parametrize("at", [0, 34, 40, -5, -1])
def test_a_damaged_attachment_is_found_by_its_own_checksum(at: int) -> None:
    content = bytearray(attachment("notes.txt", b"what was attached"))
    content[at] ^= 1
    wrong = without_other_checksums(HEAD + record(Op.ATTACHMENT, bytes(content)))
    with pytest.raises(RecordingError, match=r"damaged: the checksum of its attachment 'notes\.txt' is wrong"):
        McapLog("a.mcap", data=wrong)


def test_an_attachment_with_its_checksum_or_without_any_is_read() -> None:
    content = attachment("notes.txt", b"what was attached")
    for whole in (content, content[:-4] + bytes(4), content + b"of a later version"):
        with McapLog("a.mcap", data=without_other_checksums(HEAD + record(Op.ATTACHMENT, whole))) as log:
            (found,) = log.attachments
            assert log.attachment(found) == b"what was attached"


def cut_file(preamble: bytes, stated: int) -> bytes:
    """Return a file that ends in its second chunk, the end of whose preamble states a checksum."""
    data = preamble + record(Op.METADATA, metadata(PREAMBLE, "crc32", str(stated)))
    for k in range(2):
        body = message(1, k, b"abc")
        head = struct.pack("<QQQI", k, k, len(body), zlib.crc32(body)) + text("") + struct.pack("<Q", len(body))
        data += record(Op.CHUNK, head + body)
    return data[:-7]


def test_a_cut_file_says_whether_what_comes_before_its_chunks_is_as_it_was_written() -> None:
    definitions = record(Op.SCHEMA, schema(1, "a.B", "protobuf", b"")) + record(Op.CHANNEL, channel(1, 1, "/a", "x"))
    preamble = HEAD + record(Op.METADATA, metadata("other", "crc32", "1")) + definitions
    crc = zlib.crc32(preamble)
    for stated, holds in ((crc, True), (crc ^ 1, False), (0, False)):
        with pytest.raises(RecordingError, match="cut at byte"):
            McapLog("a.mcap", data=cut_file(preamble, stated))
        with McapLog("a.mcap", data=cut_file(preamble, stated), salvage=True) as log:
            assert log.preamble_holds == holds
            assert log.loss is not None and len(log.chunks) == 1
    for at in range(len(MAGIC) + 9, len(preamble)):  # any byte of any record there
        wrong = bytearray(preamble)
        wrong[at] ^= 0x20
        try:
            with McapLog("a.mcap", data=cut_file(bytes(wrong), crc), salvage=True) as log:
                assert not log.preamble_holds
        except RecordingError:
            pass  # nothing could be read of it at all
