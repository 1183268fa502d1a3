"""Values of any messages of a log over time, by topic and path of a field: numbers, whatever the type is."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from replay.errors import RecordingError
from replay.logs.excerpt import EXCERPT, write_messages
from replay.logs.field_channel import FieldChannel
from replay.logs.field_path import FieldPath
from replay.logs.joint_log import unrepeated
from replay.logs.mcap_chunks import MessageRun
from replay.logs.message_log import Message, MessageLog
from replay.numerics.arrays import Flags, Floats, Integers

Place = tuple[str, str]
"""A topic and a field's path; of a table "" and a heading."""
Window = tuple[int, int]
"""First and last time [ns] of what is of interest."""
_BATCH = 512
"""Messages of logs without chunks that are taken at once."""


@dataclass(frozen=True, eq=False)
class FieldSeries:
    """One value of a log over time.

    Attributes:
        time: (n,) int64 [ns] as the log counts it, increasing; fields of the same messages may share it.
        value: (n,) in the log's unit; what is no number is NaN.
    """

    time: Integers
    value: Floats


@dataclass(frozen=True, eq=False)
class FieldLog:
    """Some values of a log over time.

    Attributes:
        series: by place.
        begin: time [ns] of the first sample of whichever.
        left_out: leading samples that were left out: their stamps are 0, as before a clock is there.
        cut: given a window, None for all, and a note on where they come from, returns a file that reads as the
            samples in this window do, with one before it, one after it and the log's first.
        origin: the note that a log carries which was cut out of another one; else empty.
    """

    series: dict[Place, FieldSeries]
    begin: int
    left_out: int
    cut: Callable[[Window | None, Mapping[str, str]], bytes]
    origin: Mapping[str, str]


def read_fields(name: str, log: MessageLog, places: Collection[Place], *, stamped: bool, max_gap: int) -> FieldLog:
    """Return the values at some places of a log of messages.

    The time of a sample is its message's own stamp or, where no message of its channel has one (all are zero), the log
    time. A message without the field, as where a list is shorter, is no sample. A sample that is there twice is one.

    Args:
        name: of the file, for messages.
        log: its channels and messages.
        places: which values.
        stamped: whether messages' own stamps count at all.
        max_gap: longest time [ns] between samples that is bridged.

    Raises:
        RecordingError: there is no such topic or field, a value is no number, a message cannot be read, a time is
            beyond 146 years, or the log has two values for one moment.
        InvalidValue: a path is none.
    """
    paths: dict[str, dict[str, FieldPath]] = {}
    for topic, path in places:
        paths.setdefault(topic, {})[path] = FieldPath.of(path)
    topics = sorted({channel.topic for channel in log.channels.values()})
    for topic in paths:
        if topic not in topics:
            raise RecordingError(name, f"has no topic {topic!r}; its topics are {topics[:50]}")
    takers = {
        number: FieldChannel(name, log, channel, paths[channel.topic], stamped)
        for number, channel in sorted(log.channels.items())
        if channel.topic in paths
    }
    for run in _runs(log, takers.keys()):
        takers[run.channel].take(run)
    left_out = sum(taker.finish(max_gap) for taker in takers.values())
    series = {}
    for topic, path in places:
        mine = [taker for taker in takers.values() if taker.channel.topic == topic]
        series[topic, path] = _series(name, topic, path, mine)
    begin = min(int(one.time[0]) for one in series.values())
    chosen = takers.keys()

    def cut(window: Window | None, origin: Mapping[str, str]) -> bytes:
        kept = {number: taker.used & in_window(taker.time, window, begin) for number, taker in takers.items()}
        counts = dict.fromkeys(chosen, 0)
        messages = []
        for message in log.messages(chosen):
            at = counts[message.channel]
            counts[message.channel] += 1
            if kept[message.channel][at]:
                messages.append(message)
        messages.sort(key=_log_time)
        return write_messages(messages, log, origin)

    return FieldLog(series, begin, left_out, cut, log.metadata.get(EXCERPT, {}))


def _log_time(message: Message) -> int:
    return message.time


def _runs(log: MessageLog, channels: Collection[int]) -> Iterator[MessageRun]:
    """Yield the messages of some channels, many at a time."""
    if log.mcap is not None:
        for chunk in log.mcap.chunks_with(channels):
            yield from (run for run in log.mcap.runs(chunk) if run.channel in channels)
        return
    waiting: dict[int, list[Message]] = {number: [] for number in channels}
    for message in log.messages(channels):
        mine = waiting[message.channel]
        mine.append(message)
        if len(mine) == _BATCH:
            yield _run(mine)
            mine.clear()
    yield from (_run(mine) for mine in waiting.values() if mine)


def _run(messages: Sequence[Message]) -> MessageRun:
    time = np.array([message.time for message in messages], dtype=np.int64)
    return MessageRun(messages[0].channel, time, None, tuple(message.data for message in messages))


def in_window(time: Integers, window: Window | None, begin: int) -> Flags:
    """Return which times (n,) [ns] are in a window, or the next before or after it, or the first of the log.

    The one after the first is too: it tells that a first stamp of 0 is no missing one.
    """
    if window is None or not len(time):
        return np.ones(len(time), dtype=np.bool_)
    first, last = window
    before, after, later = time[time <= first], time[time >= last], time[time > begin]
    first = int(before.max()) if len(before) else first
    last = int(after.min()) if len(after) else last
    kept: Flags = ((time >= first) & (time <= last)) | (time == begin)
    return kept | (time == later.min()) if len(later) else kept


def _series(name: str, topic: str, path: str, takers: Sequence[FieldChannel]) -> FieldSeries:
    parts = [taker.samples(path) for taker in takers]
    time, value = parts[0] if len(parts) == 1 else map(np.concatenate, zip(*parts, strict=True))
    if not len(time):
        raise RecordingError(name, f"topic {topic!r} has no message with a field {path!r}")
    return in_order(name, f"topic {topic!r}, field {path!r}", time, value)


def in_order(name: str, what: str, time: Integers, value: Floats) -> FieldSeries:
    """Return samples in the order of time, each once; RecordingError where there are two values for one moment."""
    if (time[1:] > time[:-1]).all():
        return FieldSeries(time, value)
    order = np.argsort(time, kind="stable")
    time, value = time[order], value[order] + 0.0  # -0.0 and 0.0 are one value
    kept = unrepeated(time, value)
    time, value = time[kept], value[kept]
    twice = np.flatnonzero(time[1:] == time[:-1])
    if len(twice):
        at = int(twice[0])
        both = f"{value[at]:.6g} and {value[at + 1]:.6g}"
        raise RecordingError(name, f"{what} has two values at {time[at] / 1e9:.9g} s: {both}")
    return FieldSeries(time, value)
