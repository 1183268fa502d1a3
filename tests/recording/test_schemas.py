"""The compiled message types are those of the `.proto` files."""

from __future__ import annotations

from pathlib import Path

from google.protobuf.descriptor_pb2 import FileDescriptorSet
from grpc_tools import protoc

import replay

SCHEMAS = Path(replay.__file__).parents[1] / "schemas"
COMPILED = Path(replay.__file__).parent / "recording" / "replay.binpb"


def test_the_compiled_types_are_those_of_the_sources(tmp_path: Path) -> None:
    target = tmp_path / "new.binpb"
    sources = sorted(path.name for path in SCHEMAS.glob("*.proto"))
    assert protoc.main(["protoc", f"-I{SCHEMAS}", f"--descriptor_set_out={target}", *sources]) == 0
    fresh = FileDescriptorSet.FromString(target.read_bytes())
    shipped = FileDescriptorSet.FromString(COMPILED.read_bytes())
    assert shipped == fresh, "run `make schemas`"


def test_field_numbers_stay_what_they_were_in_format_1() -> None:
    shipped = FileDescriptorSet.FromString(COMPILED.read_bytes())
    numbers = {m.name: {f.name: f.number for f in m.field} for file in shipped.file for m in file.message_type}
    assert numbers == {
        "CollisionStates": {"level": 1, "clearance": 2, "evaluated": 3, "undecided": 4},
        "DistanceReading": {
            "status": 1,
            "distance": 2,
            "point": 3,
            "point_sensor": 4,
            "normal": 5,
            "shape": 6,
            "triangle": 7,
            "case": 8,
        },
        "CapacitiveReading": {
            "capacitance": 1,
            "output_voltage": 2,
            "delta_output": 3,
            "saturated": 4,
            "touching": 5,
            "per_object": 6,
        },
    }
