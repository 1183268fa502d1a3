"""MCAP files of other writers, and files made to hurt."""

from __future__ import annotations

import io
import os
import struct
import zlib
from pathlib import Path

import lz4.frame
import numpy as np
import pytest
import zstandard
from foxglove_schemas_protobuf import JointStates_pb2, Log_pb2
from mcap.writer import CompressionType, Writer

from replay.errors import RecordingError, RecordingExistsError, WriteError
from replay.logs.columns import read_topics
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import MAGIC, MAX_CHUNK, Op
from replay.logs.part_file import PartFile
from replay.logs.protobuf import descriptor_set


def library_file(path: Path, compression: CompressionType, **options: bool) -> None:
    """Two topics in common chunks, one of changing length."""
    buffer = io.BytesIO()
    writer = Writer(buffer, chunk_size=2000, compression=compression, **options)
    writer.start()
    types = (JointStates_pb2.JointStates, Log_pb2.Log)
    schemas = [writer.register_schema(t.DESCRIPTOR.full_name, "protobuf", descriptor_set(t.DESCRIPTOR)) for t in types]
    joints = writer.register_channel("/robot/joints", "protobuf", schemas[0])
    log = writer.register_channel("/log", "protobuf", schemas[1])
    for k in range(100):
        stamp = {"seconds": 1_700_000_000 + k, "nanos": 500_000_000}
        message = JointStates_pb2.JointStates(timestamp=stamp, joints=[{"name": "elbow", "position": k / 7}])
        writer.add_message(joints, k, message.SerializeToString(), k)
        if k % 3 == 0:
            writer.add_message(log, k, Log_pb2.Log(message="x" * k, line=k).SerializeToString(), k)
    writer.finish()
    path.write_bytes(buffer.getvalue())


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("options", [{}, {"use_chunking": False}, {"repeat_channels": False, "enable_crcs": False}])
def test_files_of_the_library_are_read(tmp_path: Path, compression: CompressionType, options: dict[str, bool]) -> None:
    path = tmp_path / "robot.mcap"
    library_file(path, compression, **options)
    with McapLog(path) as log:
        topics = read_topics(log)
    joints = topics["/robot/joints"]
    assert joints.time.tolist() == list(range(100))
    if joints.messages is None:
        positions = joints.columns["joints[0].position"].tolist()
    else:
        positions = [message.joints[0].position for message in joints.messages]
    assert positions == [k / 7 for k in range(100)]
    lines = topics["/log"].messages
    assert lines is not None
    assert [message.line for message in lines] == list(range(0, 100, 3))


def record(op: int, content: bytes) -> bytes:
    return struct.pack("<BQ", op, len(content)) + content


def text(value: str) -> bytes:
    return struct.pack("<I", len(value)) + value.encode()


HEADER = MAGIC + record(Op.HEADER, text("") + text("test"))


def chunk(size: int, packed: bytes, compression: str = "zstd", crc: int = 1) -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, crc) + text(compression) + struct.pack("<Q", len(packed))
    return record(Op.CHUNK, head + packed)


def ended(data: bytes) -> bytes:
    data += record(Op.DATA_END, struct.pack("<I", zlib.crc32(data)))
    footer = struct.pack("<BQQQ", Op.FOOTER, 20, 0, 0)
    return data + footer + struct.pack("<I", zlib.crc32(footer)) + MAGIC


bomb = zstandard.compress(bytes(MAX_CHUNK + 1))


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "not an MCAP file"),
        (b"\x7fELF" + bytes(100), "not an MCAP file"),
        (MAGIC, "cut at byte 8"),
        (HEADER, "cut at"),
        (HEADER + struct.pack("<BQ", Op.CHUNK, 2**63), "cut at"),
        (MAGIC + record(Op.CHUNK, b""), "not a header"),
        (MAGIC + record(Op.HEADER, struct.pack("<I", 2**32 - 1)), "ends inside a value"),
        (MAGIC + record(Op.HEADER, struct.pack("<I", 2) + b"\xff\xfe"), "not UTF-8"),
        (ended(HEADER)[:-1], "is not that of an MCAP file"),
        (ended(HEADER + chunk(MAX_CHUNK + 1, bomb)), "claims"),
        (ended(HEADER + chunk(100, bomb)), "does not unpack to the size"),
        (ended(HEADER + chunk(2**64 - 1, b"")), "claims"),
        (ended(HEADER + chunk(100, b"junk")), "cannot be unpacked"),
        (ended(HEADER + chunk(100, b"junk", "lz4")), "does not unpack to the size"),
        (ended(HEADER + chunk(100, b"junk", "rar")), "unknown method"),
        (ended(HEADER + chunk(4, b"junk", "")), "wrong checksum"),
        (ended(HEADER + record(Op.CHANNEL, struct.pack("<HH", 1, 9) + text("/a") + text("") + text(""))), "not there"),
    ],
)
def test_hostile_files_are_refused_in_one_line(tmp_path: Path, data: bytes, words: str) -> None:
    path = tmp_path / "bad.mcap"
    path.write_bytes(data)
    with pytest.raises(RecordingError) as caught, McapLog(path) as log:
        for part in log.chunks:
            list(log.runs(part))
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("compression", "packed"),
    [
        ("zstd", zstandard.compress(b"")),
        ("zstd", b""),
        ("lz4", b""),
        ("lz4", lz4.frame.compress(b"")),
        ("", b""),
    ],
)
def test_an_empty_chunk_is_no_damage(compression: str, packed: bytes) -> None:
    with McapLog("empty.mcap", data=ended(HEADER + chunk(0, packed, compression, crc=0))) as log:
        assert [list(log.runs(part)) for part in log.chunks] == [[]]


