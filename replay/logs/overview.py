"""What a log holds, whoever wrote it: topics with their schemas and counts, the time that it spans, its joints."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from replay import limits
from replay.errors import LimitError, RecordingError
from replay.logs.joint_messages import TRANSFORMS, Decoder, decoder, kind_of
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import Channel


@dataclass(frozen=True)
class TopicSummary:
    """A topic: the name of its schema ("" where it has none), and how many messages it has."""

    topic: str
    schema: str
    messages: int


@dataclass(frozen=True)
class JointRange:
    """A joint of a topic: how many samples it has, and between which positions (None where none is finite)."""

    topic: str
    joint: str
    samples: int
    lower: float | None
    upper: float | None


@dataclass(frozen=True)
class Overview:
    """What a log holds.

    Attributes:
        topics: sorted by name; one for each schema where a topic has several.
        begin, end: first and last log time [ns]; None without messages.
        joints: of the topics that can drive a motion, sorted by topic and name.
    """

    topics: tuple[TopicSummary, ...]
    begin: int | None
    end: int | None
    joints: tuple[JointRange, ...]


def overview(log: McapLog, *, joints: bool = True) -> Overview:
    """Return what a log holds.

    Args:
        log: is read through.
        joints: whether to look for joint states in it.

    Raises:
        RecordingError: damage.
    """
    counts = dict.fromkeys(log.channels, 0)
    begin, end = None, None
    ranges: dict[tuple[str, str], _Range] = {}
    decoders = {n: decode for n, channel in log.channels.items() if joints and (decode := _decoder(log, channel))}
    for chunk in log.chunks:
        for run in log.runs(chunk):
            counts[run.channel] = counts.get(run.channel, 0) + len(run.time)
            first, last = int(run.time.min()), int(run.time.max())
            begin, end = first if begin is None else min(begin, first), last if end is None else max(end, last)
            if run.channel not in decoders:
                continue
            topic = log.channels[run.channel].topic
            log.work.decode(len(run.time))
            try:
                for message in run.messages():
                    for sample in decoders[run.channel](message):
                        for joint, position in sample.positions:
                            ranges.setdefault((topic, joint), _Range()).add(position)
                    if len(ranges) > limits.JOINTS:
                        raise RecordingError(topic, "names more joints than a machine has")
            except LimitError:
                raise
            except RecordingError:  # JSON of another kind, say
                del decoders[run.channel]
                ranges = {key: found for key, found in ranges.items() if key[0] != topic}
    messages: dict[tuple[str, str], int] = {}
    for number, channel in log.channels.items():
        key = channel.topic, log.schema_name(channel)
        messages[key] = messages.get(key, 0) + counts[number]
    return Overview(
        tuple(TopicSummary(topic, schema, count) for (topic, schema), count in sorted(messages.items())),
        begin,
        end,
        tuple(found.summary(topic, joint) for (topic, joint), found in sorted(ranges.items())),
    )


def _decoder(log: McapLog, channel: Channel) -> Decoder | None:
    schema = log.schemas.get(channel.schema_id)
    if kind_of(schema) in TRANSFORMS:
        return None
    try:
        return decoder(str(log.path), channel, schema)
    except RecordingError:
        return None


@dataclass
class _Range:
    samples: int = 0
    lower: float = field(default=np.inf)
    upper: float = field(default=-np.inf)

    def add(self, position: float) -> None:
        self.samples += 1
        if np.isfinite(position):
            self.lower, self.upper = min(self.lower, position), max(self.upper, position)

    def summary(self, topic: str, joint: str) -> JointRange:
        known = self.lower <= self.upper
        return JointRange(topic, joint, self.samples, self.lower if known else None, self.upper if known else None)
