"""ROS bags as logs of messages: ROS 1's .bag through `rosbags`, ROS 2's .db3 as the database that it is."""

from __future__ import annotations

import bz2
import contextlib
import functools
import io
import json
import sqlite3
from collections.abc import Callable, Collection, Iterator, Sequence
from typing import Any

from replay import limits
from replay.errors import RecordingError
from replay.logs.mcap_records import Channel, Schema
from replay.logs.message_log import Message, MessageLog
from replay.logs.ros_schema import long_name


def ros1_bag(name: str, data: bytes) -> MessageLog:
    """Return the log that a ROS 1 bag (version 2.0) holds; RecordingError when it is damaged or has no index."""
    return _checked(name, "a ROS 1 bag", lambda: _ros1_bag(data))


def ros2_bag(name: str, data: bytes) -> MessageLog:
    """Return the log that a ROS 2 bag's .db3 file holds; RecordingError when it is damaged."""
    return _checked(name, "a ROS 2 bag", lambda: _ros2_bag(data))


def _ros1_bag(data: bytes) -> MessageLog:
    import lz4.frame  # type: ignore[import-untyped]
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag1.reader import decompressors

    unpackers = {"bz2": bz2.BZ2Decompressor, "lz4": lz4.frame.LZ4FrameDecompressor}
    kinds = {decompressors[name]: unpacker for name, unpacker in unpackers.items()}

    reader = Reader(_InMemory(data))  # type: ignore[arg-type]
    reader.open()
    unpack = _Unpacker(len(data))
    for place, chunk in reader.chunks.items():
        kind = kinds.get(chunk.decompressor)
        if kind is not None:
            reader.chunks[place] = chunk._replace(decompressor=functools.partial(unpack, kind))
    channels, schemas = {}, {}
    for connection in reader.connections:
        name = connection.msgtype.replace("/msg/", "/")
        schemas[connection.id + 1] = Schema(name, "ros1msg", connection.msgdef.data.encode())
        channels[connection.id] = Channel(connection.id, connection.id + 1, connection.topic, "ros1", {})

    def messages(wanted: Collection[int]) -> Iterator[Message]:
        chosen = [connection for connection in reader.connections if connection.id in wanted]
        for connection, time, message in reader.messages(chosen) if chosen else ():
            yield Message(connection.id, time, bytes(message))

    return MessageLog(channels, schemas, messages)


def _ros2_bag(data: bytes) -> MessageLog:
    definitions: dict[str, tuple[str, str]] = {}
    channels: dict[int, Channel] = {}
    schemas: dict[int, Schema] = {}
    with _database(data) as database:
        if database.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
            raise sqlite3.DatabaseError("its pages contradict one another")
        kinds = dict(database.execute("SELECT name, type || ':' || ifnull(rootpage, 0) FROM sqlite_master"))
        if any(not kind.startswith(("table:", "index:")) or kind == "table:0" for kind in kinds.values()):
            raise sqlite3.DatabaseError("it holds more than tables")
        for table in ("topics", "messages", "message_definitions"):
            if any(row[6] for row in database.execute(f"PRAGMA table_xinfo({table})")):
                raise sqlite3.DatabaseError(f"its table {table} is computed")
        if "message_definitions" in kinds:
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            definitions = {row[0]: row[1:] for row in _rows(database, query, str, str, str)}
        for number, topic, kind, encoding in _rows(
            database, "SELECT id, name, type, serialization_format FROM topics", int, str, str, str
        ):
            if len(channels) >= limits.CHANNELS:
                raise ValueError(f"it has more than {limits.CHANNELS} topics")
            language, text = definitions.get(kind, ("ros2msg", ""))
            schemas[number] = Schema(long_name(kind), language, text.encode())
            channels[number] = Channel(number, number, topic, encoding, {})

    def messages(wanted: Collection[int]) -> Iterator[Message]:
        query = "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN (SELECT value FROM json_each(?))"
        with _database(data) as database:
            ordered = f"{query} ORDER BY timestamp, id"
            for channel, time, message in _rows(database, ordered, int, int, bytes, values=[json.dumps([*wanted])]):
                yield Message(channel, time, message)

    return MessageLog(channels, schemas, messages)


def _rows(database: sqlite3.Connection, query: str, *kinds: type, values: Sequence[Any] = ()) -> Iterator[Any]:
    """Yield the rows of a query; ValueError where one has values of other types, which SQLite lets into any column."""
    for row in database.execute(query, values):
        if not all(isinstance(value, kind) for value, kind in zip(row, kinds, strict=True)):
            raise ValueError("a row of it holds values of other types than a bag has")
        yield row


@contextlib.contextmanager
def _database(data: bytes) -> Iterator[sqlite3.Connection]:
    with contextlib.closing(sqlite3.connect(":memory:")) as database:
        if data[18:20] == b"\2\2":  # written ahead into a second file, which there is none of in memory
            data = data[:18] + b"\1\1" + data[20:]
        database.deserialize(data)
        database.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, limits.CHUNK)
        steps = iter(range(limits.database_steps(len(data)) // _STEPS))
        database.set_progress_handler(lambda: next(steps, None) is None, _STEPS)
        yield database


def _checked(name: str, what: str, make: Callable[[], MessageLog]) -> MessageLog:
    """Return a bag's log, whose library fails in ways of its own on bytes that are not such a bag."""

    def messages(wanted: Collection[int]) -> Iterator[Message]:
        try:
            yield from log.messages(wanted)
        except Exception as error:
            raise RecordingError(name, f"damaged: its messages cannot be read ({_told(error)})") from None

    try:
        log = make()
    except Exception as error:
        raise RecordingError(name, f"cannot be read as {what}: {_told(error)}") from None
    return MessageLog(log.channels, log.schemas, messages)


def _told(error: Exception) -> str:
    return str(error).partition("\n")[0].rstrip(".") or type(error).__name__


_STEPS = 10_000  # of SQLite's machine between two looks at how many there were


class _Unpacker:
    """Unpacks the chunks of a bag up to the bytes that are read of a bag of its size."""

    def __init__(self, size: int) -> None:
        self._left = self._most = limits.unpacked(size)

    def __call__(self, kind: Callable[[], Any], data: bytes) -> bytes:
        found: bytes = kind().decompress(data, max_length=self._left + 1)
        self._left -= len(found)
        if self._left < 0:
            raise ValueError(f"it unpacks to more than the {self._most} bytes that are read of a bag of its size")
        return found


class _InMemory:
    """Bytes as a path that `rosbags` opens."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def exists(self) -> bool:
        return True

    def open(self, *_: Any, **__: Any) -> io.BytesIO:
        return _CountedFile(self._data)


class _CountedFile(io.BytesIO):
    """A file that is not read again and again, as an index asks for that names one place a thousand times."""

    def __init__(self, data: bytes) -> None:
        super().__init__(data)
        self._left = limits.reads(len(data))

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        self._left -= len(data) + 1
        if self._left < 0:
            raise ValueError("it asks for the same bytes again and again")
        return data
