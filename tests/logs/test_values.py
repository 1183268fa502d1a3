"""Messages taken apart into values, and how many of one message are."""

from __future__ import annotations

import pytest
from foxglove_schemas_protobuf import FrameTransform_pb2, JointStates_pb2
from google.protobuf import descriptor_pb2

from replay import limits
from replay.errors import RecordingError
from replay.logs.mcap_records import Channel, Schema
from replay.logs.protobuf import descriptor_set, message_type
from replay.logs.values import value_decoder


def channel(encoding):
    return Channel(1, 1, "/a", encoding, {})


def of_protobuf(message):
    """Take a message apart as one of a channel of its type."""
    schema = Schema(message.DESCRIPTOR.full_name, "protobuf", descriptor_set(message.DESCRIPTOR))
    decode = value_decoder("a", channel("protobuf"), schema)
    assert decode is not None
    return decode(message.SerializeToString())


def test_fields_have_their_names_and_messages_that_are_not_set_are_not_there():
    state = JointStates_pb2.JointStates(joints=[{"name": "a", "position": 1.5}, {"name": "b"}])
    first, second = of_protobuf(state)["joints"]
    zero = {"velocity": 0.0, "acceleration": 0.0, "effort": 0.0}
    assert first == {"name": "a", "position": 1.5, **zero} and second == {"name": "b", "position": 0.0, **zero}
    assert "timestamp" not in of_protobuf(state)
    moved = FrameTransform_pb2.FrameTransform(timestamp={"seconds": 3, "nanos": 4}, translation={"x": 1.0})
    found = of_protobuf(moved)
    assert found["timestamp"] == {"seconds": 3, "nanos": 4} and found["translation"] == {"x": 1.0, "y": 0.0, "z": 0.0}
    assert found["parent_frame_id"] == "" and "rotation" not in found


def test_keys_of_a_map_are_texts():
    file = descriptor_pb2.FileDescriptorProto(name="a.proto", syntax="proto3")
    outer = file.message_type.add(name="A")
    for number, value in ((1, 1), (2, 11)):  # of doubles, of messages
        entry = outer.nested_type.add(name=f"M{number}Entry")
        entry.options.map_entry = True
        entry.field.add(name="key", number=1, label=1, type=5)
        entry.field.add(name="value", number=2, label=1, type=value, type_name=".B" if value == 11 else None)
        outer.field.add(name=f"m{number}", number=number, label=3, type=11, type_name=f".A.M{number}Entry")
    file.message_type.add(name="B").field.add(name="x", number=1, label=1, type=1)
    type_ = message_type("a", "A", descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString())
    message = type_(m1={7: 0.5})
    message.m2[-1].x = 2.5
    assert of_protobuf(message) == {"m1": {"7": 0.5}, "m2": {"-1": {"x": 2.5}}}


def test_a_message_has_as_many_values_as_are_taken_apart_and_not_one_more(monkeypatch: pytest.MonkeyPatch):
    state = JointStates_pb2.JointStates(joints=[{"name": "a"}, {"name": "b"}])
    joint = len(state.joints[0].DESCRIPTOR.fields)
    values = 1 + 2 + 2 * joint  # the stamp, the joints, and each one's fields
    monkeypatch.setattr(limits, "MESSAGE_VALUES", values)
    assert len(of_protobuf(state)["joints"]) == 2
    monkeypatch.setattr(limits, "MESSAGE_VALUES", values - 1)
    with pytest.raises(ValueError, match=f"more than the {values - 1} values"):
        of_protobuf(state)


@pytest.mark.parametrize(
    ("data", "values"), [(b'{"a": [1, null]}', {"a": [1, None]}), (b"[1, 2]", {"value": [1, 2]}), (b"3", {"value": 3})]
)
def test_json_of_any_kind_is_values(data, values):
    decode = value_decoder("a", channel("json"), None)
    assert decode is not None and decode(data) == values


def test_other_encodings_are_not_taken_apart():
    assert value_decoder("a", channel("cbor"), None) is None
    assert value_decoder("a", channel("protobuf"), None) is None
    with pytest.raises(RecordingError, match="cannot be used"):
        value_decoder("a", channel("protobuf"), Schema("A", "protobuf", b"\xff"))
