"""What a recording keeps of a long log: some of its messages, bit by bit, in an MCAP file that reads as the log does.

The bytes depend on the messages and the note alone, so that cutting an excerpt once more gives the same file.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

from replay.logs.mcap_records import Schema
from replay.logs.mcap_writer import McapFileWriter
from replay.logs.message_log import Message, MessageLog

EXCERPT = "excerpt"
"""Name of the metadata record with the note on where the messages come from: `name` and `sha256`."""


class _Bytes(bytearray):
    def write(self, data: bytes | memoryview, /) -> None:
        self.extend(data)


def joined(first: bytes, second: bytes, open_log: Callable[[bytes], MessageLog]) -> bytes:
    """Return what two excerpts of one log hold as one; a message that is in both stands there once.

    Args:
        first, second: as of `write_messages`, with the same note.
        open_log: returns the log that a file holds.
    """
    log, other = open_log(first), open_log(second)
    known = {**log.channels, **other.channels}
    schemas: dict[int, Schema] = {}
    channels = {}
    for number, channel in known.items():  # the same schema has another number in the other file
        schema = (log if number in log.channels else other).schema(channel)
        channels[number] = replace(channel, schema_id=number + 1 if schema is not None else 0)
        schemas |= {} if schema is None else {number + 1: schema}
    found = dict.fromkeys(message for one in (log, other) for message in one.messages(one.channels.keys()))
    messages = sorted(found, key=lambda message: message.time)
    return write_messages(messages, MessageLog(channels, schemas, other.messages), log.metadata[EXCERPT])


def write_messages(messages: Sequence[Message], log: MessageLog, origin: Mapping[str, str]) -> bytes:
    """Return an MCAP file that holds some messages of a log, channel by channel, and a note on the log.

    Args:
        messages: in the order of their log times.
        log: whose messages they are; its channels keep their ids.
        origin: the note.
    """
    sink = _Bytes()
    writer = McapFileWriter(sink, "replay")
    writer.metadata(EXCERPT, origin)
    used = sorted({message.channel for message in messages})
    schemas: dict[Schema | None, int] = {None: 0}
    for number in used:
        channel = log.channels[number]
        schema = log.schema(channel)
        if schema is not None and schema not in schemas:
            schemas[schema] = writer.schema(schema)
        writer.channel(channel.topic, schemas[schema], encoding=channel.encoding, number=number)
    writer.end_preamble()
    for number in used:
        mine = [message for message in messages if message.channel == number]
        writer.messages(number, [m.time for m in mine], range(len(mine)), [m.data for m in mine])
    writer.finish()
    return bytes(sink)
