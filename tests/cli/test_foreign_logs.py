"""`replay info` and `replay export` on MCAP logs that others wrote."""

import csv
import json
import struct

import pyarrow.parquet
import pytest
from foxglove_schemas_protobuf.JointStates_pb2 import JointStates
from mcap.writer import Writer

from replay.cli.exit_codes import ExitCode
from replay.cli.main import run
from replay.logs.protobuf import descriptor_set
from tests.logs.mcap_bytes import Stored, build
from tests.recording.rewritten import rewritten

BEGIN = 1_700_000_000 * 10**9
STATE = b"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
"""


def cdr_state(stamp, names, positions):
    data = bytearray(b"\0\1\0\0" + struct.pack("<iI", *divmod(stamp, 10**9)))

    def sized(size, count):
        data.extend(bytes(-(len(data) - 4) % 4) + struct.pack("<I", count))
        if count and size == 8:
            data.extend(bytes(-(len(data) - 4) % 8))

    def text(value):
        sized(1, len(value) + 1)
        data.extend(value.encode() + b"\0")

    text("")
    sized(4, len(names))
    for name in names:
        text(name)
    for values in (positions, [], []):
        sized(8, len(values))
        data.extend(struct.pack(f"<{len(values)}d", *values))
    return bytes(data)


@pytest.fixture
def robot(tmp_path):
    """A robot's log: joint states as ROS 2, protobuf and JSON write them, a JSON topic, bytes, and one without any."""
    path = tmp_path / "robot.mcap"
    with path.open("wb") as stream:
        writer = Writer(stream, chunk_size=500)
        writer.start("ros2", "a robot")
        ros = writer.register_schema("sensor_msgs/msg/JointState", "ros2msg", STATE)
        proto = writer.register_schema("foxglove.JointStates", "protobuf", descriptor_set(JointStates.DESCRIPTOR))
        channels = {
            "/joint_states": writer.register_channel("/joint_states", "cdr", ros),
            "/arm": writer.register_channel("/arm", "protobuf", proto),
            "/status": writer.register_channel("/status", "json", 0),
            "/raw": writer.register_channel("/raw", "", 0),
            "/silent": writer.register_channel("/silent", "cdr", ros),
        }
        for k in reversed(range(21)):
            time = BEGIN + k * 100_000_000
            state = cdr_state(time - 5, ["elbow", "lift"], [k * 0.05, -k])
            arm = JointStates(joints=[{"name": "wrist", "position": k / 4}])
            if k % 2:
                arm.joints.add(name="hand", velocity=1.0)
            status = {"ok": k > 3, "count": k, "text": f"n{k}", "pose": {"x": k / 2, "list": [k, None]}}
            if k == 20:
                status["last"] = [1] * 100
            for topic, data in (
                ("/joint_states", state),
                ("/arm", arm.SerializeToString()),
                ("/status", json.dumps(status).encode()),
                ("/raw", bytes([k]) * (300 if k == 7 else 2)),
            ):
                writer.add_message(channels[topic], time, data, time)
        writer.add_attachment(1, 2, "calibration.txt", "text/plain", b"12345")
        writer.finish()
    return path


def test_info_lists_topics_span_and_the_joints_of_any_log(robot, capsys):
    assert run(["info", str(robot)]) is ExitCode.FINE
    text = capsys.readouterr().out
    assert f"{robot}: 84 messages, 2 s, {robot.stat().st_size} bytes, written by a robot" in text
    assert "2023-11-14 22:13:20 to 2023-11-14 22:13:22 UTC" in text
    assert "joints of /joint_states, for motion: {recorded: {file: robot.mcap}}" in text
    assert "joints of /arm, for motion: {recorded: {file: robot.mcap, topic: /arm}}" in text
    assert "  elbow  21 samples, 0 to 1\n  lift   21 samples, -20 to 0\n" in text
    assert run(["info", str(robot), "--format", "json"]) is ExitCode.FINE
    found = json.loads(capsys.readouterr().out)
    assert found["topics"] == [
        {"topic": "/arm", "schema": "foxglove.JointStates", "messages": 21},
        {"topic": "/joint_states", "schema": "sensor_msgs/msg/JointState", "messages": 21},
        {"topic": "/raw", "schema": "", "messages": 21},
        {"topic": "/silent", "schema": "sensor_msgs/msg/JointState", "messages": 0},
        {"topic": "/status", "schema": "", "messages": 21},
    ]
    assert (found["seconds"], found["loss"], found["provenance"]) == (2.0, None, None)
    assert (found["begin"], found["end"]) == (BEGIN, BEGIN + 2 * 10**9)
    assert found["joints"] == [
        {"topic": "/arm", "joint": "wrist", "samples": 21, "lower": 0.0, "upper": 5.0},
        {"topic": "/joint_states", "joint": "elbow", "samples": 21, "lower": 0.0, "upper": 1.0},
        {"topic": "/joint_states", "joint": "lift", "samples": 21, "lower": -20.0, "upper": 0.0},
    ]
    assert found["files"] == {"calibration.txt": 5}


