"""Messages as columns, against the protobuf library's own reading of the same bytes."""

from __future__ import annotations

import numpy as np
import pytest
from foxglove_schemas_protobuf import FrameTransform_pb2, JointStates_pb2, LaserScan_pb2, Log_pb2
from google.protobuf import descriptor_pb2
from google.protobuf.descriptor import FieldDescriptor
from hypothesis import given
from hypothesis import strategies as st

from replay.errors import InvalidValue
from replay.logs.protobuf import message_type
from replay.logs.wire import MessageShape, Slot, shape_of


def joints_shape() -> MessageShape:
    example = JointStates_pb2.JointStates(
        timestamp={"seconds": 1 << 34, "nanos": 1 << 29},
        joints=[{"name": "a", "position": 1.0}, {"name": "longer", "position": 1.0}],
    )
    shape = shape_of(example.DESCRIPTOR, example.SerializeToString())
    assert shape is not None
    return shape


@given(
    st.lists(st.tuples(st.integers(0, 2**35 - 1), st.integers(0, 999_999_999), st.floats(), st.floats()), min_size=1)
)
def test_filled_columns_are_what_the_library_decodes(rows: list[tuple[int, int, float, float]]) -> None:
    shape = joints_shape()
    data = np.empty((len(rows), shape.length), dtype=np.uint8)
    shape.fill(data)
    seconds, nanos, first, second = (np.array(column) for column in zip(*rows, strict=True))
    shape.slots["timestamp.seconds"].write(data, seconds)
    shape.slots["timestamp.nanos"].write(data, nanos)
    shape.slots["joints[0].position"].write(data, first)
    shape.slots["joints[1].position"].write(data, second)
    assert shape.fits(data)
    for row, expected in zip(data, rows, strict=True):
        message = JointStates_pb2.JointStates.FromString(row.tobytes())
        decoded = [message.timestamp.seconds, message.timestamp.nanos, *(joint.position for joint in message.joints)]
        assert decoded[:2] == list(expected[:2])
        assert np.array(decoded[2:]).tobytes() == np.array(expected[2:]).tobytes()
        assert [joint.name for joint in message.joints] == ["a", "longer"]
    for path, column in (("timestamp.seconds", seconds), ("timestamp.nanos", nanos), ("joints[1].position", second)):
        assert shape.slots[path].read(data).astype(column.dtype).tobytes() == column.tobytes()


def test_equal_values_are_copied_between_slots_that_are_alike() -> None:
    shape = joints_shape()
    data = np.empty((3, shape.length), dtype=np.uint8)
    shape.fill(data)
    first, second, seconds = (
        shape.slots[name] for name in ("joints[0].position", "joints[1].position", "timestamp.seconds")
    )
    values = np.array([1.5, -0.0, np.inf])
    first.write(data, values)
    second.copy(data, first)
    assert first.is_like(second) and not first.is_like(seconds) and not seconds.is_like(shape.slots["timestamp.nanos"])
    assert second.read(data).tobytes() == values.tobytes()


