"""Joint logs made in every format from one source: what a robot did, in messages at given times.

The encoders are written out from the formats' rules (ROS 1, OMG CDR and XCDR2), or are the formats' own libraries.
"""

from __future__ import annotations

import io
import json
import sqlite3
import struct
from dataclasses import dataclass
from pathlib import Path

import zstandard
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from google.protobuf import json_format
from mcap.writer import Writer

from replay.logs.protobuf import descriptor_set

TIME = {"ros1msg": "time stamp", "ros2msg": "builtin_interfaces/Time stamp"}
LINE = "=" * 80 + "\n"
IDL = """================================================================================
IDL: sensor_msgs/msg/JointState
#include "std_msgs/msg/Header.idl"
module sensor_msgs {
  module msg {
    @verbatim (language="comment", text="positions")
    struct JointState {
      std_msgs::msg::Header header;
      sequence<string> name;
      sequence<double> position;
      sequence<double> velocity;
      sequence<double> effort;
    };
  };
};
================================================================================
IDL: std_msgs/msg/Header
#include "builtin_interfaces/msg/Time.idl"
module std_msgs {
  module msg {
    struct Header {
      builtin_interfaces::msg::Time stamp;
      string frame_id;
    };
  };
};
================================================================================
IDL: builtin_interfaces/msg/Time
module builtin_interfaces {
  module msg {
    struct Time {
      int32 sec;
      uint32 nanosec;
    };
  };
};
"""


@dataclass(frozen=True)
class Said:
    """One message: stamp and log time [ns], positions by joint; who said it."""

    stamp: int
    time: int
    joints: dict[str, float]
    frame_id: str = ""
    channel: int = 0


def definition(encoding: str) -> bytes:
    """The message definition of JointState."""
    if encoding == "ros2idl":
        return IDL.encode()
    sequence = "uint32 seq\n" if encoding == "ros1msg" else ""
    text = "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
    text += f"{LINE}MSG: std_msgs/Header\n{sequence}{TIME[encoding]}\nstring frame_id\n"
    if encoding == "ros2msg":
        text += f"{LINE}MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    return text.encode()


