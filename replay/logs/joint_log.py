"""What a log says of joints and frames over time, whatever file it is in."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from replay.errors import RecordingError
from replay.logs.excerpt import EXCERPT, write_messages
from replay.logs.joint_messages import JOINTS, TRANSFORMS, Decoder, Sample, decoder, kind_of
from replay.logs.mcap_records import Channel
from replay.logs.message_log import Message, MessageLog
from replay.logs.times import MAX_TIME
from replay.numerics.arrays import Flags, Floats, Integers

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

    time: Integers
    value: Floats
    row: Integers
    by_turns: tuple[Publisher, ...] = ()


@dataclass(frozen=True, eq=False)
class JointLog:
    """The joints and frames of a log.

    Attributes:
        joints: by name.
        frames: by child and parent.
        begin, end: times [ns] of the first and of the last sample of whichever.
        anchor: rows that tell `begin`, that a stamp of 0 there is no missing one, and `end`.
        left_out: leading samples that were left out: their stamps are 0, as before a clock is there.
        cut: given rows and a note on where they come from, returns a file that reads as these rows of the log do.
        origin: the note that a log carries which was cut out of another one; else empty.
        published: whether the samples are messages, so that there may be several publishers.
        headings: of a table, the columns that were needed, and that of the times.
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
    headings: tuple[str, ...] = ()


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
    tracks = _series(rows, times)
    if not tracks:
        told = f" with frame_id {choice.frame_id!r}" if choice.frame_id is not None else ""
        raise RecordingError(name, f"has no message with positions of joints on topic {_topic(choice)!r}{told}")
    begin, first = min((int(one.time.min()), int(one.row[one.time.argmin()])) for one in tracks.values())
    end, last = max((int(one.time.max()), int(one.row[one.time.argmax()])) for one in tracks.values())
    begins = (rows[first].message.channel, rows[first].samples[0].stamp)
    heads = enumerate((row.message.channel, row.samples[0].stamp) for row in rows)
    later = (index for index, (channel, stamp) in heads if channel == begins[0] and stamp > begins[1])
    return JointLog(
        joints={key: one for key, one in tracks.items() if isinstance(key, str)},
        frames={key: one for key, one in tracks.items() if isinstance(key, tuple)},
        begin=begin,
        end=end,
        anchor=(first, *itertools.islice(later, 1), last),
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
            samples = [sample for sample in samples if sample.frame_id == frame_id or sample.is_pose]
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


@dataclass(eq=False)
class _Group:
    """Samples of one publisher that tell the same joints."""

    times: list[int] = field(default_factory=list)
    values: list[Any] = field(default_factory=list)
    rows: list[int] = field(default_factory=list)


def _series(rows: Sequence[_Row], times: Sequence[Sequence[int | None]]) -> dict[Any, Series]:
    """Return the samples by joint and by frame, whose order is that of `Series`."""
    groups: dict[tuple[Publisher, str | None, tuple[str, ...]], _Group] = {}
    for index, (row, mine) in enumerate(zip(rows, times, strict=True)):
        for sample, time in zip(row.samples, mine, strict=True):
            if time is not None and sample.names:
                parent = _frame(sample.frame_id) if sample.is_pose else None
                publisher = (row.message.channel, sample.frame_id if parent is None else "")
                group = groups.setdefault((publisher, parent, sample.names), _Group())
                group.times.append(time)
                group.values.append(sample.values)
                group.rows.append(index)
    parts: dict[Any, dict[Publisher, list[Series]]] = {}
    for (publisher, parent, names), group in groups.items():
        values = np.array(group.values, dtype=np.float64) + 0.0  # -0.0 and 0.0 are one position
        stood = np.array(group.times, dtype=np.int64), np.array(group.rows, dtype=np.int64)
        for column, name in enumerate(names):
            key = name if parent is None else (_frame(name), parent)
            parts.setdefault(key, {}).setdefault(publisher, []).append(Series(stood[0], values[:, column], stood[1]))
    return {key: _joined(by_publisher) for key, by_publisher in sorted(parts.items(), key=lambda item: repr(item[0]))}


def _joined(by_publisher: Mapping[Publisher, Sequence[Series]]) -> Series:
    """Return what several publishers say, one after the other; what one repeats is its first one's."""
    publisher = [k for k, parts in enumerate(by_publisher.values()) for part in parts for _ in part.time]
    every = [part for parts in by_publisher.values() for part in parts]
    time, value, row = (np.concatenate([getattr(part, name) for part in every]) for name in ("time", "value", "row"))
    order = np.argsort(row, kind="stable")
    order = order[unrepeated(time[order], value[order])]
    owner = np.array(publisher)[order]
    found = [(name, order[owner == k]) for k, name in enumerate(by_publisher) if (owner == k).any()]
    found.sort(key=lambda item: int(time[item[1]].min()))
    turns = any(time[later].min() <= time[earlier].max() for (_, earlier), (_, later) in itertools.pairwise(found))
    order = np.concatenate([mine for _, mine in found])
    return Series(time[order], value[order], row[order], tuple(name for name, _ in found) if turns else ())


def unrepeated(time: Integers, value: Floats) -> Flags:
    """Return which samples (n,) are not there before: at the same time with the same value (n,) or (n, k)."""
    if (time[1:] > time[:-1]).all():
        return np.ones(len(time), dtype=np.bool_)
    bits = np.column_stack([time, value.reshape(len(time), -1).view(np.int64)])
    rows = np.ascontiguousarray(bits).view(np.dtype((np.void, bits.dtype.itemsize * bits.shape[1])))[:, 0]
    result = np.zeros(len(time), dtype=np.bool_)
    result[np.unique(rows, return_index=True)[1]] = True
    return result


def _frame(name: str) -> str:
    """Return a frame's name as ROS 2 writes it, without the slash that ROS 1 put before it."""
    return name.removeprefix("/")
