"""ROS messages from bytes that nobody vouches for: read within bounds, or no message."""

import struct
import time

import numpy as np
import pytest

from replay.logs.ros_schema import RosField, long_name, types_of
from replay.logs.ros_wire import decode_cdr, decode_ros1
from tests.logs import made_logs
from tests.logs.made_logs import ROS, Said

TYPES = types_of(ROS, made_logs.definition("ros2msg").decode())
SAID = Said(10**18 + 7, 0, {"shoulder": 0.5, "ellbow": -0.25, "rail": 1e-300}, "base")


def test_every_base_type_is_read_in_both_orders_and_all_alignments():
    kinds = {"bool": ("?", True), "int8": ("b", -3), "uint8": ("B", 200), "int16": ("h", -300), "uint16": ("H", 60000)}
    kinds |= {"int32": ("i", -70000), "uint32": ("I", 4 * 10**9), "int64": ("q", -(2**60)), "uint64": ("Q", 2**63)}
    kinds |= {"float32": ("f", 0.25), "float64": ("d", 0.1)}
    rng = np.random.default_rng(0)
    for _ in range(50):
        names = [str(name) for name in rng.choice([*kinds], 12)]
        types = {"a/msg/A": tuple(RosField(f"f{k}", name, 1, False) for k, name in enumerate(names))}
        for order in "<>":
            for kind, align in ((b"\0" + bytes([order == "<"]), 8), (b"\0" + bytes([6 + (order == "<")]), 4)):
                wire = made_logs.Wire(order=order, align=align)
                for name in names:
                    wire.number(*kinds[name])
                found = decode_cdr(types, "a/msg/A", kind + b"\0\0" + bytes(wire.out))
                assert [*found.values()] == [kinds[name][1] for name in names]


def test_names_that_changed_are_not_taken_from_the_message_before():
    memo = {}
    for joints in (
        {"a": 1.0, "b": 2.0},
        {"a": 1.0, "b": 2.5},
        {"a": 1.0, "c": 3.0},
        {"a": 1.0},
        {},
        {"a": 1.0, "b": 4.0},
    ):
        for frame in ("", "f", "base"):
            said = Said(5, 5, joints, frame)
            for data, decode in ((made_logs.cdr(said), decode_cdr), (made_logs.xcdr2(said), decode_cdr)):
                found = decode(TYPES, ROS, data, memo)
                assert dict(zip(found["name"], found["position"], strict=True)) == joints
                assert found["header"]["frame_id"] == frame


@pytest.mark.parametrize("kind", ["cdr", "xcdr2", "ros1"])
def test_any_other_bytes_are_no_message_or_one_within_bounds(kind):
    encode = {"cdr": made_logs.cdr, "xcdr2": made_logs.xcdr2, "ros1": made_logs.ros1}[kind]
    decode = decode_ros1 if kind == "ros1" else decode_cdr
    types = types_of(ROS, made_logs.definition("ros1msg").decode(), ros1=True) if kind == "ros1" else TYPES
    whole, rng = encode(SAID), np.random.default_rng(1)
    refused = 0
    for _ in range(2000):
        data = bytearray(whole)
        for at in rng.integers(0, len(data), int(rng.integers(1, 4))):
            data[at] = int(rng.integers(256))
        try:
            found = decode(types, ROS, bytes(data))
        except ValueError as error:
            refused += 1
            assert "\n" not in str(error)
            continue
        assert len(found["position"]) <= len(whole)
    assert refused > 300


def test_a_definition_that_holds_much_of_nothing_ends():
    types = {f"a/msg/T{k}": tuple(RosField(f"f{n}", f"a/msg/T{k + 1}", 1, False) for n in range(50)) for k in range(12)}
    types["a/msg/T12"] = ()
    begin = time.monotonic()
    with pytest.raises(ValueError, match="too much of nothing"):
        decode_cdr(types, "a/msg/T0", b"\0\1\0\0")
    assert time.monotonic() - begin < 1.0


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (b"", "less than CDR begins with"),
        (b"\0\x03\0\0", "its encoding 0x0003 is neither CDR nor"),
        (b"\0\x01\0\0", "ends inside a value"),
    ],
)
def test_other_encodings_are_named(data, message):
    with pytest.raises(ValueError, match=message):
        decode_cdr(TYPES, ROS, data)


@pytest.mark.parametrize(
    ("text", "message"),
    [("float64", "cannot be read"), ("module a { struct B { long c; }; };", "does not describe")],
)
def test_other_text_is_no_definition(text, message):
    with pytest.raises(ValueError, match=message):
        types_of(ROS, text)


def test_names_of_types():
    assert long_name("sensor_msgs/JointState") == long_name("sensor_msgs::msg::JointState") == ROS == long_name(ROS)


def test_a_text_may_end_where_its_message_does_and_no_byte_later():
    types = {"a/msg/A": (RosField("f", "string", 1, False),)}
    text = struct.pack("<I", 4) + b"abc\0"
    assert decode_cdr(types, "a/msg/A", b"\0\1\0\0" + text) == {"f": "abc"}
    assert decode_cdr(types, "a/msg/A", b"\0\1\0\0" + struct.pack("<I", 1) + b"\0") == {"f": ""}
    for cut in range(1, len(text)):
        with pytest.raises(Exception):  # noqa: B017
            decode_cdr(types, "a/msg/A", b"\0\1\0\0" + text[:-cut])
    with pytest.raises(ValueError, match="does not end in a zero byte"):
        decode_cdr(types, "a/msg/A", b"\0\1\0\0" + struct.pack("<I", 3) + b"abc")
    ros1 = struct.pack("<I", 3) + b"abc"
    assert decode_ros1(types, "a/msg/A", ros1) == {"f": "abc"}
    with pytest.raises(ValueError, match="a text claims 3 bytes, more than it holds"):
        decode_ros1(types, "a/msg/A", ros1[:-1])


HEADER = f"{made_logs.LINE}MSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\nstring more\n"


@pytest.mark.parametrize("ros1", [False, True])
def test_types_that_a_definition_leaves_out_are_ross_and_its_own_stay_its_own(ros1):
    left_out = types_of("a/msg/A", "std_msgs/Header header\ngeometry_msgs/Point at\n", ros1=ros1)
    assert [field.name for field in left_out["a/msg/A"]] == ["header", "at"]
    assert [field.name for field in left_out["geometry_msgs/msg/Point"]] == ["x", "y", "z"]
    assert [field.name for field in left_out["std_msgs/msg/Header"]] == ["seq"] * ros1 + ["stamp", "frame_id"]
    own = types_of("a/msg/A", f"std_msgs/Header header\ngeometry_msgs/Point at\n{HEADER}", ros1=ros1)
    assert [field.name for field in own["std_msgs/msg/Header"]] == ["stamp", "frame_id", "more"]
    assert "geometry_msgs/msg/Point" in own
    whole = types_of("a/msg/A", f"std_msgs/Header header\n{HEADER}", ros1=ros1)
    assert "geometry_msgs/msg/Point" not in whole
