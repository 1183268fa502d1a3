"""What a log says of joints and frames over time, whatever file it is in."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from replay.errors import RecordingError
from replay.logs.excerpt import EXCERPT, write_messages
from replay.logs.joint_messages import JOINTS, TRANSFORMS, Decoder, Pose, Sample, decoder, kind_of
from replay.logs.mcap_records import Channel
from replay.logs.message_log import Message, MessageLog
from replay.logs.times import MAX_TIME

JOINT_TOPIC = "/joint_states"
FRAME_TOPICS = ("/tf", "/tf_static")
EPOCH = 10**17
"""A first time [ns] from which on it is a date since 1970 and no time since the log began: 3 years."""

Frame = tuple[str, str]
"""A child frame and the parent that its pose is in."""
Publisher = tuple[int, str]
"""Channel and `frame_id`."""


@dataclass(frozen=True, eq=False)
class Series:
    """One joint, or one frame, of a log.

    Attributes:
        time: (n,) int64 [ns] as the log counts it; in the order of the log, publisher by publisher.
        value: (n,) positions in the log's unit, or (n, 7) poses: x, y, z and a quaternion x, y, z, w.
        row: (n,) message or line of the log that each sample comes from.
        by_turns: the publishers that give samples of it in the same span of time; empty if one alone does.
    """

    time: NDArray[np.int64]
    value: NDArray[np.float64]
    row: NDArray[np.int64]
    by_turns: tuple[Publisher, ...] = ()


@dataclass(frozen=True, eq=False)
class JointLog:
    """The joints and frames of a log.

    Attributes:
        joints: by name.
        frames: by child and parent.
        begin, end: times [ns] of the first and of the last sample of whichever.
        anchor: rows that tell `begin`, and that a stamp of 0 there is no missing one.
        left_out: leading samples that were left out: their stamps are 0, as before a clock is there.
        cut: given rows and a note on where they come from, returns a file that reads as these rows of the log do.
        origin: the note that a log carries which was cut out of another one; else empty.
        published: whether the samples are messages, so that there may be several publishers.
    """

    joints: Mapping[str, Series]
    frames: Mapping[Frame, Series]
    begin: int
    end: int
    anchor: tuple[int, ...]
    left_out: int
    cut: Callable[[Sequence[int], Mapping[str, str]], bytes]
    origin: Mapping[str, str]
    published: bool


@dataclass(frozen=True)
class Choice:
    """What is wanted of a log.

    Attributes:
        joints: whether joints are; None: if there are any.
        frames: whether frames are.
        topic: where, instead of the usual topic of what its type is.
        channel: the only channel that is read of its topic, or None.
        frame_id: the only one that is read of joint states, or None.
        max_gap: longest time [ns] between samples that is bridged.
    """

    joints: bool | None = True
    frames: bool = False
    topic: str | None = None
    channel: int | None = None
    frame_id: str | None = None
    max_gap: int = 10**9


class _Row(NamedTuple):
    message: Message
    samples: list[Sample]


def read_messages(name: str, log: MessageLog, choice: Choice) -> JointLog:
    """Return the joints and frames of a log of messages.

    Understood are the joint states and transforms of Foxglove and ROS (`joint_messages`). Messages are taken in the
    order of their log times. The time of a sample is its message's own stamp or, where no message of its channel has
    one (all are zero), the log time. A sample that is there twice is one.

    Args:
        name: of the file, for messages.
        log: its channels and messages.
        choice: what is wanted.

    Raises:
        RecordingError: the log has no such topic or channel, nothing of what is wanted, or a message of another kind;
            or a time is beyond 146 years.
    """
    decoders = {n: decoder(name, log.channels[n], log.schema(log.channels[n])) for n in _chosen(name, log, choice)}
    rows = _rows(log, decoders, choice.frame_id)
    rows.sort(key=lambda row: (row.message.time, row.samples[0].stamp))
    times, left_out = _times(name, rows, choice.max_gap)
    found: dict[Any, _Samples] = {}
    for index, row in enumerate(rows):
        for sample, time in zip(row.samples, times[index], strict=True):
            if time is None:
                continue
            for key, value in sample.values:
                pose = isinstance(value, tuple)
                series = (_frame(key), _frame(sample.frame_id)) if pose else key
                publisher = (row.message.channel, "" if pose else sample.frame_id)
                found.setdefault(series, _Samples()).add(publisher, time, value, index)
    if not found:
        told = f" with frame_id {choice.frame_id!r}" if choice.frame_id is not None else ""
        raise RecordingError(name, f"has no message with positions of joints on topic {_topic(choice)!r}{told}")
    tracks = {key: samples.series() for key, samples in sorted(found.items(), key=lambda item: repr(item[0]))}
    begin, first = min((int(one.time.min()), int(one.row[one.time.argmin()])) for one in tracks.values())
    channel = rows[first].message.channel
    later = (index for index in range(first + 1, len(rows)) if rows[index].message.channel == channel)

    return JointLog(
        joints={key: one for key, one in tracks.items() if isinstance(key, str)},
        frames={key: one for key, one in tracks.items() if isinstance(key, tuple)},
        begin=begin,
        end=max(int(one.time.max()) for one in tracks.values()),
        anchor=(first, *itertools.islice(later, 1)),
        left_out=left_out,
        cut=lambda chosen, origin: write_messages([rows[index].message for index in chosen], log, origin),
        origin=log.metadata.get(EXCERPT, {}),
        published=True,
    )


def _chosen(name: str, log: MessageLog, choice: Choice) -> list[int]:
    """Return the ids of the channels that are read."""
    roles = {number: role for number, channel in log.channels.items() if (role := _role(log, channel, choice))}
    topics = sorted({channel.topic for channel in log.channels.values()})
    missing = _topic(choice) if choice.joints and "joints" not in roles.values() else ""
    if choice.frames and "frames" not in roles.values() and not missing:
        missing = choice.topic if choice.topic is not None and not choice.joints else FRAME_TOPICS[0]
    if missing in topics:
        rule = f"holds transforms on topic {missing!r}, which move free links: name them in motion.recorded.free"
        raise RecordingError(name, rule)
    if missing:
        raise RecordingError(name, f"has no topic {missing!r}; its topics are {topics}")
    if choice.channel is not None and choice.channel not in roles:
        some = ", ".join(map(str, sorted(roles))) or "none"
        raise RecordingError(name, f"has no channel {choice.channel} on that topic; its channels are {some}")
    mine = roles[choice.channel] if choice.channel is not None else ""
    return sorted(number for number, role in roles.items() if number == choice.channel or role != mine)


def _role(log: MessageLog, channel: Channel, choice: Choice) -> str:
    """Return whether a channel is read for "joints" or "frames", or "" for neither."""
    kind = kind_of(log.schema(channel))
    if channel.topic == choice.topic:
        told = kind in TRANSFORMS or (kind not in JOINTS and choice.frames and not choice.joints)
        role = "frames" if told else "joints"
    elif channel.topic in FRAME_TOPICS and kind not in JOINTS:
        role = "frames" if choice.topic is None or choice.joints or kind in TRANSFORMS else ""
    else:
        role = "joints" if channel.topic == JOINT_TOPIC and choice.topic is None else ""
    wanted = choice.frames if role == "frames" else choice.joints is not False
    return role if wanted else ""


def _topic(choice: Choice) -> str:
    return choice.topic or JOINT_TOPIC


def _rows(log: MessageLog, decoders: Mapping[int, Decoder], frame_id: str | None) -> list[_Row]:
    """Return the messages that have samples, decoded; of joint states those of one `frame_id`, if one is wanted."""
    rows = []
    for message in log.messages(decoders.keys()):
        samples = decoders[message.channel](message.data)
        if frame_id is not None:
            samples = [s for s in samples if s.frame_id == frame_id or any(isinstance(v, tuple) for _, v in s.values)]
        if samples:
            rows.append(_Row(message, samples))
    return rows


def _times(name: str, rows: Sequence[_Row], max_gap: int) -> tuple[list[list[int | None]], int]:
    """Return the time of each sample of each message, None for those that are left out, and how many those are."""
    by_channel: dict[int, list[int]] = {}
    for row in rows:
        by_channel.setdefault(row.message.channel, []).extend(sample.stamp for sample in row.samples)
    unset = {channel: leading_zeros(stamps, max_gap) for channel, stamps in by_channel.items()}
    stamped = {channel for channel, stamps in by_channel.items() if any(stamps)}
    left_out = sum(unset.values())
    times: list[list[int | None]] = []
    for row in rows:
        channel = row.message.channel
        mine: list[int | None] = []
        for sample in row.samples:
            unset[channel] -= 1
            time = sample.stamp if channel in stamped else row.message.time
            mine.append(None if unset[channel] >= 0 else time)
            if not -MAX_TIME <= time <= MAX_TIME:
                raise RecordingError(name, f"has a sample at {time / 1e9:.6g} s; times are read up to 146 years from 0")
        times.append(mine)
    return times, left_out


def leading_zeros(stamps: Sequence[int], max_gap: int) -> int:
    """Return how many first stamps [ns] are 0 because the clock was not there yet, as with a simulated one.

    A clock may begin at 0 itself. Then the next stamp is not far away: within `max_gap`, or about as far as the others
    are from each other.
    """
    count = next((index for index, stamp in enumerate(stamps) if stamp), 0)
    if not count or stamps[count] <= max_gap:
        return 0
    rest = np.unique(np.array(stamps[count:], dtype=np.float64))
    alone = stamps[count] >= EPOCH or (len(rest) >= 3 and stamps[count] > 10 * float(np.median(np.diff(rest))))
    return count if alone else 0


class _Samples:
    """The samples of one joint or frame, publisher by publisher, in the order of the log."""

    def __init__(self) -> None:
        self._known: set[Any] = set()
        self._found: dict[Publisher, tuple[list[int], list[float | Pose], list[int]]] = {}

    def add(self, publisher: Publisher, time: int, value: float | Pose, row: int) -> None:
        """Take the next one, unless the very same is there already."""
        if (time, value) in self._known:
            return
        self._known.add((time, value))
        times, values, rows = self._found.setdefault(publisher, ([], [], []))
        times.append(time)
        values.append(value)
        rows.append(row)

    def series(self) -> Series:
        """Return them, one publisher after the other."""
        parts = sorted(self._found.items(), key=lambda item: min(item[1][0]))
        turns = any(min(later[0]) <= max(earlier[0]) for (_, earlier), (_, later) in itertools.pairwise(parts))
        times, values, rows = ([one for _, part in parts for one in part[k]] for k in range(3))
        return Series(
            np.array(times, dtype=np.int64),
            np.array(values, dtype=np.float64),
            np.array(rows, dtype=np.int64),
            tuple(publisher for publisher, _ in parts) if turns else (),
        )


def _frame(name: str) -> str:
    """Return a frame's name as ROS 2 writes it, without the slash that ROS 1 put before it."""
    return name.removeprefix("/")
