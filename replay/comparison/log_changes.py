"""What two files say apart from their columns: scene, schemas, and which topics are the same bytes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, BinaryIO

from google.protobuf.descriptor import FieldDescriptor
from google.protobuf.message import DecodeError

from replay import limits
from replay.comparison.difference import Change
from replay.comparison.signals import SCHEMAS
from replay.errors import LimitError, RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import Chunk
from replay.logs.protobuf import fields_of, message_type
from replay.recording import messages
from replay.recording.event_messages import TOPIC as EVENTS
from replay.recording.event_messages import read_events
from replay.recording.events import Events
from replay.recording.layout_message import TOPIC as LAYOUT

SCENE = "/scene"
"""The topic of the scene; begins the name of a body in changes and rules: `/scene/arc/bow`."""


def equal_topics(a: McapLog, b: McapLog) -> frozenset[str]:
    """Return the topics whose messages are the same in two files, because their chunks are the same bytes.

    Nothing is unpacked for it. A topic that is not among them may be the same all the same.
    """
    chunks_a, chunks_b = _chunks_by_channel(a), _chunks_by_channel(b)
    equal = []
    with a.path.open("rb") as file_a, b.path.open("rb") as file_b:
        for number, channel in a.channels.items():
            if channel != b.channels.get(number) or a.schemas.get(channel.schema_id) != b.schemas.get(
                channel.schema_id
            ):
                continue
            mine, others = chunks_a.get(number, []), chunks_b.get(number, [])
            if [_packing(chunk) for chunk in mine] == [_packing(chunk) for chunk in others] and all(
                _packed(file_a, x) == _packed(file_b, y) for x, y in zip(mine, others, strict=True)
            ):
                equal.append(channel.topic)
    return frozenset(equal if chunks_a and chunks_b else ())


def same_messages(a: Path, b: Path) -> bool:
    """Return whether two files hold the same messages in all topics, as the same bytes; errors as of `McapLog`.

    The names behind the arrays count by what the arrays hold: older recordings have them in their metadata alone.
    """
    with McapLog(a) as log_a, McapLog(b) as log_b:
        topics = [{channel.topic for channel in log.channels.values()} - {LAYOUT} for log in (log_a, log_b)]
        return topics[0] == topics[1] == equal_topics(log_a, log_b) - {LAYOUT}


def same_events_of(a: McapLog, b: McapLog, topic: str) -> bool:
    """Return whether two files tell the same events of a topic; one without events tells none."""
    told = []
    for log in (a, b):
        found = [channel for channel in log.channels.values() if channel.topic == EVENTS]
        told.append(read_events(log).of_source(topic) if found else Events.none())
    return told[0] == told[1]


def _chunks_by_channel(log: McapLog) -> dict[int, list[Chunk]]:
    """Return the chunks of each channel; nothing for a file that is not laid out as replay writes recordings."""
    found: dict[int, list[Chunk]] = {}
    for chunk in log.chunks:
        if len(chunk.channels) != 1:
            return {}
        found.setdefault(chunk.channels[0], []).append(chunk)
    return found


def _packing(chunk: Chunk) -> tuple[str, int, int]:
    return chunk.compression, chunk.uncompressed_size, chunk.compressed_size


def _packed(file: BinaryIO, chunk: Chunk) -> bytes:
    file.seek(chunk.begin)
    return file.read(chunk.compressed_size)


def scene_changes(a: McapLog, b: McapLog) -> tuple[Change, ...]:
    """Return the bodies of the scene that differ, by name: their shape, their colour, or the link that they are on.

    A scene that only one file has is one change.
    """
    bodies_a, bodies_b = _bodies(a), _bodies(b)
    if bodies_a is None or bodies_b is None:
        counts = (None if bodies is None else f"{len(bodies)} bodies" for bodies in (bodies_a, bodies_b))
        return () if bodies_a is bodies_b else (Change(SCENE, *counts),)
    return tuple(_changes(SCENE, bodies_a, bodies_b))


def schema_changes(a: McapLog, b: McapLog) -> tuple[tuple[Change, ...], tuple[Change, ...]]:
    """Return the fields of topics that are lost or have another type, and those that are new.

    A new field takes nothing from those who read the others, so it is told and does not decide.
    """
    fields_a, fields_b = _fields(a), _fields(b)
    topics = {name.split(" ")[0] for name in fields_a} & {name.split(" ")[0] for name in fields_b}
    changes = [
        change
        for change in _changes(SCHEMAS, fields_a, fields_b)
        if change.name.removeprefix(SCHEMAS).split(" ")[0] in topics
    ]
    named = [Change(change.name.replace(" ", "/"), change.baseline, change.candidate) for change in changes]
    return (
        tuple(change for change in named if change.baseline is not None),
        tuple(change for change in named if change.baseline is None),
    )


def _changes(prefix: str, a: Mapping[str, str], b: Mapping[str, str]) -> Iterator[Change]:
    for name in sorted({*a, *b}):
        if a.get(name) != b.get(name):
            yield Change(f"{prefix}{name}", a.get(name), b.get(name))


def read_scene(path: Path) -> Any:
    """Return the foxglove.SceneUpdate of a recording file, or None when there is no such file or no scene in it."""
    if not path.is_file():
        return None
    with McapLog(path) as log:
        return _scene(log)


def _scene(log: McapLog) -> Any:
    channels = [channel.id for channel in log.channels.values() if channel.topic == SCENE]
    for chunk in log.chunks if channels else ():
        for run in log.runs(chunk):
            if run.channel in channels:
                return _decoded(log, run.messages()[-1])
    return None


def _decoded(log: McapLog, data: bytes) -> Any:
    """Return a scene; RecordingError where it is none, or larger than is read of a file of its size."""
    if len(data) > limits.scene(log.size):
        raise LimitError(str(log.path), f"has a scene of {len(data)} bytes; at most {limits.scene(log.size)} are read")
    try:
        return messages.message_class(messages.SCENE).FromString(data)
    except DecodeError as error:
        raise RecordingError(str(log.path), f"damaged: topic {SCENE!r} holds no scene: {error}") from None


def _bodies(log: McapLog) -> dict[str, str] | None:
    scene = _scene(log)
    return None if scene is None else {f"/{entity.id}": _described(entity) for entity in scene.entities}


def _described(entity: Any) -> str:
    triangles = sum(len(mesh.indices) // 3 for mesh in entity.triangles)
    digest = hashlib.sha256(entity.SerializeToString(deterministic=True)).hexdigest()
    return f"{triangles} triangles on link {entity.frame_id}, sha256 {digest[:16]}"


def _fields(log: McapLog) -> dict[str, str]:
    """Return the type of each field by "topic path"."""
    found: dict[str, str] = {}
    for channel in log.channels.values():
        schema = log.schemas.get(channel.schema_id)
        if schema is None or schema.encoding != "protobuf":
            found[f"{channel.topic} schema"] = schema.name if schema is not None else "none"
            continue
        descriptor = message_type(str(log.path), schema.name, schema.data).DESCRIPTOR
        found[f"{channel.topic} schema"] = schema.name
        for path, field in fields_of(str(log.path), descriptor):
            kind = f"field {field.number}, {_KINDS[field.type]}{' array' if field.is_repeated else ''}"
            found[f"{channel.topic} {path}"] = kind
    return found


_KINDS = {
    value: name.removeprefix("TYPE_").lower()
    for name, value in vars(FieldDescriptor).items()
    if name.startswith("TYPE_") and isinstance(value, int)
}
