"""MCAP files written record by record, as the specification of the format allows and no library does."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Collection
from dataclasses import dataclass

from replay.logs.mcap_records import MAGIC, Op

PAD = b"\x01\x02\x03"
"""What a later version of the format may add to the end of a record."""


def text(value: str) -> bytes:
    return struct.pack("<I", len(value.encode())) + value.encode()


def record(op: int, content: bytes) -> bytes:
    return struct.pack("<BQ", op, len(content)) + content


def schema(number: int, name: str, encoding: str, data: bytes) -> bytes:
    return struct.pack("<H", number) + text(name) + text(encoding) + struct.pack("<I", len(data)) + data


def channel(number: int, schema_id: int, topic: str, encoding: str) -> bytes:
    return struct.pack("<HH", number, schema_id) + text(topic) + text(encoding) + struct.pack("<I", 0)


def message(number: int, time: int, data: bytes) -> bytes:
    return record(Op.MESSAGE, struct.pack("<HIQQ", number, 0, time, time) + data)


def attachment(name: str, data: bytes) -> bytes:
    content = struct.pack("<QQ", 1, 2) + text(name) + text("text/plain") + struct.pack("<Q", len(data)) + data
    return content + struct.pack("<I", zlib.crc32(content))


def metadata(name: str, key: str, value: str) -> bytes:
    pairs = text(key) + text(value)
    return text(name) + struct.pack("<I", len(pairs)) + pairs


@dataclass(frozen=True)
class Stored:
    """What a file holds: messages are channel, time and data."""

    schemas: dict[int, tuple[str, str, bytes]]
    channels: dict[int, tuple[int, str, str]]
    messages: list[tuple[int, int, bytes]]
    attachments: dict[str, bytes]
    metadata: dict[str, tuple[str, str]]


FEATURES = ("chunks", "indexes", "schemas again", "channels again", "counts", "pad", "private", "checksums")


def build(stored: Stored, features: Collection[str], *, split: int = 2) -> bytes:
    """Return a file with some of `FEATURES`; `split` messages go into a chunk."""
    pad = PAD if "pad" in features else b""
    with_crc = "checksums" in features
    schemas = {k: record(Op.SCHEMA, schema(k, *values) + pad) for k, values in stored.schemas.items()}
    channels = {k: record(Op.CHANNEL, channel(k, *values) + pad) for k, values in stored.channels.items()}
    out = bytearray(MAGIC + record(Op.HEADER, text("") + text("test") + pad))
    if "private" in features:
        out += record(0x81, b"mine")
    for name, data in stored.attachments.items():
        out += record(Op.ATTACHMENT, attachment(name, data) + pad)
    for name, pair in stored.metadata.items():
        out += record(Op.METADATA, metadata(name, *pair) + pad)
    defined: set[int] = set()
    for begin in range(0, len(stored.messages), split):
        part, body, where = stored.messages[begin : begin + split], bytearray(), {}
        for number, time, data in part:
            if number not in defined:
                schema_id = stored.channels[number][0]
                body += schemas.get(schema_id, b"") + channels[number]
                defined.add(number)
            where.setdefault(number, []).append((time, len(body)))
            body += message(number, time, data)
        if "chunks" not in features:
            out += body
            continue
        times = [time for _, time, _ in part]
        crc = zlib.crc32(body) if with_crc else 0
        head = struct.pack("<QQQI", min(times), max(times), len(body), crc) + text("")
        out += record(Op.CHUNK, head + struct.pack("<Q", len(body)) + body + pad)
        for number, entries in where.items() if "indexes" in features else ():
            rows = b"".join(struct.pack("<QQ", *entry) for entry in entries)
            out += record(Op.MESSAGE_INDEX, struct.pack("<HI", number, len(rows)) + rows + pad)
    out += record(Op.DATA_END, struct.pack("<I", zlib.crc32(out) if with_crc else 0) + pad)
    start, summary = len(out), bytearray()
    if "schemas again" in features:
        summary += b"".join(schemas.values())
    if "channels again" in features:
        summary += b"".join(channels.values())
    if "counts" in features:
        counts = {number: sum(m[0] == number for m in stored.messages) for number in stored.channels}
        rows = b"".join(struct.pack("<HQ", number, count) for number, count in counts.items())
        head = struct.pack("<QHIIIIQQ", len(stored.messages), 0, 0, 0, 0, 0, 0, 0)
        summary += record(Op.STATISTICS, head + struct.pack("<I", len(rows)) + rows + pad)
    summary += struct.pack("<BQQQ", Op.FOOTER, 20 + len(pad), start if summary else 0, 0)
    return bytes(out + summary + struct.pack("<I", zlib.crc32(summary) if with_crc else 0) + pad + MAGIC)