def test_chunks_of_several_frames_and_of_frames_without_a_size_are_unpacked() -> None:
    channel = record(Op.CHANNEL, struct.pack("<HH", 1, 0) + text("/a") + text("") + struct.pack("<I", 0))
    messages = [record(Op.MESSAGE, struct.pack("<HIQQ", 1, 0, 0, 0) + bytes([k]) * 100) for k in range(9)]
    data = channel + b"".join(messages)
    streaming = zstandard.ZstdCompressor().compressobj()
    unsized = streaming.compress(data) + streaming.flush()
    assert zstandard.frame_content_size(unsized) == -1
    several = zstandard.compress(data[:333]) + zstandard.compress(data[333:])
    lz4_parts = [lz4.frame.compress(part, store_size=bool(part)) for part in (data[:5], b"", data[5:700], data[700:])]
    for packed, kind in ((unsized, "zstd"), (several, "zstd"), (b"".join(lz4_parts), "lz4")):
        part = chunk(len(data), packed, kind, crc=0)
        with McapLog("frames.mcap", data=ended(HEADER + part)) as log:
            (run,) = [run for part in log.chunks for run in log.runs(part)]
        assert run.messages() == [bytes([k]) * 100 for k in range(9)]
        for wrong in (len(data) - 1, len(data) + 1):
            part = chunk(wrong, packed, kind, crc=0)
            with pytest.raises(RecordingError, match="does not unpack to the size"):
                McapLog("frames.mcap", data=ended(HEADER + part))


def test_an_absent_file_a_folder_and_a_pipe_are_refused(tmp_path: Path) -> None:
    for path in (tmp_path / "none.mcap", tmp_path):
        with pytest.raises(RecordingError, match="cannot be read"):
            McapLog(path)
    os.mkfifo(tmp_path / "pipe")  # whoever opens it waits for a writer
    with pytest.raises(RecordingError, match="is a pipe or a device"):
        McapLog(tmp_path / "pipe")


def test_messages_outside_chunks_keep_their_order(tmp_path: Path) -> None:
    path = tmp_path / "loose.mcap"
    library_file(path, CompressionType.NONE, use_chunking=False)
    with McapLog(path) as log:
        times = [run.time for part in log.chunks for run in log.runs(part)]
    assert sum(map(len, times)) == 134
    assert all((np.diff(time) > 0).all() for time in times)


def test_a_file_gets_its_name_only_when_it_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "a.bin"
    file = PartFile(path, overwrite=False)
    file.write(b"one")
    assert file.part.exists() and not path.exists()
    file.finish()
    assert file.part.read_bytes() == b"one" and not path.exists()
    file.commit()
    assert path.read_bytes() == b"one" and not file.part.exists()
    with pytest.raises(RecordingExistsError):
        PartFile(path, overwrite=False)
    other = PartFile(path, overwrite=True)
    other.write(b"two")
    other.discard()
    assert path.read_bytes() == b"one" and not other.part.exists()
    with pytest.raises(WriteError):
        PartFile(path / "below_a_file.bin", overwrite=False)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs a device that is always full")
def test_a_full_disk_is_an_error_that_says_so(tmp_path: Path) -> None:
    path = tmp_path / "a.bin"
    (tmp_path / "a.bin.part").symlink_to("/dev/full")
    file = PartFile(path, overwrite=False)
    with pytest.raises(WriteError, match="No space left"):
        for _ in range(100):
            file.write(bytes(100_000))
            file.flush()
    file.discard()
    assert not (tmp_path / "a.bin.part").is_symlink()
