"""Events to messages of `/events` (foxglove.Log) and back.

A message is three parts one after another: the time, what happens, and the frame with the earliest time. What happens
repeats, so each of its texts goes through the protobuf library once; a message is then two cuts and a look-up, which is
what makes a recording with events in every frame readable in seconds.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from google.protobuf.message import DecodeError

from replay.errors import RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.protobuf import message_type
from replay.recording import messages
from replay.recording.events import SEVERITY, Events, Transition

TOPIC = "/events"

_FIELDS = ("timestamp", "message", "name", "file", "line")
_TIME_TAG = 0x0A  # field 1, a message
_LINE_TAG = 0x35  # field 6, four bytes, little-endian
_LINE_BYTES = 5
_EARLIEST = "earliest"
_EARLIEST_TAG = bytes([0x80 | (messages.EARLIEST << 3 | 1) & 0x7F, messages.EARLIEST << 3 >> 7])  # then eight bytes
_EARLIEST_BYTES = 10


def encode(events: Events) -> list[bytes]:
    """Return the messages; `name` is the subject, `file` the source and `line` the frame."""
    log = messages.message_class(messages.LOG)
    bodies = [_body(log, what) for what in events.transitions]
    head = tail = b""
    current: tuple[int, int, int | None] = (-1, -1, None)
    found = []
    earliest = [None] * len(events) if events.earliest is None else events.earliest.tolist()
    rows = zip(events.time.tolist(), events.frame.tolist(), earliest, events.code.tolist(), strict=True)
    for time, frame, first, code in rows:
        if (time, frame, first) != current:
            current = time, frame, first
            stamp = {"seconds": time // 1_000_000_000, "nanos": time % 1_000_000_000}
            head = log(timestamp=stamp).SerializeToString(deterministic=True)
            tail = log(line=frame, earliest=first).SerializeToString(deterministic=True)
        found.append(head + bodies[code] + tail)
    return found


def read_events(log: McapLog) -> Events:
    """Return the events of a recording.

    Raises:
        RecordingError: damage, there is no such topic, or it holds a message that is no event.
    """
    channels = [channel for channel in log.channels.values() if channel.topic == TOPIC]
    if len(channels) != 1:
        raise RecordingError(str(log.path), f"damaged: topic {TOPIC!r} is missing or spread over several channels")
    number = channels[0].id
    decoder = _Decoder(log, channels[0].schema_id)
    times, frames, codes, earliest = ([np.zeros(0, dtype=np.int64)] for _ in range(4))
    for chunk in log.chunks_with((number,)):
        for run in log.runs(chunk):
            if run.channel == number:
                found = np.array([decoder.decode(message) for message in run.messages()], dtype=np.int64)
                times.append(run.time)
                frames.append(found[:, 0])
                codes.append(found[:, 1])
                earliest.append(found[:, 2])
    events = Events(
        np.concatenate(times),
        np.concatenate(frames),
        np.concatenate(codes),
        decoder.transitions,
        np.concatenate(earliest) if decoder.has_earliest else None,
    )
    if log.count_of(number) not in (None, len(events)):
        raise RecordingError(
            str(log.path), f"damaged: topic {TOPIC!r} holds {len(events)} messages, not as many as counted"
        )
    return events


class _Decoder:
    """Turns messages into frames and codes of transitions."""

    def __init__(self, log: McapLog, schema_id: int) -> None:
        self._file = str(log.path)
        schema = log.schemas.get(schema_id)
        if schema is None or schema.name != messages.LOG or schema.encoding != "protobuf":
            raise RecordingError(self._file, f"damaged: topic {TOPIC!r} does not hold {messages.LOG}")
        self._ours = schema == messages.schema(messages.LOG)
        self._type: Any = message_type(self._file, schema.name, schema.data)
        mine = {field.name: field for field in self._type.DESCRIPTOR.fields}
        self._known = _EARLIEST in mine
        self.has_earliest = self._known
        wanted = (*_FIELDS, _EARLIEST) if self._known else _FIELDS
        for field in messages.message_class(messages.LOG).DESCRIPTOR.fields:
            if field.name in wanted and not _alike(field, mine.get(field.name)):
                raise RecordingError(self._file, f"damaged: {messages.LOG} in it has no usable field {field.name!r}")
        self._bodies: dict[bytes, int] = {}
        self._codes: dict[Transition, int] = {}

    @property
    def transitions(self) -> tuple[Transition, ...]:
        """What the codes mean."""
        return tuple(self._codes)

    def decode(self, message: bytes) -> tuple[int, int, int]:
        """Return frame, code and earliest time [ns] of a message; RecordingError when it is no event.

        Recordings of format 1 have no earliest time: it is 0 then. One that only some messages have is damage.

        A protobuf message that is cut between its fields means the same as its parts put together, so that whatever
        is cut here rightly is read rightly; what does not look like three parts is read as a whole.
        """
        cut = None
        if self._ours and len(message) > 1 and message[0] == _TIME_TAG and message[1] < 0x80:
            cut = _cut(message)
        if cut is not None:
            body, frame, earliest = cut
            code = self._bodies.get(body)
            if code is not None:
                return frame, code, earliest
        found = self._parse(message)
        what = _transition(found)
        dated = self._known and found.HasField(_EARLIEST)
        if what is None or (self._codes and dated is not self.has_earliest):
            raise RecordingError(self._file, f"damaged: topic {TOPIC!r} holds {found.message!r}")
        self.has_earliest = dated
        code = self._codes.setdefault(what, len(self._codes))
        first = found.earliest if dated else 0
        if cut is not None and (found.line, first) == cut[1:] and self._alone(cut[0]) == what:
            self._bodies[cut[0]] = code
        return found.line, code, first

    def _parse(self, data: bytes) -> Any:
        try:
            return self._type.FromString(data)
        except DecodeError as error:
            raise RecordingError(
                self._file, f"topic {TOPIC!r} holds a message that its schema cannot read: {error}"
            ) from None

    def _alone(self, body: bytes) -> Transition | None:
        """Return what a body means by itself; None when it is no whole message, or says a time or the frame too."""
        try:
            found = self._type.FromString(body)
        except DecodeError:
            return None
        moment = found.line or found.HasField("timestamp") or found.HasField(_EARLIEST)
        return None if moment else _transition(found)


def _cut(message: bytes) -> tuple[bytes, int, int] | None:
    """Return what seems to be the middle part of a message, and the frame (0 if none) and time that seem to follow it.

    None if no time does.
    """
    begin, end = 2 + message[1], len(message) - _EARLIEST_BYTES
    if end < begin or message[end : end + 2] != _EARLIEST_TAG:
        return None
    earliest = int.from_bytes(message[end + 2 :], "little", signed=True)
    line = end - _LINE_BYTES
    if line >= begin and message[line] == _LINE_TAG:
        return message[begin:line], int.from_bytes(message[line + 1 : end], "little"), earliest
    return message[begin:end], 0, earliest


def _body(log: Any, what: Transition) -> bytes:
    body: bytes = log(level=what.severity, message=what.text, name=what.subject, file=what.source).SerializeToString(
        deterministic=True
    )
    return body


def _alike(field: Any, other: Any) -> bool:
    """Return whether a field that a file describes holds what ours does."""
    return other is not None and (field.type, field.is_repeated) == (other.type, other.is_repeated)


def _transition(found: Any) -> Transition | None:
    kind, separator, verb = str(found.message).removesuffix(f": {found.name}").rpartition(" ")
    if kind not in SEVERITY or not separator or verb not in ("begins", "ends"):
        return None
    return Transition(kind, verb == "begins", found.name, found.file)
