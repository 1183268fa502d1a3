"""The same messages as `made_logs` writes, in files that other libraries make from values to the last byte."""

from __future__ import annotations

import csv
import io
import shutil
from pathlib import Path

import numpy as np
import pyarrow
import pyarrow.csv
from mcap_protobuf.writer import Writer as ProtobufWriter
from mcap_ros1._vendor.genpy import Time, dynamic
from mcap_ros1.writer import Writer as Ros1Writer
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags import rosbag1, rosbag2
from rosbags.typesys import Stores, get_typestore

from tests.logs.made_logs import ROS, Said, definition, states

ROS1 = "sensor_msgs/JointState"
TOPIC = "/joint_states"


def mcap_ros1(said: list[Said]) -> bytes:
    """ROS 1 messages in MCAP, by mcap_ros1."""
    kinds = dynamic.generate_dynamic(ROS1, definition("ros1msg").decode())
    stream = io.BytesIO()
    with Ros1Writer(stream, chunk_size=4096) as writer:
        for k, s in enumerate(said):
            stamp = Time(s.stamp // 10**9, s.stamp % 10**9)
            header = kinds["std_msgs/Header"](seq=k, stamp=stamp, frame_id=s.frame_id)
            message = kinds[ROS1](header=header, name=[*s.joints], position=[*s.joints.values()])
            writer.write_message(TOPIC, message, s.time, s.time, k)
    return stream.getvalue()


def mcap_ros2(said: list[Said]) -> bytes:
    """ROS 2 messages in MCAP, by mcap_ros2."""
    stream = io.BytesIO()
    with Ros2Writer(stream, chunk_size=4096) as writer:
        schema = writer.register_msgdef(ROS, definition("ros2msg").decode())
        for k, s in enumerate(said):
            header = {"stamp": {"sec": s.stamp // 10**9, "nanosec": s.stamp % 10**9}, "frame_id": s.frame_id}
            values = {"header": header, "name": [*s.joints], "position": [*s.joints.values()]}
            writer.write_message(TOPIC, schema, values, s.time, s.time, k)
    return stream.getvalue()


def mcap_protobuf(said: list[Said]) -> bytes:
    """Foxglove's joint states in MCAP, by mcap_protobuf."""
    stream = io.BytesIO()
    with ProtobufWriter(stream, chunk_size=4096) as writer:
        for s in said:
            writer.write_message(TOPIC, states(s), s.time, s.time)
    return stream.getvalue()


def _ros_message(store, said: Said, **header):
    time, head, state = (store.types[name] for name in ("builtin_interfaces/msg/Time", "std_msgs/msg/Header", ROS))
    stamp = time(sec=said.stamp // 10**9, nanosec=said.stamp % 10**9)
    none = np.zeros(0)
    return state(
        head(stamp=stamp, frame_id=said.frame_id, **header),
        [*said.joints],
        np.array([*said.joints.values()]),
        none,
        none,
    )


def rosbag1_bag(folder: Path, said: list[Said]) -> bytes:
    """A ROS 1 bag, packed by LZ4, by rosbags and its own types."""
    store = get_typestore(Stores.ROS1_NOETIC)
    path = folder / "other.bag"
    writer = rosbag1.Writer(path)
    writer.set_compression(rosbag1.Writer.CompressionFormat.LZ4)
    with writer:
        connection = writer.add_connection(TOPIC, ROS, typestore=store)
        for k, s in enumerate(said):
            writer.write(connection, s.time, store.serialize_ros1(_ros_message(store, s, seq=k), ROS))
    data = path.read_bytes()
    path.unlink()
    return data


def rosbag2_folder(folder: Path, said: list[Said], kind: str) -> dict[str, bytes]:
    """A ROS 2 bag's folder by rosbags: "sqlite3" or "mcap", or "sqlite3, packed by file" or "by message"."""
    store = get_typestore(Stores.ROS2_JAZZY)
    path = folder / "other"
    plugin = rosbag2.StoragePlugin.MCAP if kind.startswith("mcap") else rosbag2.StoragePlugin.SQLITE3
    writer = rosbag2.Writer(path, version=9 if plugin == rosbag2.StoragePlugin.MCAP else 8, storage_plugin=plugin)
    if "packed" in kind:
        mode = rosbag2.CompressionMode[kind.rpartition("by ")[2].upper()]
        writer.set_compression(mode, rosbag2.CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(TOPIC, ROS, typestore=store)
        for s in said:
            writer.write(connection, s.time, store.serialize_cdr(_ros_message(store, s), ROS))
    files = {file.name: file.read_bytes() for file in path.iterdir()}
    shutil.rmtree(path)
    return files


def quoted_tabs(said: list[Said]) -> bytes:
    """A table of quoted cells between tabs, by Python's csv; a joint that a message does not tell has an empty cell."""
    names = sorted({name for s in said for name in s.joints})
    stream = io.StringIO()
    writer = csv.DictWriter(stream, ["time [ns]", *names], restval="", dialect="excel-tab", quoting=csv.QUOTE_ALL)
    writer.writeheader()
    writer.writerows({"time [ns]": s.stamp, **s.joints} for s in said)
    return stream.getvalue().encode()


def arrow_csv(said: list[Said]) -> bytes:
    """A table by pyarrow; null for a joint that a message does not tell."""
    names = sorted({name for s in said for name in s.joints})
    columns = {"time [ns]": [s.stamp for s in said]} | {name: [s.joints.get(name) for s in said] for name in names}
    sink = pyarrow.BufferOutputStream()
    pyarrow.csv.write_csv(pyarrow.table(columns), sink)
    return sink.getvalue().to_pybytes()
