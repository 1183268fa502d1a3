"""Topics of a log as columns: strided where all messages have one shape, else message by message."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from google.protobuf.message import DecodeError, Message
from numpy.typing import NDArray

from replay import limits
from replay.errors import LimitError, RecordingError
from replay.logs.mcap_chunks import MessageRun
from replay.logs.mcap_reader import McapLog
from replay.logs.protobuf import message_type
from replay.logs.wire import MessageShape, shape_of
from replay.numerics.arrays import Integers


@dataclass(frozen=True, eq=False)
class Topic:
    """All messages of one topic.

    Attributes:
        name: the topic.
        schema: name of the message type.
        time: (n,) log times [ns], in the order of time.
        columns: by field path, such as "joints[2].position": (n,) or (n, count) values.
        texts: texts and byte strings by field path, when they are the same in every message.
        messages: the decoded messages when they have no common shape (then `columns` is empty), else None.
    """

    name: str
    schema: str
    time: Integers
    columns: dict[str, NDArray[Any]]
    texts: Mapping[str, str | bytes]
    messages: tuple[Message, ...] | None


def read_topics(log: McapLog, topics: Collection[str] | None = None) -> dict[str, Topic]:
    """Return topics of a log (all when None) in one pass over their chunks.

    Raises:
        RecordingError: damage, a topic that is not protobuf, a message that its schema does not describe, or a
            number of messages other than the statistics say.
    """
    room = _Room(log)
    wanted = {
        channel.id: _ChannelReader(log, channel.id, room)
        for channel in sorted(log.channels.values(), key=lambda channel: channel.topic)
        if topics is None or channel.topic in topics
    }
    _pass(log, wanted)
    irregular = {channel: reader for channel, reader in wanted.items() if not reader.regular}
    for reader in irregular.values():
        reader.restart()
    _pass(log, irregular)
    result: dict[str, Topic] = {}
    for reader in wanted.values():
        topic = reader.topic()
        if topic.name in result:
            raise RecordingError(str(log.path), f"topic {topic.name!r} is spread over several channels")
        result[topic.name] = topic
    return result


def _pass(log: McapLog, wanted: Mapping[int, _ChannelReader]) -> None:
    for chunk in log.chunks_with(wanted):
        for run in log.runs(chunk):
            if run.channel in wanted:
                wanted[run.channel].add(run)


class _Room:
    """The bytes that the columns of a log may take together, and the fields that may be taken out of its chunks."""

    def __init__(self, log: McapLog) -> None:
        self._log = log
        self._bytes = 0
        self._fields = 0

    def take(self, size: int) -> None:
        """Count bytes, or give them back; LimitError when all together are too many."""
        self._bytes += size
        most = limits.columns(self._log.size)
        if self._bytes > most:
            rule = f"holds more than {most} bytes of values, the most that are read of a file of its size"
            raise LimitError(str(self._log.path), rule)

    def visit(self, fields: int) -> None:
        """Count the fields that are taken out of a chunk; LimitError when all together are too many."""
        self._fields += fields
        most = limits.visits(self._log.size)
        if self._fields > most:
            rule = f"holds messages of so many fields that more than {most} would be taken out of its chunks"
            raise LimitError(str(self._log.path), rule)


class _ChannelReader:
    """Collects the runs of one channel: as columns, until one does not fit; then everything again as messages."""

    def __init__(self, log: McapLog, channel: int, room: _Room) -> None:
        self.regular = True
        self._room_left = room
        self._log = log
        self._channel = log.channels[channel]
        self.name = self._channel.topic
        self._file = str(log.path)
        schema = log.schemas.get(self._channel.schema_id)
        if self._channel.encoding != "protobuf" or schema is None or schema.encoding != "protobuf":
            raise RecordingError(self._file, f"topic {self.name!r} is not protobuf with a schema")
        self._schema = schema
        self._type = message_type(self._file, schema.name, schema.data)
        self._expected = log.count_of(channel)
        self.restart()
        self._decoding = False

    def restart(self) -> None:
        """Forget what was read, and decode message by message from now on."""
        self._room_left.take(-sum(column.nbytes for column in getattr(self, "_columns", {}).values()))
        self._decoded = 0
        self._times: list[Integers] = []
        self._shape: MessageShape | None = None
        self._columns: dict[str, NDArray[Any]] = {}
        self._count = 0
        self._messages: list[Message] = []
        self._decoding = True

    def add(self, run: MessageRun) -> None:
        """Take the next run."""
        if self._decoding:
            self._times.append(run.time)
            self._decoded += sum(map(len, run.payloads)) if run.rows is None else run.rows.size
            if self._decoded > limits.irregular(self._log.size):
                most = limits.irregular(self._log.size)
                rule = f"topic {self.name!r} holds more than {most} bytes in messages without a common layout"
                raise LimitError(self._file, rule)
            self._messages.extend(self._decode(data) for data in run.messages())
        elif self.regular:
            self._times.append(run.time)
            self.regular = self._add_rows(run)

    def topic(self) -> Topic:
        """Return what was read; RecordingError when the statistics count another number of messages."""
        count = sum(len(time) for time in self._times)
        if self._expected is not None and self._expected != count:
            raise RecordingError(
                self._file, f"damaged: topic {self.name!r} holds {count} messages, not as many as counted"
            )
        time = np.concatenate(self._times) if self._times else np.zeros(0, dtype=np.int64)
        columns = {path: column[: self._count] for path, column in self._columns.items()}
        texts = self._shape.texts if self._shape else {}
        messages = tuple(self._messages) if self._decoding else None
        if bool((time[1:] < time[:-1]).any()):  # written anew in another order
            order = np.argsort(time, kind="stable")
            time, columns = time[order], {path: column[order] for path, column in columns.items()}
            messages = None if messages is None else tuple(messages[row] for row in order.tolist())
        return Topic(self.name, self._schema.name, time, columns, texts, messages)

    def _add_rows(self, run: MessageRun) -> bool:
        if run.rows is None:
            return False
        if self._shape is None:
            self._shape = shape_of(self._type.DESCRIPTOR, run.rows[0].tobytes())
        if self._shape is None or not self._shape.fits(run.rows):
            return False
        begin, end = self._count, self._count + len(run.rows)
        self._room_left.visit(len(self._shape.slots))
        for path, slot in self._shape.slots.items():
            values = slot.read(run.rows)
            self._room(path, values, end)[begin:end] = values
        self._count = end
        return True

    def _room(self, path: str, values: NDArray[Any], end: int) -> NDArray[Any]:
        """Return a column that has room for `end` rows; it grows by steps, up to what the statistics promise."""
        column = self._columns.get(path)
        if column is None or len(column) < end:
            rows = max(end, min(self._expected, 8 * end) if self._expected else 2 * end)
            self._room_left.take((rows - len(column if column is not None else ())) * values[:1].nbytes)
            grown = np.empty((rows, *values.shape[1:]), dtype=values.dtype)
            if column is not None:
                grown[: len(column)] = column
            self._columns[path] = column = grown
        return column

    def _decode(self, data: bytes) -> Message:
        try:
            return self._type.FromString(data)
        except DecodeError as error:
            raise RecordingError(
                self._file, f"topic {self.name!r} holds a message that its schema cannot read: {error}"
            ) from None
