"""Recordings written anew by the `mcap` library: every record is kept, nothing lies where it lay."""

from __future__ import annotations

import io
import random
from collections.abc import Mapping
from typing import Any, Literal

from mcap.reader import make_reader
from mcap.writer import Writer

Order = Literal["log time", "reversed", "shuffled"]


def rewritten(
    recording: bytes,
    *,
    order: Order = "log time",
    seed: int = 1,
    extra: Mapping[str, bytes] | None = None,
    attached: Mapping[str, bytes] | None = None,
    **options: Any,
) -> bytes:
    """Return a recording as the library writes it.

    Args:
        recording: the bytes of one.
        order: of the messages.
        seed: for shuffling.
        extra: messages of a tool of its own, by topic, without a schema.
        attached: other content of attachments, by name, also of new ones.
        options: of `mcap.writer.Writer`.
    """
    reader = make_reader(io.BytesIO(recording))
    out = io.BytesIO()
    writer = Writer(out, **options)
    header = reader.get_header()
    writer.start(header.profile, header.library)
    more = dict(attached or {})
    for found in reversed(list(reader.iter_attachments())):
        data = more.pop(found.name, found.data)
        writer.add_attachment(found.create_time, found.log_time, found.name, found.media_type, data)
    for name, data in more.items():
        writer.add_attachment(0, 0, name, "", data)
    messages = list(reader.iter_messages())
    if order == "reversed":
        messages.reverse()
    elif order == "shuffled":
        random.Random(seed).shuffle(messages)
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    for schema, channel, message in messages:
        assert schema is not None
        if schema.id not in schemas:
            schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
        if channel.id not in channels:
            channels[channel.id] = writer.register_channel(
                channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata
            )
        writer.add_message(channels[channel.id], message.log_time, message.data, message.publish_time, message.sequence)
    for topic, data in (extra or {}).items():
        writer.add_message(writer.register_channel(topic, "", 0), 0, data, 0)
    for metadata in reader.iter_metadata():
        writer.add_metadata(metadata.name, metadata.metadata)
    summary = reader.get_summary()
    assert summary is not None
    for number, channel in summary.channels.items():  # those without messages
        if number not in channels:
            schema = summary.schemas[channel.schema_id]
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            writer.register_channel(channel.topic, channel.message_encoding, schemas[schema.id], channel.metadata)
    writer.finish()
    return out.getvalue()
