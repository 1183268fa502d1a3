"""Recording files with one thing changed in them: every other message stays the same bytes."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import PREAMBLE, Schema
from replay.logs.mcap_writer import McapFileWriter
from replay.logs.part_file import PartFile
from replay.logs.protobuf import message_type
from replay.logs.wire import shape_of
from replay.recording.provenance import RECORD


@dataclass(frozen=True)
class Edit:
    """A new value of one field in one frame; `index` picks an element of an array field."""

    topic: str
    path: str
    frame: int
    value: Callable[[Any], Any]
    index: int | None = None


def write(
    source: Path,
    target: Path,
    edits: Iterable[Edit] = (),
    *,
    rename: Callable[[str], str | None] = lambda topic: topic,
    provenance: Callable[[dict[str, Any]], None] = lambda known: None,
    schema: Callable[[Schema], Schema] = lambda schema: schema,
) -> Path:
    """Write a recording again.

    Args:
        source, target: files.
        edits: values to change.
        rename: new name of a topic, or None to leave it out.
        provenance: changes the metadata in place.
        schema: what stands in place of a schema; messages are not written anew for it.
    """
    with McapLog(source) as log:
        file = PartFile(target, overwrite=True)
        writer = McapFileWriter(file, log.library)
        for name, texts in log.metadata:
            if name == RECORD:
                known = {key: json.loads(text) for key, text in texts.items()}
                provenance(known)
                texts = {key: json.dumps(value, sort_keys=True, ensure_ascii=False) for key, value in known.items()}
            if name != PREAMBLE:
                writer.metadata(name, texts)
        for attachment in log.attachments:
            writer.attachment(attachment.name, attachment.media_type, log.attachment(attachment))
        for _, before in sorted(log.schemas.items()):
            writer.schema(schema(before))
        numbers = {}
        for old, channel in sorted(log.channels.items()):
            name = rename(channel.topic)
            if name is not None:
                numbers[old] = writer.channel(name, channel.schema_id)
        writer.end_preamble()
        first = dict.fromkeys(log.channels, 0)
        for chunk in log.chunks:
            (run,) = log.runs(chunk)
            channel, begin = log.channels[run.channel], first[run.channel]
            first[run.channel] += len(run.time)
            messages = run.messages()
            for item in edits:
                k = item.frame - begin
                if item.topic == channel.topic and 0 <= k < len(messages):
                    kind = log.schemas[channel.schema_id]
                    messages[k] = _edited(message_type(str(source), kind.name, kind.data), messages[k], item)
            if run.channel in numbers:
                sequence = range(begin, begin + len(messages))
                writer.messages(numbers[run.channel], run.time.tolist(), sequence, messages)
        writer.finish()
        file.commit()
    return target


def _edited(kind: Any, message: bytes, item: Edit) -> bytes:

    shape = shape_of(kind.DESCRIPTOR, message)
    assert shape is not None
    rows = np.frombuffer(message, dtype=np.uint8).copy()[None]
    values = shape.slots[item.path].read(rows).copy()
    at = 0 if item.index is None else (0, item.index)
    values[at] = item.value(values[at])
    shape.slots[item.path].write(rows, values)
    return rows.tobytes()