@given(st.lists(st.floats(allow_nan=False), min_size=1, max_size=5), st.integers(1, 2**31 - 1))
def test_canonical_messages_read_the_same(ranges: list[float], seconds: int) -> None:
    message = LaserScan_pb2.LaserScan(
        timestamp={"seconds": seconds, "nanos": 5},
        frame_id="laser",
        pose={"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"x": 1, "y": 2, "z": 3, "w": 4}},
        start_angle=-1.5,
        end_angle=0.5,
        ranges=ranges,
    )
    data = message.SerializeToString()
    shape = shape_of(message.DESCRIPTOR, data)
    assert shape is not None
    rows = np.frombuffer(data, dtype=np.uint8)[None]
    assert shape.slots["ranges"].read(rows).tolist() == [ranges]
    assert shape.slots["timestamp.seconds"].read(rows).tolist() == [seconds]
    assert shape.slots["pose.orientation.w"].read(rows).tolist() == [4.0]
    assert shape.texts == {"frame_id": "laser"}


def test_what_is_not_regular_is_refused_and_never_misread() -> None:
    zero_left_out = FrameTransform_pb2.FrameTransform(translation={"x": 1.0, "y": 0.0, "z": 2.0})
    assert shape_of(zero_left_out.DESCRIPTOR, zero_left_out.SerializeToString()) is None
    whole = Log_pb2.Log(
        timestamp={"seconds": 1, "nanos": 1}, level=2, message="text", name="n", file="f", line=7
    ).SerializeToString()
    descriptor = Log_pb2.Log.DESCRIPTOR
    assert shape_of(descriptor, whole) is not None
    assert shape_of(descriptor, whole + b"\x98\x06\x01") is None  # an unknown field
    assert shape_of(descriptor, whole + whole) is None  # fields given twice
    for length in range(1, len(whole)):
        assert shape_of(descriptor, whole[:length]) is None
    shape = joints_shape()
    rows = np.zeros((1, shape.length), dtype=np.uint8)
    shape.fill(rows)
    assert shape.fits(rows)
    for offset, mask in enumerate(shape.mask):
        changed = rows.copy()
        changed[0, offset] ^= 0x80
        assert shape.fits(changed) == (mask == 0)


def test_values_too_large_for_their_bytes_are_refused() -> None:
    shape = joints_shape()
    rows = np.zeros((1, shape.length), dtype=np.uint8)
    with pytest.raises(InvalidValue):
        shape.slots["timestamp.seconds"].write(rows, np.array([2**35]))
    with pytest.raises(InvalidValue):
        shape.slots["timestamp.nanos"].write(rows, np.array([-1]))


@pytest.mark.parametrize("is_array", [False, True])
def test_varints_written_longer_than_needed_are_read(is_array: bool) -> None:
    """A writer may fill a varint with bytes that add nothing: 0x81 0x00 is 1, 0x80 0x00 is 0."""
    rows = np.array([[9, 0x81, 0x00, 9], [9, 0x80, 0x00, 9], [9, 0x80, 0x01, 9], [9, 0xFF, 0x7F, 9]], dtype=np.uint8)
    expected = {
        FieldDescriptor.TYPE_BOOL: [True, False, True, True],
        FieldDescriptor.TYPE_UINT32: [1, 0, 128, 16383],
        FieldDescriptor.TYPE_INT64: [1, 0, 128, 16383],
        FieldDescriptor.TYPE_SINT32: [-1, 0, 64, -8192],
        FieldDescriptor.TYPE_SINT64: [-1, 0, 64, -8192],
        FieldDescriptor.TYPE_ENUM: [1, 0, 128, 16383],
    }
    for kind, values in expected.items():
        slot = Slot(kind, offset=1, width=2, count=1, is_array=is_array)
        assert slot.end == 3
        found = slot.read(rows)
        assert found.reshape(-1).tolist() == values and found.ndim == 1 + is_array
        if kind not in (FieldDescriptor.TYPE_SINT32, FieldDescriptor.TYPE_SINT64, FieldDescriptor.TYPE_BOOL):
            again = np.full((4, 4), 9, dtype=np.uint8)
            slot.write(again, found)
            assert again.tolist() == rows.tolist()


LIST_KINDS = {
    "uint32": FieldDescriptor.TYPE_UINT32,
    "sint64": FieldDescriptor.TYPE_SINT64,
    "bool": FieldDescriptor.TYPE_BOOL,
    "fixed32": FieldDescriptor.TYPE_FIXED32,
    "double": FieldDescriptor.TYPE_DOUBLE,
    "uint64": FieldDescriptor.TYPE_UINT64,
}


def message_of_lists():
    """A message type with a packed list of each of these types."""
    file = descriptor_pb2.FileDescriptorProto(name="lists.proto", syntax="proto3")
    lists = file.message_type.add(name="Lists")
    for number, (name, kind) in enumerate(LIST_KINDS.items(), 1):
        lists.field.add(name=name, number=number, label=3, type=kind)
    return message_type("a", "Lists", descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString())


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("uint32", [1, 127, 3]),
        ("uint32", [128, 16383]),
        ("sint64", [-64, 63, 0]),
        ("sint64", [-(2**63), 2**63 - 1]),
        ("uint64", [2**64 - 1, 2**63]),  # varints of ten bytes, the longest there are
        ("bool", [True, False, True]),
        ("fixed32", [0, 2**32 - 1]),
        ("double", [0.0, -1.5]),
    ],
)
def test_lists_whose_values_take_equal_space_are_one_column(name, values) -> None:
    lists = message_of_lists()
    data = lists(**{name: values}).SerializeToString()
    shape = shape_of(lists.DESCRIPTOR, data)
    assert shape is not None and [*shape.slots] == [name] and shape.slots[name].is_array
    assert shape.slots[name].read(np.frombuffer(data, dtype=np.uint8)[None]).tolist() == [values]


@pytest.mark.parametrize("values", [[1, 300], [300, 1], [1, 1, 2**20], [2**20, 1, 1], [300, 300, 1, 300]])
def test_a_list_of_varints_of_different_widths_is_no_column(values) -> None:
    lists = message_of_lists()
    assert shape_of(lists.DESCRIPTOR, lists(uint32=values).SerializeToString()) is None


@pytest.mark.parametrize(
    "data",
    [
        b"\x0a\x00",  # an empty list
        b"\x0a\x02\x80\x80",  # one that ends within a varint
        b"\x0a\x0b" + b"\x80" * 10 + b"\x01",  # a varint of eleven bytes
        b"\x22\x03abc",  # three bytes of four
        b"\x22\x04abcd\x22\x04abcd",  # in two pieces
    ],
)
def test_a_list_that_is_not_as_it_should_be_is_no_column(data) -> None:
    assert shape_of(message_of_lists().DESCRIPTOR, data) is None


@pytest.mark.parametrize(
    "data",
    [
        b"\x0d\0\0\0\0",  # a uint32 as four bytes
        b"\x09" + bytes(8),  # as eight
        b"\x20\x01",  # a fixed32 as a varint
        b"\x21" + bytes(8),  # as eight bytes
        b"\x25\0\0\0",  # cut short
        b"\x2d\0\0\0\0",  # a double as four bytes
        b"\x0b",  # a group
    ],
)
def test_a_value_of_another_wire_type_than_its_field_has_is_no_slot(data) -> None:
    assert shape_of(message_of_lists().DESCRIPTOR, data) is None


@pytest.mark.parametrize(("name", "value"), [("uint32", 5), ("fixed32", 7), ("double", -0.5), ("sint64", -3)])
def test_a_list_of_one_that_is_not_packed_is_a_slot(name, value) -> None:
    number = [*LIST_KINDS].index(name) + 1
    lists = message_of_lists()
    packed = lists(**{name: [value]}).SerializeToString()[2:]
    wire = {"fixed32": 5, "double": 1}.get(name, 0)
    data = bytes([number << 3 | wire]) + packed
    assert lists.FromString(data) == lists(**{name: [value]})
    shape = shape_of(lists.DESCRIPTOR, data)
    assert shape is not None and [*shape.slots] == [f"{name}[0]"]
    assert shape.slots[f"{name}[0]"].read(np.frombuffer(data, dtype=np.uint8)[None]).tolist() == [value]