def test_info_of_a_recording_has_the_same_keys(recorded, robot, capsys):
    keys = []
    for path in (robot, recorded / "swing.mcap"):
        assert run(["info", str(path), "--format", "json"]) is ExitCode.FINE
        found = json.loads(capsys.readouterr().out)
        keys.append(list(found))
    assert keys[0] == keys[1]
    (swing,) = found["joints"]
    assert (swing["topic"], swing["joint"], swing["samples"], swing["lower"]) == ("/joint_states", "swing", 61, 0.0)
    assert swing["upper"] == pytest.approx(1.0471975511965976)
    assert found["seconds"] == 1.0


def rows(path):
    with path.open(newline="") as stream:
        return list(csv.DictReader(stream))


def test_export_writes_what_the_messages_say(robot, tmp_path, capsys):
    assert run(["export", str(robot), "--format", "csv", "-o", str(tmp_path / "out")]) is ExitCode.FINE
    captured = capsys.readouterr()
    assert "topic '/raw' is written as bytes" in captured.err
    joints = rows(tmp_path / "out" / "robot.joint_states.csv")
    assert [int(row["time [ns]"]) for row in joints] == [BEGIN + k * 100_000_000 for k in range(21)]
    assert [int(row["header.stamp [ns]"]) for row in joints] == [BEGIN + k * 100_000_000 - 5 for k in range(21)]
    assert [float(row["elbow position"]) for row in joints] == [k * 0.05 for k in range(21)]
    assert [float(row["lift position"]) for row in joints] == [-k for k in range(21)]
    arm = rows(tmp_path / "out" / "robot.arm.csv")
    assert [row["hand velocity"] for row in arm] == ["1" if k % 2 else "" for k in range(21)]
    status = rows(tmp_path / "out" / "robot.status.csv")
    assert [row["text"] for row in status] == [f"n{k}" for k in range(21)]
    assert [row["pose.list[0]"] for row in status] == [str(k) for k in range(21)]
    assert [row["ok"] for row in status] == ["true" if k > 3 else "false" for k in range(21)]
    assert json.loads(status[20]["last"]) == [1] * 100
    raw = rows(tmp_path / "out" / "robot.raw.csv")
    assert raw[3]["data"] == "0303" and raw[7]["data"].startswith("300 bytes, sha256 ")
    assert rows(tmp_path / "out" / "robot.silent.csv") == []


def test_export_as_json_and_parquet(robot, tmp_path):
    out = tmp_path / "out"
    assert run(["export", str(robot), "--format", "json", "-o", str(out), "--topic", "/[as]*"]) is ExitCode.FINE
    document = json.loads((out / "robot.json").read_text())
    assert document["provenance"] is None and sorted(document["topics"]) == ["/arm", "/silent", "/status"]
    assert document["topics"]["/status"]["count"] == list(range(21))
    assert document["topics"]["/arm"]["hand velocity"][:2] == [None, 1.0]
    assert run(["export", str(robot), "--format", "parquet", "-o", str(out), "--topic", "/status"]) is ExitCode.FINE
    table = pyarrow.parquet.read_table(out / "robot.status.parquet")
    assert table["pose.x"].to_pylist() == [k / 2 for k in range(21)]
    assert table["ok"].to_pylist() == [k > 3 for k in range(21)]
    assert run(["export", str(robot), "--format", "csv", "-o", str(out), "--topic", "/none"]) is ExitCode.INVALID