class Wire:
    """Appends values as ROS 1, CDR or XCDR2 do."""

    def __init__(self, *, order: str = "<", align: int = 8, terminated: bool = True, sized: str = "") -> None:
        self.out = bytearray()
        self.order, self.align, self.terminated, self.sized = order, align, terminated, sized

    def number(self, code: str, *values: float) -> None:
        width = struct.calcsize(f"={code}")
        for value in values:
            self.out += b"\0" * (-len(self.out) % min(width, self.align)) + struct.pack(self.order + code, value)

    def text(self, value: str) -> None:
        data = value.encode() + (b"\0" if self.terminated else b"")
        self.number("I", len(data))
        self.out += data

    def begin(self, kind: str) -> int:
        if kind not in self.sized:
            return -1
        self.number("I", 0)
        return len(self.out)

    def end(self, begin: int) -> None:
        if begin >= 0:
            self.out[begin - 4 : begin] = struct.pack(f"{self.order}I", len(self.out) - begin)

    def joint_state(self, said: Said, sequence: bool = False) -> bytes:
        whole, header = self.begin("struct"), self.begin("struct")
        if sequence:
            self.number("I", 7)
        stamp = self.begin("struct")
        self.number("I", said.stamp // 10**9, said.stamp % 10**9)
        self.end(stamp)
        self.text(said.frame_id)
        self.end(header)
        names = self.begin("texts")
        self.number("I", len(said.joints))
        for name in said.joints:
            self.text(name)
        self.end(names)
        for values in (said.joints.values(), [], [0.5]):
            self.number("I", len(values))
            self.number("d", *values)
        self.end(whole)
        return bytes(self.out)


def ros1(said: Said) -> bytes:
    return Wire(align=1, terminated=False).joint_state(said, sequence=True)


def cdr(said: Said, order: str = "<") -> bytes:
    return (b"\0\1\0\0" if order == "<" else b"\0\0\0\0") + Wire(order=order).joint_state(said)


def xcdr2(said: Said, order: str = "<", sized: str = "texts") -> bytes:
    kind = (8 if "struct" in sized else 6) + (order == "<")
    return bytes([0, kind, 0, 0]) + Wire(order=order, align=4, sized=sized).joint_state(said)


def ros_json(said: Said) -> bytes:
    stamp = {"sec": said.stamp // 10**9, "nanosec": said.stamp % 10**9}
    header = {"stamp": stamp, "frame_id": said.frame_id}
    return json.dumps({"header": header, "name": [*said.joints], "position": [*said.joints.values()]}).encode()


def states(said: Said) -> JointStates:
    message = JointStates()
    message.timestamp.FromNanoseconds(said.stamp)
    for name, position in said.joints.items():
        message.joints.add(name=name, position=position)
    return message


def protobuf(said: Said) -> bytes:
    return states(said).SerializeToString()


def protobuf_json(said: Said) -> bytes:
    return json_format.MessageToJson(states(said)).encode()


ROS = "sensor_msgs/msg/JointState"
MESSAGES = {
    "cdr": ("cdr", ROS, "ros2msg", cdr),
    "cdr, big end first": ("cdr", ROS, "ros2msg", lambda said: cdr(said, ">")),
    "cdr, idl": ("cdr", ROS, "ros2idl", cdr),
    "xcdr2": ("cdr", ROS, "ros2msg", xcdr2),
    "xcdr2, big end first": ("cdr", ROS, "ros2msg", lambda said: xcdr2(said, ">")),
    "xcdr2, sizes left out": ("cdr", ROS, "ros2msg", lambda said: xcdr2(said, sized="")),
    "xcdr2, delimited": ("cdr", ROS, "ros2idl", lambda said: xcdr2(said, sized="struct texts")),
    "ros1": ("ros1", "sensor_msgs/JointState", "ros1msg", ros1),
    "json": ("json", ROS, "jsonschema", ros_json),
    "protobuf": ("protobuf", "foxglove.JointStates", "protobuf", protobuf),
    "protobuf's json": ("json", "foxglove.JointStates", "jsonschema", protobuf_json),
}
"""Message encoding, type, encoding of the definition and encoder by format; all in MCAP."""


def mcap(said: list[Said], kind: str = "cdr") -> bytes:
    encoding, name, language, encode = MESSAGES[kind]
    text = descriptor_set(JointStates.DESCRIPTOR) if language == "protobuf" else b"{}"
    text = definition(language) if language.startswith("ros") else text
    return mcap_of([(s.channel, s.time, encode(s)) for s in said], encoding, name, language, text)


def mcap_of(messages, encoding, name, language, text, topic="/joint_states") -> bytes:
    """An MCAP file of messages: channel, log time and bytes."""
    stream = io.BytesIO()
    writer = Writer(stream, chunk_size=4096)
    writer.start()
    schema = writer.register_schema(name, language, text)
    used = sorted({channel for channel, _, _ in messages})
    channels = {channel: writer.register_channel(topic, encoding, schema) for channel in used}
    for channel, time, data in messages:
        writer.add_message(channels[channel], time, data, time)
    writer.finish()
    return stream.getvalue()


def db3(said: list[Said], *, defined: bool = True, ahead: bool = False, pack=lambda data: data) -> bytes:
    """A ROS 2 bag's database: as of rosbag2's schema 4 with definitions, or 3 without."""
    database = sqlite3.connect(":memory:")
    database.execute(
        "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL,"
        " serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)"
    )
    database.execute(
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL,"
        " data BLOB NOT NULL)"
    )
    if defined:
        database.execute(
            "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type TEXT NOT NULL, encoding TEXT NOT NULL,"
            " encoded_message_definition TEXT NOT NULL, type_description_hash TEXT NOT NULL)"
        )
        row = (1, ROS, "ros2msg", definition("ros2msg").decode(), "")
        database.execute("INSERT INTO message_definitions VALUES (?, ?, ?, ?, ?)", row)
    database.execute("INSERT INTO topics VALUES (1, '/camera', 'sensor_msgs/msg/Image', 'cdr', '')")
    for channel in sorted({s.channel for s in said}):
        database.execute("INSERT INTO topics VALUES (?, '/joint_states', ?, 'cdr', '')", (channel + 2, ROS))
    for s in said:
        row = (s.channel + 2, s.time, pack(cdr(s)))
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)", row)
    database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (1, 0, ?)", (b"pixels",))
    database.commit()
    data = database.serialize()
    database.close()
    return data[:18] + b"\2\2" + data[20:] if ahead else data


def bag(folder: Path, said: list[Said], compression: str | None = None) -> bytes:
    """A ROS 1 bag, written by `rosbags`."""
    from rosbags.rosbag1 import Writer as BagWriter

    path = folder / "made.bag"
    path.unlink(missing_ok=True)
    writer = BagWriter(path)
    if compression is not None:
        writer.set_compression(BagWriter.CompressionFormat[compression])
    with writer:
        connections = {
            channel: writer.add_connection(
                "/joint_states", ROS, msgdef=definition("ros1msg").decode(), md5sum="0" * 32, callerid=f"/node{channel}"
            )
            for channel in sorted({s.channel for s in said})
        }
        for s in said:
            writer.write(connections[s.channel], s.time, ros1(s))
    data = path.read_bytes()
    path.unlink()
    return data


def bag_folder(said: list[Said], kind: str) -> dict[str, bytes]:
    """A ROS 2 bag split into two files: of "db3" or "mcap", or "db3, packed by file" or "by message"."""
    half = len(said) // 2
    parts = (said[:half], said[half:])
    mode = kind.rpartition("packed by ")[2] if "packed" in kind else ""
    pack = zstandard.ZstdCompressor().compress
    if mode == "message":
        files = {f"made_{k}.db3": db3(part, pack=pack) for k, part in enumerate(parts)}
    elif mode == "file":
        files = {f"made_{k}.db3.zstd": pack(db3(part)) for k, part in enumerate(parts)}
    elif kind == "db3":
        files = {f"made_{k}.db3": db3(part, defined=False) for k, part in enumerate(parts)}
    else:
        files = {f"made_{k}.mcap": mcap(part) for k, part in enumerate(parts)}
    listed = "".join(f"    - {name}\n" for name in files)
    text = f"rosbag2_bagfile_information:\n  version: 5\n  relative_file_paths:\n{listed}  compression_mode: '{mode}'\n"
    return {"metadata.yaml": text.encode(), **files}


def csv(said: list[Said], separator: str = ",", decimal: str = ".", unit: str = "s") -> bytes:
    """A CSV table; a joint that a message does not tell has an empty cell."""
    names = sorted({name for s in said for name in s.joints})
    lines = [separator.join(["time", *names])]
    for s in said:
        whole, part = divmod(s.stamp, 10**9)
        time = f"{whole}.{part:09d}" if unit == "s" else str(s.stamp)
        cells = [time, *(repr(s.joints[name]) if name in s.joints else "" for name in names)]
        lines.append(separator.join(cell.replace(".", decimal) for cell in cells))
    return ("\r\n".join(lines) + "\r\n").encode()


def transforms(poses: list[tuple[int, str, str, tuple[float, ...]]]) -> bytes:
    """An MCAP file of foxglove.FrameTransforms on /tf, a message for each time [ns], child, parent and pose."""
    messages = []
    for time, child, parent, (x, y, z, *quaternion) in poses:
        message = FrameTransforms()
        one = message.transforms.add(child_frame_id=child, parent_frame_id=parent)
        one.timestamp.FromNanoseconds(time)
        one.translation.x, one.translation.y, one.translation.z = x, y, z
        one.rotation.x, one.rotation.y, one.rotation.z, one.rotation.w = quaternion
        messages.append((0, time, message.SerializeToString()))
    text = descriptor_set(FrameTransforms.DESCRIPTOR)
    return mcap_of(messages, "protobuf", "foxglove.FrameTransforms", "protobuf", text, topic="/tf")
