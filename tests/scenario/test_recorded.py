"""Motion taken from logs: as replay, Foxglove and ROS 2 write them, and CSV; and what is refused."""

import io
import json
import struct

import numpy as np
import pytest
from mcap.writer import Writer

import replay
from replay.errors import MotionLimitError, ScenarioError
from replay.recording.record import record

SCENARIO = """
version: 1
name: again
rate: 50 Hz
duration: 2 s
links:
  base: {shapes: {foot: {type: cube, size: 0.2}}}
  arm: {parent: base, joint: {name: swing, type: revolute, axis: [0, 1, 0], lower: -90 deg, upper: 90 deg}}
  rail: {parent: base, joint: {name: lift, type: prismatic, axis: [0, 0, 1], lower: 0, upper: 1}}
collision: {pairs: none}
motion: MOTION
"""
SECONDS = np.array([0.0, 0.3, 0.9, 1.0, 1.5])
SWING = np.array([0.0, 10.0, 25.0, 20.0, -30.0])  # deg
LIFT = np.array([0.0, 0.1, 0.4, 0.4, 0.2])  # m
ROS = """std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def cdr(stamp_ns: int, joints: dict[str, float]) -> bytes:
    """A sensor_msgs/msg/JointState in little-endian CDR, written out by hand from the OMG's rules."""
    out = bytearray(struct.pack("<iI", stamp_ns // 10**9, stamp_ns % 10**9))

    def text(value: str) -> None:
        out.extend(b"\0" * (-len(out) % 4) + struct.pack("<I", len(value) + 1) + value.encode() + b"\0")

    def doubles(values: list[float]) -> None:
        out.extend(b"\0" * (-len(out) % 4) + struct.pack("<I", len(values)))
        if values:
            out.extend(b"\0" * (-len(out) % 8) + struct.pack(f"<{len(values)}d", *values))

    text("map")
    out.extend(b"\0" * (-len(out) % 4) + struct.pack("<I", len(joints)))
    for name in joints:
        text(name)
    doubles(list(joints.values()))
    doubles([])
    doubles([])
    return b"\0\1\0\0" + bytes(out)


def ros_json(stamp_ns: int, joints: dict[str, float]) -> bytes:
    stamp = {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}
    return json.dumps({"header": {"stamp": stamp}, "name": list(joints), "position": list(joints.values())}).encode()


EPOCH = 1_700_000_000_123_456_789  # [ns]
NANOSECONDS = [round(second * 1e9) for second in SECONDS]
JOINTS = [{"j1": swing, "lift": lift} for swing, lift in zip(SWING, LIFT, strict=True)]


def written(kind: str, messages: list[tuple[int, int, bytes]], description: str = "ros2msg") -> bytes:
    """A log of messages with joint states: channel, log time [ns] and bytes of each."""
    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start()
    name = "sensor_msgs/msg/JointState"
    schema = writer.register_schema(name, description if kind == "cdr" else "jsonschema", ROS.encode())
    channels = [writer.register_channel("/joint_states", kind, schema) for _ in range(2)]
    for channel, time, data in messages:
        writer.add_message(channels[channel], time, data, time)
    writer.finish()
    return stream.getvalue()


def log(kind: str, epoch: int = EPOCH) -> bytes:
    """A robot's log that begins at an odd epoch, with every sample of both joints."""
    encode = cdr if kind == "cdr" else ros_json
    return written(kind, [(0, 5, encode(epoch + at, joints)) for at, joints in zip(NANOSECONDS, JOINTS, strict=True)])


def json_log(*messages: object) -> dict[str, bytes]:
    """A log of JSON messages, one a second."""
    return {"robot.mcap": written("json", [(0, k * 10**9, json.dumps(m).encode()) for k, m in enumerate(messages)])}


def load(tmp_path, motion, files=()):
    for name, data in dict(files).items():
        (tmp_path / name).write_bytes(data)
    path = tmp_path / "again.yaml"
    path.write_text(SCENARIO.replace("MOTION", motion))
    return replay.load(path)


def positions(scenario):
    return np.concatenate([block.joint_positions for block in replay.simulate(scenario)])


FRAMES = np.arange(101) / 50
EXPECTED = np.stack([np.interp(FRAMES, SECONDS, LIFT), np.radians(np.interp(FRAMES, SECONDS, SWING))], axis=1)
ATOL = 1e-9  # [rad, m] stamps are whole nanoseconds, and the joints move by less than 2 a second


@pytest.mark.parametrize("kind", ["cdr", "json"])
def test_a_robots_log_moves_the_joints(tmp_path, kind):
    motion = "{recorded: {file: robot.mcap, joints: {swing: {name: j1, unit: deg}, lift: {name: lift}}}}"
    scenario = load(tmp_path, motion, {"robot.mcap": log(kind)})
    np.testing.assert_allclose(positions(scenario), EXPECTED, atol=ATOL)
    assert "robot.mcap" in scenario.sources


@pytest.mark.parametrize("stamps", ["of a simulated clock", "missing", "as rosbridge names them"])
def test_samples_stand_at_their_stamps_or_without_any_at_their_log_times(tmp_path, stamps):
    messages = []
    for at, joints in zip(NANOSECONDS, JOINTS, strict=True):
        if stamps == "of a simulated clock":  # it begins at zero, and the log goes by another clock
            messages.append((0, EPOCH + 3 * at, ros_json(at, joints)))
        elif stamps == "missing":
            messages.append((0, EPOCH + at, ros_json(0, joints)))
        else:
            data = ros_json(EPOCH + at, joints).replace(b'"nanosec"', b'"nsecs"').replace(b'"sec"', b'"secs"')
            messages.append((0, EPOCH + 3 * at, data))
    motion = "{recorded: {file: robot.mcap, joints: {swing: {name: j1, unit: deg}, lift: {name: lift}}}}"
    got = positions(load(tmp_path, motion, {"robot.mcap": written("json", messages)}))
    np.testing.assert_allclose(got, EXPECTED, atol=ATOL)


def test_two_publishers_may_share_a_topic_but_not_a_joint(tmp_path):
    both = zip(NANOSECONDS, JOINTS, strict=True)
    parts = [(at, channel, {name: joints[name]}) for at, joints in both for channel, name in enumerate(("j1", "lift"))]
    shared = written("cdr", [(channel, at, cdr(EPOCH + at, joint)) for at, channel, joint in parts])
    motion = "{recorded: {file: robot.mcap, joints: {swing: {name: j1, unit: deg}, lift: {name: lift}}}}"
    np.testing.assert_allclose(positions(load(tmp_path, motion, {"robot.mcap": shared})), EXPECTED, atol=ATOL)
    in_turn = written("cdr", [(k % 2, at, cdr(EPOCH + at, JOINTS[k])) for k, at in enumerate(NANOSECONDS)])
    with pytest.raises(ScenarioError, match="moved by several publishers"):
        load(tmp_path, motion, {"robot.mcap": in_turn})
    one_after_the_other = written(
        "cdr", [(int(k < 3), at, cdr(EPOCH + at, JOINTS[k])) for k, at in enumerate(NANOSECONDS)]
    )
    np.testing.assert_allclose(
        positions(load(tmp_path, motion, {"robot.mcap": one_after_the_other})), EXPECTED, atol=ATOL
    )


def test_a_csv_moves_the_joints_and_empty_cells_are_no_samples(tmp_path):
    rows = "".join(f"{s * 1e3},{a},{z}\n" for s, a, z in zip(SECONDS, SWING, LIFT, strict=True))
    table = "t_ms,swing,lift\n" + rows.replace("300.0,10.0,0.1\n", "300.0,10.0,0.1\n400.0,,0.1\n")
    motion = "{recorded: {file: log.csv, time: {column: t_ms, unit: ms}, joints: {swing: {name: swing, unit: deg}}}}"
    table = (
        table.replace("swing,lift\n", "swing,lift,remark\n").replace(",0.4\n", ",0.4,up\n").replace("0.1\n", "0.1,\n")
    )
    table = table.replace("0.0\n", "0.0,\n").replace("0.2\n", "0.2,down\n")  # a column of text is of no concern
    got = positions(load(tmp_path, motion, {"log.csv": table.encode()}))
    np.testing.assert_allclose(got[:, 1], EXPECTED[:, 1], atol=ATOL)
    assert not got[:, 0].any()


def test_start_shifts_the_log_and_joints_of_the_same_name_need_no_mapping(tmp_path):
    motion = "{recorded: {file: robot.mcap, start: 0.9 s}}"
    got = positions(load(tmp_path, motion, {"robot.mcap": log("cdr")}))
    np.testing.assert_allclose(got[:, 0], np.interp(FRAMES + 0.9, SECONDS, LIFT), atol=ATOL)
    assert not got[:, 1].any()  # the log has no joint `swing`


def test_joints_that_begin_later_keep_their_times(tmp_path):
    table = b"time,swing,lift\n10,,0\n11,0,0\n12,1,0.5\n"
    got = positions(load(tmp_path, "{recorded: {file: log.csv}}", {"log.csv": table}))
    np.testing.assert_allclose(got[:, 0], np.interp(FRAMES, [0, 1, 2], [0, 0, 0.5]), atol=ATOL)
    np.testing.assert_allclose(got[:, 1], np.interp(FRAMES, [1, 2], [0, 1]), atol=ATOL)


def test_a_recording_of_replay_moves_the_joints_as_they_were_recorded(tmp_path):
    first = load(tmp_path, "{recorded: {file: robot.mcap}}", {"robot.mcap": log("cdr")})
    paths = record(first, tmp_path / "out", rrd=False)
    (tmp_path / "old.mcap").write_bytes(paths.mcap.read_bytes())
    np.testing.assert_array_equal(positions(load(tmp_path, "{recorded: {file: old.mcap}}")), positions(first))


GOOD = {"robot.mcap": log("cdr"), "log.csv": b"time,swing\n0,0\n0.5,1\n"}


@pytest.mark.parametrize(
    ("motion", "files", "message"),
    [
        ("{recorded: {file: none.mcap}}", {}, "does not exist"),
        ("{recorded: {file: log.txt}}", {"log.txt": b""}, "neither a .mcap nor a .csv"),
        (
            "{recorded: {file: robot.mcap, topic: /joints}}",
            {},
            "has no topic '/joints'; its topics are ['/joint_states']",
        ),
        ("{recorded: {file: robot.mcap, time: {unit: ms}}}", {}, "has no effect with a .mcap"),
        ("{recorded: {file: log.csv, topic: /x}}", {}, "has no effect with a .csv"),
        ("{recorded: {file: cut.mcap}}", {"cut.mcap": log("cdr")[:-40]}, "damaged: its end is missing"),
        (
            "{recorded: {file: robot.mcap, joints: {swing: {name: j2}}}}",
            {},
            "is not in the log; its joints are j1, lift",
        ),
        ("{recorded: {file: robot.mcap, joints: {swing: {name: j1, unit: cm}}}}", {}, "is no unit of joint 'swing'"),
        ("{recorded: {file: robot.mcap, joints: {arm: {name: j1}}}}", {}, "is no joint with a position"),
        ("{recorded: {file: robot.mcap, joints: {swing: {name: j1}}}}", {}, "breaks a limit"),  # degrees taken as rad
        ("{recorded: {file: robot.mcap, max_gap: 0.55 s}}", {}, "gap of 0.6 s in the log at 0.3 s"),
        (
            "{recorded: {file: log.csv}, points: {swing: [{time: 0, position: 0}]}}",
            {},
            "has no joint of the scenario's",
        ),
        (
            "{recorded: {file: log.csv, joints: {swing: {name: swing}}}, points: {swing: [{time: 0, position: 0}]}}",
            {},
            "motion.points moves as well",
        ),
        ("{recorded: {file: log.csv, time: {column: t}}}", {}, "has no column 't'; its columns are ['time', 'swing']"),
        ("{recorded: {file: log.csv}}", {"log.csv": b"time,swing\n0,0\n1,x\n"}, "line 3, column 'swing': 'x' is not"),
        ("{recorded: {file: log.csv}}", {"log.csv": b"time,swing\n0,0\n1,nan\n"}, "'nan' is not a finite number"),
        ("{recorded: {file: log.csv}}", {"log.csv": b"time,swing\n0,0\n1\n"}, "line 3 has 1 cells"),
        (
            "{recorded: {file: log.csv}}",
            {"log.csv": b"time,swing\n1,0\n0.5,1\n"},
            "times in the log that do not increase",
        ),
        (
            "{recorded: {file: log.csv}}",
            {"log.csv": b"time,swing\n1,0\n1,1\n"},
            "times in the log that do not increase",
        ),
        (
            "{recorded: {file: robot.mcap}}",
            {"robot.mcap": written("cdr", [(0, 0, cdr(0, {"swing": 1.0}))], "flatbuffer")},
            "as cdr with a schema in flatbuffer; read are",
        ),
        (
            "{recorded: {file: robot.mcap}}",
            json_log({"name": ["swing"], "position": []}),
            "no message with positions of joints on topic '/joint_states'",
        ),
        (
            "{recorded: {file: robot.mcap}}",
            json_log({"name": ["swing", "lift"], "position": [1.0]}),
            "it names 2 joints and gives 1 positions",
        ),
        (
            "{recorded: {file: robot.mcap}}",
            json_log({"header": {"stamp": {"sec": 1.25}}, "name": ["swing"], "position": [1.0]}),
            "its time stamp has 1.25, no whole number",
        ),
        (
            "{recorded: {file: robot.mcap}}",
            json_log({"timestamp": "last Tuesday", "joints": [{"name": "swing", "position": 1.0}]}),
            'its time stamp is "last Tuesday", no date such as 2024-05-01T12:00:00.5Z',
        ),
        (
            "{recorded: {file: robot.mcap}}",
            json_log({"header": {"stamp": {"ticks": 7}}, "name": ["swing"], "position": [1.0]}),
            "its time stamp has 'ticks' where 'sec' and 'nanosec' are read",
        ),
        (
            "{recorded: {file: robot.mcap}}",
            json_log({"name": ["swing"], "position": [True]}),
            "a position is true, no number",
        ),
        (
            "{recorded: {file: robot.mcap}}",
            json_log({"name": ["swing"], "position": ["NaN"]}),
            "no finite number: sample 0",
        ),
        ("{recorded: {file: log.csv}}", {"log.csv": b"time\n\xff\xfe"}, "line 2: byte 0xff is not UTF-8"),
        ("{recorded: {file: log.csv}}", {"log.csv": b""}, "has no headings in its first line"),
        ("{recorded: {file: log.csv}}", {"log.csv": b"time,swing\n0,0\n1,1_0\n"}, "'1_0' is not a finite number"),
        ("{recorded: {file: log.csv}}", {"log.csv": b"time,swing\n0,0\n1e300,1\n"}, "line 3, column 'time': 1e300 is"),
        ("{recorded: {file: robot.mcap}}", {"robot.mcap": log("json", epoch=1 << 64)}, "has a sample at 1.84467e+10 s"),
        ("{recorded: {file: log.csv, joints: {swing: {name: swing}}}}", {"log.csv": b"time,swing\n"}, "no samples"),
        ("{recorded: {file: log.csv, start: 2 s}}", {}, "is after the log's last sample, 0.5 s after its first"),
    ],
)
def test_what_a_log_cannot_tell_is_refused_with_its_place(tmp_path, motion, files, message):
    with pytest.raises(ScenarioError) as caught:
        load(tmp_path, motion, GOOD | files)
    assert message in str(caught.value)
    assert "again.yaml:11:" in str(caught.value)
    assert not isinstance(caught.value, MotionLimitError)


def test_any_damage_to_a_log_is_refused_or_changes_nothing(tmp_path):
    rng = np.random.default_rng(8)
    whole = log("cdr")
    good = positions(load(tmp_path, "{recorded: {file: robot.mcap}}", {"robot.mcap": whole}))
    refused = 0
    for _ in range(60):
        data = bytearray(whole)
        at = int(rng.integers(len(data)))
        data[at] ^= 1 << int(rng.integers(8))
        try:
            scenario = load(tmp_path, "{recorded: {file: robot.mcap}}", {"robot.mcap": bytes(data)})
        except ScenarioError:
            refused += 1
            continue
        np.testing.assert_array_equal(positions(scenario), good)
    assert refused > 20
