"""What a chunk of an MCAP file holds: unpacked within limits, checked, and cut into messages."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import lz4.frame  # type: ignore[import-untyped]
import numpy as np
import zstandard

from replay.errors import LimitError, RecordingError
from replay.logs.mcap_records import MAX_CHUNK, MESSAGE_HEAD, RECORD_HEAD, Chunk, Op
from replay.logs.work import Work
from replay.numerics.arrays import Bytes, Integers

MESSAGE_ROW = RECORD_HEAD + MESSAGE_HEAD
"""Bytes of a message record before its data."""
_op_and_length = struct.Struct("<BQ").unpack_from
_channel_and_time = struct.Struct("<H4xQ").unpack_from


@dataclass(frozen=True, eq=False)
class MessageRun:
    """Messages of one channel in a chunk.

    Attributes:
        channel: the channel's id.
        time: (n,) log times [ns].
        rows: (n, length) the messages as bytes when all have the same length, else None.
        payloads: the messages' bytes one by one when `rows` is None, else empty.
    """

    channel: int
    time: Integers
    rows: Bytes | None
    payloads: tuple[bytes, ...]

    def messages(self) -> list[bytes]:
        """Return the messages' bytes one by one."""
        return list(self.payloads) if self.rows is None else [row.tobytes() for row in self.rows]


def unpack(file: str, chunk: Chunk, packed: bytes) -> bytes:
    """Return a chunk's records; RecordingError when they do not unpack to the size and checksum that it claims."""
    size = chunk.uncompressed_size
    if size > MAX_CHUNK:
        raise _damage(file, chunk, f"claims {size} bytes, more than the {MAX_CHUNK} that are read")
    try:
        if not packed and not size:
            data = b""
        elif chunk.compression == "zstd":
            if zstandard.frame_content_size(packed) == size:
                data = zstandard.ZstdDecompressor().decompress(packed)
            else:  # a frame that does not say its size, or several of them
                reader = zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True)
                data = reader.read(size + 1)
        elif chunk.compression == "lz4":
            data = _of_lz4(packed, size)
        elif chunk.compression == "":
            data = packed
        else:
            raise _damage(file, chunk, f"is packed by an unknown method, {chunk.compression!r}")
    except (zstandard.ZstdError, RuntimeError, EOFError, MemoryError) as error:
        raise _damage(file, chunk, f"cannot be unpacked ({error})") from None
    if len(data) != size:
        raise _damage(file, chunk, "does not unpack to the size it claims")
    if chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc:
        raise _damage(file, chunk, "has a wrong checksum")
    return data


def _of_lz4(packed: bytes, size: int) -> bytes:
    """Return what lz4 frames, one after another, unpack to; no more than about `size` bytes."""
    data = b""
    while packed and len(data) < size:
        frame = lz4.frame.LZ4FrameDecompressor()
        data += frame.decompress(packed, max_length=size + 1 - len(data))
        packed = frame.unused_data or b""  # None where a frame is not at its end
    return data


def regular_run(file: str, chunk: Chunk, data: bytes) -> MessageRun | None:
    """Return a chunk's messages when all are of one channel and one length (found by one comparison), else None."""
    if len(data) < MESSAGE_ROW or data[0] != Op.MESSAGE:
        return None
    stride = RECORD_HEAD + int.from_bytes(data[1:RECORD_HEAD], "little")
    if stride < MESSAGE_ROW or len(data) % stride:
        return None
    rows = np.frombuffer(data, dtype=np.uint8).reshape(-1, stride)
    if not bool((rows[:, :11] == rows[0, :11]).all()):
        return None
    stamps = rows[:, 15:23].copy().view("<u8")[:, 0]
    _check_time(file, chunk, int(stamps.max()))
    channel = int.from_bytes(data[9:11], "little")
    return MessageRun(channel, stamps.astype(np.int64), rows[:, MESSAGE_ROW:], ())


def mixed_runs(
    file: str, chunk: Chunk, data: bytes, define: Callable[[int, bytes], None], work: Work
) -> list[MessageRun]:
    """Return the messages of any chunk by channel; `define` is called with its schema and channel records."""
    found: dict[int, tuple[list[int], list[bytes]]] = {}
    number = 0
    for op, begin, end in records(file, data, work.most_records):
        number += 1
        if op == Op.MESSAGE:
            if end - begin < MESSAGE_HEAD:
                raise _damage(file, chunk, "holds a message that ends inside a value")
            channel, stamp = _channel_and_time(data, begin)
            times, payloads = found.get(channel) or found.setdefault(channel, ([], []))
            times.append(stamp)
            payloads.append(data[begin + MESSAGE_HEAD : end])
        elif op in (Op.SCHEMA, Op.CHANNEL):
            define(op, data[begin:end])
    work.records_of(chunk.begin, number)
    for times, _ in found.values():
        _check_time(file, chunk, max(times))
    return [_run(channel, times, payloads) for channel, (times, payloads) in sorted(found.items())]


def _run(channel: int, times: list[int], payloads: list[bytes]) -> MessageRun:
    length = len(payloads[0])
    if not length or any(len(payload) != length for payload in payloads):
        return MessageRun(channel, np.array(times, dtype=np.int64), None, tuple(payloads))
    rows = np.frombuffer(b"".join(payloads), dtype=np.uint8).reshape(-1, length)
    return MessageRun(channel, np.array(times, dtype=np.int64), rows, ())


def records(file: str, data: bytes, most: int) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of the content of records that follow one another; LimitError after the `most`."""
    at, size = 0, len(data)
    while at < size:
        most -= 1
        if most < 0:
            raise LimitError(file, "holds more records than are read of a file of its size")
        if at + RECORD_HEAD > size:
            raise RecordingError(file, "damaged: a record ends inside its head")
        op, length = _op_and_length(data, at)
        begin = at + RECORD_HEAD
        at = begin + length
        if at > size:
            raise RecordingError(file, "damaged: a record is longer than what holds it")
        yield op, begin, at


def _check_time(file: str, chunk: Chunk, last: int) -> None:
    if last >= 2**63:
        rule = f"at {last} ns; times are read up to {2**63 - 1} ns, in the year 2262"
        raise RecordingError(file, f"the chunk at byte {chunk.begin} holds a message {rule}")


def _damage(file: str, chunk: Chunk, reason: str) -> RecordingError:
    return RecordingError(file, f"damaged: the chunk at byte {chunk.begin} {reason}")
