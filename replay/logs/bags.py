"""ROS bags as logs of messages: ROS 1's .bag through `rosbags`, ROS 2's .db3 as the database that it is."""

from __future__ import annotations

import contextlib
import io
import json
import sqlite3
from collections.abc import Callable, Collection, Iterator
from typing import Any

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
    from rosbags.rosbag1 import Reader

    reader = Reader(_InMemory(data))  # type: ignore[arg-type]
    reader.open()
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
    channels, schemas = {}, {}
    with _database(data) as database:
        if database.execute("PRAGMA quick_check(1)").fetchone() != ("ok",):
            raise sqlite3.DatabaseError("its pages contradict one another")
        tables = {row[0] for row in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if "message_definitions" in tables:
            query = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions"
            definitions = {row[0]: row[1:] for row in database.execute(query)}
        for number, topic, kind, encoding in database.execute(
            "SELECT id, name, type, serialization_format FROM topics"
        ):
            language, text = definitions.get(kind, ("ros2msg", ""))
            schemas[number] = Schema(long_name(kind), language, text.encode())
            channels[number] = Channel(number, number, topic, encoding, {})

    def messages(wanted: Collection[int]) -> Iterator[Message]:
        query = "SELECT topic_id, timestamp, data FROM messages WHERE topic_id IN (SELECT value FROM json_each(?))"
        with _database(data) as database:
            for channel, time, message in database.execute(f"{query} ORDER BY timestamp, id", [json.dumps([*wanted])]):
                yield Message(channel, time, message)

    return MessageLog(channels, schemas, messages)


@contextlib.contextmanager
def _database(data: bytes) -> Iterator[sqlite3.Connection]:
    with contextlib.closing(sqlite3.connect(":memory:")) as database:
        if data[18:20] == b"\2\2":  # written ahead into a second file, which there is none of in memory
            data = data[:18] + b"\1\1" + data[20:]
        database.deserialize(data)
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


class _InMemory:
    """Bytes as a path that `rosbags` opens."""

    def __init__(self, data: bytes) -> None:
        self._data = data

    def exists(self) -> bool:
        return True

    def open(self, *_: Any, **__: Any) -> io.BytesIO:
        return io.BytesIO(self._data)
