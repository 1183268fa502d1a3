"""The message types are those of the `.proto` files."""

from __future__ import annotations

from pathlib import Path

import pytest
from foxglove_schemas_protobuf import Log_pb2
from google.protobuf.descriptor_pb2 import FileDescriptorSet
from grpc_tools import protoc

import replay
from replay.recording import messages
from replay.sensing.kinds import KINDS

SCHEMAS = Path(replay.__file__).parents[1] / "schemas"
OWN = [messages.COLLISION, messages.GUARDS, messages.LAYOUT, *(kind.message for kind in KINDS.values())]


def made(name: str) -> FileDescriptorSet:
    return FileDescriptorSet.FromString(messages.schema(name).data)


@pytest.mark.parametrize("name", OWN)
def test_types_are_those_of_the_files(name: str, tmp_path: Path) -> None:
    target = tmp_path / "compiled.binpb"
    file = f"{name.removeprefix('replay.')}.proto"
    assert protoc.main(["protoc", f"-I{SCHEMAS}", f"--descriptor_set_out={target}", file]) == 0
    assert made(name) == FileDescriptorSet.FromString(target.read_bytes())
    assert messages.schema(name).data == target.read_bytes(), "the same to the byte, as in recordings of other releases"


def test_every_file_is_a_type() -> None:
    assert sorted(f"replay.{path.stem}" for path in SCHEMAS.glob("*.proto")) == sorted(OWN)


def test_field_numbers_stay_for_ever() -> None:
    files = [file for name in OWN for file in made(name).file]
    numbers = {m.name: {f.name: f.number for f in m.field} for file in files for m in file.message_type}
    assert numbers == {
        "CollisionStates": {
            "level": 1,
            "clearance": 2,
            "evaluated": 3,
            "undecided": 4,
            "between": 5,
            "clearance_bound": 6,
        },
        "Layout": {"links": 1, "joints": 2, "pairs": 3, "shapes": 4, "objects": 5, "sensors": 6, "guards": 7},
        "GuardStates": {"state": 1, "condition": 2, "factor": 3, "rate": 4, "script_time": 5},
        "DistanceReading": {
            "status": 1,
            "distance": 2,
            "point": 3,
            "point_sensor": 4,
            "normal": 5,
            "shape": 6,
            "triangle": 7,
            "case": 8,
            "measured": 9,
        },
        "CapacitiveReading": {
            "capacitance": 1,
            "output_voltage": 2,
            "delta_output": 3,
            "saturated": 4,
            "touching": 5,
            "per_object": 6,
            "increase": 7,
            "error": 8,
            "unresolved": 9,
            "measured": 10,
        },
    }


def test_a_log_is_foxgloves_with_one_field_behind_all_of_its_own() -> None:
    theirs, ours = Log_pb2.Log.DESCRIPTOR, messages.message_class(messages.LOG).DESCRIPTOR
    assert ours.full_name == theirs.full_name
    assert [(f.name, f.number, f.type) for f in ours.fields[:-1]] == [(f.name, f.number, f.type) for f in theirs.fields]
    assert (ours.fields[-1].name, ours.fields[-1].number) == ("earliest", 1000)
    read_by_theirs = Log_pb2.Log.FromString(
        messages.message_class(messages.LOG)(line=7, earliest=5).SerializeToString()
    )
    assert read_by_theirs.line == 7
