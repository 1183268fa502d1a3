"""Slim recordings: complete but for the meshes, which stand once by SHA-256 in a folder that many recordings share.

A slim recording is a recording like any other, readable by the same readers and equal to the whole one in every
message; only the attachments that are no text are missing, and its provenance still names their digests.
"""

from __future__ import annotations

import re
import stat
import struct
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

import numpy as np

from replay import limits
from replay.errors import RecordingError
from replay.lfs_pointer import LFS_POINTER, is_lfs_pointer
from replay.logs.mcap_chunks import records, unpack
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import MESSAGE_HEAD, PREAMBLE, RECORD_HEAD, Chunk, Op
from replay.logs.mcap_writer import McapFileWriter
from replay.logs.part_file import UNFINISHED, PartFile, write_file
from replay.recording.provenance import Provenance, sha256
from replay.recording.reader import read_files, read_provenance

OBJECTS = "objects"
"""Name of the folder that holds the files of slim recordings by SHA-256; it stands above them."""

_TEXTS = (".yaml", ".yml")
_DIGEST = re.compile("[0-9a-f]{64}")


def write_slim(recording: Path, target: Path, objects: Path) -> tuple[str, ...]:
    """Write a recording without its meshes, and the meshes by their digests.

    Args:
        recording: a whole recording: every file that its provenance states is attached, or in a folder of objects.
        target: the slim one; replaced when it exists.
        objects: folder for the meshes; one that is there already stays, unless it is damaged.

    Returns:
        The digests of the meshes that the recording needs.

    Raises:
        RecordingError: the recording cannot be read, or lacks a file or has another one than it states.
        WriteError: a file cannot be written.
    """
    needed = []
    with McapLog(recording) as log:
        files = _all_files(log, read_provenance(log))
        file = PartFile(target, overwrite=True)
        try:
            writer = McapFileWriter(file, log.library)
            for name, values in log.metadata:
                if name != PREAMBLE:
                    writer.metadata(name, values)
            kinds = {attachment.name: attachment.media_type for attachment in log.attachments}
            for name, data in files.items():
                if PurePosixPath(name).suffix.lower() in _TEXTS:
                    writer.attachment(name, kinds.get(name, ""), data)
                else:
                    needed.append(_put(data, objects))
            schemas = {number: writer.schema(schema) for number, schema in sorted(log.schemas.items())}
            channels = {
                number: writer.channel(channel.topic, schemas[channel.schema_id])
                for number, channel in sorted(log.channels.items())
                if channel.schema_id in schemas
            }
            writer.end_preamble()
            for chunk in log.chunks:
                _copy(log, chunk, writer, channels)
            writer.finish()
            file.commit()
        except BaseException:
            file.discard()
            raise
    return tuple(sorted(needed))


def attached_files(recording: Path) -> tuple[str, str, dict[str, bytes]]:
    """Return a recording's scenario: its name, its main file's name, and every file that it needs.

    Files that a slim recording lacks are taken from the folder `objects` that stands in one of the folders above it.
    Of an unfinished recording (`.part`), what comes before its frames is enough.

    Raises:
        RecordingError: the recording cannot be read, or a file is not there or not the one that was used.
    """
    with McapLog(recording, salvage=recording.suffix == UNFINISHED) as log:
        if log.loss is not None and not log.preamble_holds:
            raise RecordingError(str(recording), f"nothing can be salvaged: {log.loss.reason}")
        provenance = read_provenance(log)
        return provenance.scenario, provenance.root, _all_files(log, provenance)


def is_digest(name: str) -> bool:
    """Return whether a name is one that files in `OBJECTS` have."""
    return _DIGEST.fullmatch(name) is not None


def _all_files(log: McapLog, provenance: Provenance) -> dict[str, bytes]:
    files = read_files(log, provenance)
    for name, digest in provenance.files.items():
        if name not in files:
            files[name] = _object(log.path, name, digest)
    return files


def _put(data: bytes, objects: Path) -> str:
    digest = sha256(data)
    place = objects / digest
    if not _holds(place, data):
        write_file(place, data)
    return digest


def _holds(file: Path, data: bytes) -> bool:
    plain = not file.is_symlink() and file.is_file()
    return plain and file.stat().st_size == len(data) and file.read_bytes() == data


def _object(recording: Path, name: str, digest: str) -> bytes:
    if not is_digest(digest):
        raise RecordingError(str(recording), f"damaged: what its metadata states of {name!r} is no SHA-256")
    unread: RecordingError | None = None
    for place in (folder / OBJECTS / digest for folder in recording.absolute().parents):
        try:
            found = place.stat()
            if not stat.S_ISREG(found.st_mode):
                continue
            if found.st_size > limits.FILE:
                raise RecordingError(str(place), f"has {found.st_size} bytes; at most {limits.FILE} are read")
            data = place.read_bytes()
            break
        except (FileNotFoundError, NotADirectoryError):
            continue
        except OSError as error:  # it may stand in a folder further up
            unread = unread or RecordingError(str(place), f"{name!r} cannot be read: {error.strerror}")
    else:
        rule = f"needs {name!r}, which is neither attached nor in a folder {OBJECTS!r}"
        raise unread or RecordingError(str(recording), rule)
    if is_lfs_pointer(data):
        raise RecordingError(str(place), LFS_POINTER)
    if sha256(data) != digest:
        raise RecordingError(str(place), "damaged: its SHA-256 is not its name")
    return data


def _copy(log: McapLog, chunk: Chunk, writer: McapFileWriter, channels: Mapping[int, int]) -> None:
    """Write the messages of a chunk under the channels' new numbers; as it is, where that is the same."""
    with log.path.open("rb") as file:
        file.seek(chunk.begin)
        packed = file.read(chunk.compressed_size)
    data = unpack(str(log.path), chunk, packed)
    found: dict[int, list[tuple[int, int, int, int]]] = {}
    only_messages = True
    for op, begin, end in records(str(log.path), data, log.work.most_records):
        if op == Op.MESSAGE and end - begin >= MESSAGE_HEAD:
            channel, sequence, time = struct.unpack_from("<HIQ", data, begin)
            found.setdefault(channel, []).append((begin, end, sequence, time))
        only_messages = only_messages and op == Op.MESSAGE
    ours = only_messages and len(found) == 1 and chunk.compression == "zstd"
    for number, messages in found.items():
        if number not in channels:
            continue
        begins, ends, sequences, times = zip(*messages, strict=True)
        if ours and channels[number] == number:
            offsets = np.array(begins, dtype=np.uint64) - np.uint64(RECORD_HEAD)
            writer.packed(number, np.array(times, dtype=np.int64), offsets, data, packed)
        else:
            bodies = [data[begin + MESSAGE_HEAD : end] for begin, end in zip(begins, ends, strict=True)]
            writer.messages(channels[number], times, sequences, bodies)
