"""Logs of messages by channel, whatever file they are in: MCAP, ROS 1 bags, ROS 2 bags and folders of split ones."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from replay import limits
from replay.errors import LimitError, RecordingError
from replay.logs.mcap_reader import McapLog
from replay.logs.mcap_records import MAGIC, Channel, Schema

_ROS1 = b"#ROSBAG V"
_SQLITE = b"SQLite format 3\0"
_ZSTD = b"\x28\xb5\x2f\xfd"


@dataclass(frozen=True)
class Message:
    """A message as it stands in the file."""

    channel: int
    time: int
    """Log time [ns]."""
    data: bytes


@dataclass(frozen=True, eq=False)
class MessageLog:
    """A log's channels, and its messages on demand.

    Attributes:
        channels: by id.
        schemas: by id.
        messages: yields the messages of some channels, in the order of the file.
        metadata: values of its metadata records, by their names.
        mcap: the file itself, where it is one: its messages can be had many at a time.
    """

    channels: Mapping[int, Channel]
    schemas: Mapping[int, Schema]
    messages: Callable[[Collection[int]], Iterator[Message]]
    metadata: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    mcap: McapLog | None = None

    def schema(self, channel: Channel) -> Schema | None:
        """Return the schema of a channel."""
        return self.schemas.get(channel.schema_id)


def is_message_log(data: bytes) -> bool:
    """Return whether a file begins as one of these."""
    return data.startswith((MAGIC, _ROS1, _SQLITE, _ZSTD))


def open_message_log(name: str, data: bytes) -> MessageLog:
    """Return the log that a file holds, told by how it begins.

    Args:
        name: of the file, for messages.
        data: its bytes; of MCAP every checksum that it carries is verified, bags have none.

    Raises:
        RecordingError: it is none of these files, damaged, or of a kind that cannot be read.
    """
    from replay.logs import bags

    if data.startswith(_ZSTD):
        return open_message_log(name, _unpacked(name, data))
    if data.startswith(MAGIC):
        return _mcap(name, data)
    if data.startswith(_ROS1):
        return bags.ros1_bag(name, data)
    if data.startswith(_SQLITE):
        return bags.ros2_bag(name, data)
    raise RecordingError(name, "begins neither as an MCAP file nor as a ROS bag (.bag, .db3)")


def open_bag_folder(name: str, read: Callable[[str], bytes]) -> tuple[MessageLog, dict[str, bytes]]:
    """Return the log of a ROS 2 bag's folder, whatever number of files it is split into, and the files read.

    Args:
        name: of the folder, for messages.
        read: returns the bytes of a file of the folder.

    Raises:
        RecordingError: metadata.yaml is not one, or a file cannot be read as a log.
    """
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    files = {"metadata.yaml": read("metadata.yaml")}
    if len(files["metadata.yaml"]) > limits.BAG_YAML:
        raise LimitError(name, f"has a metadata.yaml of more than {limits.BAG_YAML} bytes")
    try:
        listed = YAML(typ="safe", pure=True).load(files["metadata.yaml"].decode())["rosbag2_bagfile_information"]
        written, mode = listed["relative_file_paths"], listed.get("compression_mode") or ""
        if not isinstance(mode, str) or not isinstance(written, list) or not all(isinstance(p, str) for p in written):
            raise TypeError
        paths = [path.replace("\\", "/").rpartition("/")[2] for path in written]
        packed = mode.lower() == "message"
    except (YAMLError, ValueError, KeyError, TypeError, AttributeError, RecursionError):
        raise RecordingError(name, "has a metadata.yaml that is not that of a ROS 2 bag") from None
    if len(paths) > limits.BAG_FILES:
        raise LimitError(
            name, f"has a metadata.yaml that lists {len(paths)} files; at most {limits.BAG_FILES} are read"
        )
    if not paths:
        raise RecordingError(name, "has a metadata.yaml that lists no files")
    files |= {path: read(path) for path in paths}
    return _joined([open_message_log(f"{name}/{path}", files[path]) for path in paths], name, packed), files


def _joined(logs: Sequence[MessageLog], name: str, packed: bool) -> MessageLog:
    """Return several files as one log: channels of one topic, type and encoding are one channel."""
    channels: dict[int, Channel] = {}
    schemas: dict[int, Schema] = {}
    known: dict[tuple[str, str, Schema | None, int], int] = {}
    numbers: list[dict[int, int]] = []
    for log in logs:
        mine: dict[int, int] = {}
        twins: Counter[tuple[str, str, Schema | None]] = Counter()
        for number, channel in sorted(log.channels.items()):
            schema = log.schema(channel)
            likeness = (channel.topic, channel.encoding, schema)
            twins[likeness] += 1
            key = (*likeness, twins[likeness])
            if key not in known:
                known[key] = new = number if number not in channels else max(channels) + 1
                channels[new] = Channel(new, new + 1 if schema else 0, channel.topic, channel.encoding, {})
                schemas |= {new + 1: schema} if schema else {}
            mine[number] = known[key]
        numbers.append(mine)

    def messages(wanted: Collection[int]) -> Iterator[Message]:
        for log, mine in zip(logs, numbers, strict=True):
            for message in log.messages([number for number, joined in mine.items() if joined in wanted]):
                data = _unpacked(name, message.data) if packed else message.data
                yield Message(mine[message.channel], message.time, data)

    return MessageLog(channels, schemas, messages)


def _mcap(name: str, data: bytes) -> MessageLog:
    log = McapLog(name, data=data)

    def messages(wanted: Collection[int]) -> Iterator[Message]:
        for chunk in log.chunks_with(wanted) if wanted else ():
            for run in log.runs(chunk):
                if run.channel in wanted:
                    log.work.decode(len(run.time))
                    for time, message in zip(run.time.tolist(), run.messages(), strict=True):
                        yield Message(run.channel, time, message)

    return MessageLog(log.channels, log.schemas, messages, dict(log.metadata), log)


def _unpacked(name: str, data: bytes) -> bytes:
    import zstandard

    try:
        with zstandard.ZstdDecompressor().stream_reader(data) as stream:
            result: bytes = stream.read(limits.UNPACKED_FILE + 1)
    except zstandard.ZstdError as error:
        raise RecordingError(name, f"damaged: cannot be unpacked ({error})") from None
    if len(result) > limits.UNPACKED_FILE:
        raise LimitError(name, f"unpacks to more than the {limits.UNPACKED_FILE} bytes that are read")
    return result