def test_a_cut_log_is_told_up_to_the_cut(robot, tmp_path, capsys):
    data = robot.read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(data[: len(data) // 3])
    assert run(["info", str(cut), "--format", "json"]) is ExitCode.LOSSES
    captured = capsys.readouterr()
    found = json.loads(captured.out)
    kept = sum(topic["messages"] for topic in found["topics"])
    assert 0 < kept < 84 and found["loss"]["bytes"] > 0
    assert f"cut at byte {len(data) // 3}" in captured.err and captured.err.endswith(f"; {kept} messages before it\n")
    assert run(["export", str(cut), "--format", "csv", "-o", str(tmp_path)]) is ExitCode.LOSSES
    cut.write_bytes(data[:60])
    for command in (["info", str(cut)], ["export", str(cut), "--format", "csv"]):
        assert run(command) is ExitCode.INVALID
        assert "nothing can be salvaged: cut at byte 60" in capsys.readouterr().err


def test_a_topic_whose_messages_are_not_what_its_schema_says_is_written_as_bytes(tmp_path, capsys):
    stored = Stored(
        {1: ("sensor_msgs/msg/JointState", "ros2msg", STATE)},
        {1: (1, "/joint_states", "cdr"), 2: (0, "/odd", "json"), 3: (0, "/value", "json")},
        [(1, 5, b"\0\1\0\0\x01"), (2, 6, b"{"), (3, 7, b"[1, 18446744073709551616]"), (3, 8, b'"\\u00e9"')],
        {},
        {},
    )
    path = tmp_path / "odd.mcap"
    path.write_bytes(build(stored, ("chunks", "counts", "channels again")))
    assert run(["info", str(path), "--format", "json"]) is ExitCode.FINE
    assert json.loads(capsys.readouterr().out)["joints"] == []
    assert run(["export", str(path), "--format", "json", "-o", str(tmp_path)]) is ExitCode.FINE
    assert capsys.readouterr().err.count("is written as bytes") == 2
    topics = json.loads((tmp_path / "odd.json").read_text())["topics"]
    assert topics["/odd"] == {"time [ns]": [6], "data": ["7b"]}
    assert topics["/value"] == {
        "time [ns]": [7, 8],
        "value[0]": [1, None],
        "value[1]": ["18446744073709551616", None],
        "value": [None, "é"],
    }


def test_a_log_without_topics_is_told_as_one(tmp_path, capsys):
    path = tmp_path / "empty.mcap"
    path.write_bytes(build(Stored({}, {}, [], {"note": b"hello"}, {}), ()))
    assert run(["info", str(path)]) == ExitCode.FINE
    capsys.readouterr()
    for form, files in (("csv", 0), ("json", 1), ("parquet", 0)):
        assert run(["export", str(path), "--format", form, "-o", str(tmp_path / form)]) == ExitCode.FINE
        told = capsys.readouterr()
        assert len(told.out.splitlines()) == files
        assert "has no topics" in told.err
    assert json.loads((tmp_path / "json" / "empty.json").read_text())["topics"] == {}


def test_a_pointer_of_git_lfs_is_told_as_one(tmp_path, capsys):
    path = tmp_path / "log.mcap"
    path.write_text("version https://git-lfs.github.com/spec/v1\noid sha256:4d7a21\nsize 12345\n")
    for command in (["info", str(path)], ["export", str(path), "--format", "csv"], ["diff", str(path), str(path)]):
        assert run(command) is ExitCode.INVALID
        assert "is a Git LFS pointer" in capsys.readouterr().err


def test_a_recording_with_a_topic_of_another_tool_is_read(recorded, tmp_path):
    path = tmp_path / "annotated.mcap"
    path.write_bytes(rewritten((recorded / "swing.mcap").read_bytes(), extra={"/note": b"seen"}))
    assert run(["info", str(path)]) is ExitCode.FINE
    assert run(["diff", str(recorded / "swing.mcap"), str(path)]) is ExitCode.FINE
