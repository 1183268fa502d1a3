"""Fields of the messages of one channel over time: columns of bytes where messages have one shape, else one by one."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from replay import limits
from replay.errors import RecordingError
from replay.logs.field_path import ABSENT, FieldPath
from replay.logs.joint_log import leading_zeros
from replay.logs.joint_messages import time_stamp
from replay.logs.mcap_chunks import MessageRun
from replay.logs.mcap_records import Channel
from replay.logs.message_log import MessageLog
from replay.logs.protobuf import message_type
from replay.logs.siblings import siblings
from replay.logs.times import MAX_TIME
from replay.logs.values import value_decoder
from replay.logs.wire import MessageShape, Slot, shape_of
from replay.numerics.arrays import Flags, Floats, Integers

_STAMPS = (("timestamp",), ("header", "stamp"), ("stamp",))
"""Where messages have their own time stamps."""
_WORDS = {"NaN": math.nan, "Infinity": math.inf, "-Infinity": -math.inf}
_Cell = tuple[Slot, int]
"""Where a number is: a slot, and of a packed list the entry."""


@dataclass(eq=False)
class FieldChannel:
    """Collects some fields of a channel.

    Attributes:
        file: name of the log, for messages.
        log: whose channel it is.
        channel: which.
        paths: of the fields, by how they are written.
        stamped: whether messages' own time stamps count.
        time: (n,) of all messages [ns], once they are all there.
        used: (n,) whether a message is; leading ones with the stamp 0 may not be.
    """

    file: str
    log: MessageLog
    channel: Channel
    paths: Mapping[str, FieldPath]
    stamped: bool
    times: list[Integers] = field(default_factory=list)
    stamps: list[Integers] = field(default_factory=list)
    values: dict[str, list[Floats]] = field(default_factory=dict)
    there: dict[str, list[Flags]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        schema = self.log.schema(self.channel)
        decode = value_decoder(self.file, self.channel, schema)
        if decode is None:
            kind = self.channel.encoding or "bytes"
            raise RecordingError(self.file, f"topic {self.channel.topic!r} holds {kind} that cannot be taken apart")
        self._decode = decode
        protobuf = schema is not None and self.channel.encoding == "protobuf"
        self._type = message_type(self.file, schema.name, schema.data) if schema is not None and protobuf else None
        self.values = {path: [] for path in self.paths}
        self.there = {path: [] for path in self.paths}
        self._known: tuple[MessageShape, dict[str, _Cell], tuple[Slot, Slot] | None] | None = None
        self.time, self.used = np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_)

    def take(self, run: MessageRun) -> None:
        """Take the next messages."""
        self.times.append(run.time)
        if run.rows is None or not self._take_rows(run):
            self._take_messages(run)

    def _take_rows(self, run: MessageRun) -> bool:
        assert run.rows is not None
        if self._type is None or not len(run.rows):
            return False
        if self._known is None or not self._known[0].fits(run.rows):
            shape = shape_of(self._type.DESCRIPTOR, run.rows[0].tobytes())
            if shape is None or not shape.fits(run.rows):
                return False
            cells = {path: _cell_of(shape, steps) for path, steps in self.paths.items()}
            if any(cell is None for cell in cells.values()):
                return False
            self._known = shape, {path: cell for path, cell in cells.items() if cell is not None}, _stamp_of(shape)
        _, known, stamp = self._known
        for path, (slot, entry) in known.items():
            values = slot.read(run.rows)
            self.values[path].append((values[:, entry] if slot.is_array else values).astype(np.float64))
            self.there[path].append(np.ones(len(run.rows), dtype=np.bool_))
        zero = np.zeros(len(run.time), dtype=np.int64)
        if stamp is not None:
            seconds, part = (slot.read(run.rows).astype(np.int64) for slot in stamp)
            if (np.abs(seconds) > MAX_TIME // 10**9).any():
                raise RecordingError(self.file, f"topic {self.channel.topic!r} has a time stamp beyond 146 years")
            zero = seconds * 10**9 + part
        self.stamps.append(zero)
        return True

    def _take_messages(self, run: MessageRun) -> None:
        count = len(run.time)
        if self.log.mcap is not None:
            self.log.mcap.work.decode(count)
        values = {path: np.full(count, np.nan) for path in self.paths}
        there = {path: np.zeros(count, dtype=np.bool_) for path in self.paths}
        stamps = np.zeros(count, dtype=np.int64)
        groups = siblings(self.paths, count)
        alone = {path: steps for path, steps in self.paths.items() if isinstance(steps.steps[-1], tuple)}
        for k, data in enumerate(run.messages()):
            message = self._decoded(data)
            stamps[k] = self._stamp(message)
            for path, steps in alone.items():
                found = steps.value(message)
                if found is not ABSENT:
                    values[path][k] = self._number(path, found)
                    there[path][k] = True
            for group in groups:
                group.take(k, message)
        for group in groups:
            for column, path in enumerate(group.paths):
                values[path][:] = group.table[:, column]
                there[path][:] = group.there
                for k, row in group.odd.items():
                    there[path][k] = row[column] is not ABSENT
                    values[path][k] = self._number(path, row[column]) if there[path][k] else np.nan
        for path in self.paths:
            self.values[path].append(values[path])
            self.there[path].append(there[path])
        self.stamps.append(stamps)

    def _decoded(self, data: bytes) -> Any:
        try:
            if len(data) > limits.MESSAGE:
                raise ValueError(f"it has {len(data)} bytes; at most {limits.MESSAGE} are taken apart")
            return self._decode(data)
        except Exception as error:  # each format's library fails in ways of its own on bytes that are not its messages
            reason = str(error).partition("\n")[0][:200] or type(error).__name__
            rule = f"topic {self.channel.topic!r} holds a message that cannot be read: {reason}"
            raise RecordingError(self.file, rule) from None

    def _stamp(self, message: Any) -> int:
        for path in _STAMPS:
            if path[0] not in message:
                continue
            found: Any = message
            for step in path:
                found = found.get(step) if type(found) is dict or isinstance(found, Mapping) else None
            if found is not None and isinstance(found, str | Mapping):
                try:
                    stamp = time_stamp(found)
                except (ValueError, OverflowError):
                    continue  # something else of that name
                if abs(stamp) <= MAX_TIME:
                    return stamp
                raise RecordingError(self.file, f"topic {self.channel.topic!r} has a time stamp beyond 146 years")
        return 0

    def _number(self, path: str, value: Any) -> float:
        if value is None:
            return math.nan  # which JSON cannot write
        if isinstance(value, str) and value in _WORDS:
            return _WORDS[value]
        if hasattr(value, "item") and getattr(value, "ndim", 1) == 0:
            value = value.item()
        if not isinstance(value, bool | int | float):
            what = "a message" if isinstance(value, Mapping) else "text"
            if isinstance(value, list | tuple):
                what = f"a list: name one of its {len(value)} values, such as {path}[0]"
            raise RecordingError(self.file, f"topic {self.channel.topic!r}: {path} is no number but {what}")
        try:
            return float(value)
        except OverflowError:
            return math.inf

    def finish(self, max_gap: int) -> int:
        """Settle the times of all messages; return how many leading ones are left out."""
        time = _joined(self.times, np.int64)
        stamps = _joined(self.stamps, np.int64)
        self.used = np.ones(len(time), dtype=np.bool_)
        skipped = 0
        if self.stamped and stamps.any():
            order = np.argsort(time, kind="stable")
            skipped = leading_zeros(stamps[order].tolist(), max_gap) if stamps[order[0]] == 0 else 0
            self.used[order[:skipped]] = False
            time = stamps
        if len(time) and (time.min() < -MAX_TIME or time.max() > MAX_TIME):
            raise RecordingError(self.file, f"topic {self.channel.topic!r} has a time beyond 146 years from 0")
        self.time = time
        return skipped

    def samples(self, path: str) -> tuple[Integers, Floats]:
        """Return times and values of a field, as they come, once: nothing of it is kept here.

        Where every message has the field, its times are those of the channel, for all such fields the same array.
        """
        there = _joined(self.there.pop(path), np.bool_) & self.used
        value = _joined(self.values.pop(path), np.float64)
        return (self.time, value) if there.all() else (self.time[there], value[there])


def _cell_of(shape: MessageShape, path: FieldPath) -> _Cell | None:
    """Return where the value at a path is in messages of a shape; None where there is no number."""
    text = ""
    for place, step in enumerate(path.steps):
        if isinstance(step, str):
            text += f".{step}" if text else step
        elif isinstance(step, tuple):
            found = [key for key, name in shape.texts.items() if name == step[0] and _is_name(key, text)]
            if not found:
                return None
            text = found[0].removesuffix(".name")
        elif text in shape.slots and place == len(path.steps) - 1:
            slot = shape.slots[text]
            return (slot, step) if slot.is_array and step < slot.count else None
        else:
            text += f"[{step}]"
    slot_ = shape.slots.get(text)
    return None if slot_ is None or slot_.is_array else (slot_, 0)


def _is_name(key: str, text: str) -> bool:
    """Return whether a path is that of the name of an entry of the list at another path."""
    entry = key.removeprefix(text).removesuffix("].name")
    return key == f"{text}{entry}].name" and entry.startswith("[") and entry[1:].isdigit()


def _stamp_of(shape: MessageShape) -> tuple[Slot, Slot] | None:
    for path in _STAMPS:
        for names in (("seconds", "nanos"), ("sec", "nanosec"), ("sec", "nsec")):
            found = tuple(shape.slots.get(".".join((*path, name))) for name in names)
            if found[0] is not None and found[1] is not None:
                return found[0], found[1]
    return None


def _joined(parts: Sequence[Any], kind: Any) -> Any:
    return np.concatenate(parts) if parts else np.zeros(0, dtype=kind)
