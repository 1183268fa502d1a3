"""Which topic carries which columns of a frame block: one table, read from both sides.

A topic's messages all have one shape (`replay.logs.wire`): it is found from an example message, made by the protobuf
library with a value other than zero in every field, and then filled for whole blocks at once.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from replay.logs.mcap_writer import MessageRows
from replay.logs.wire import MessageShape, Slot, shape_of
from replay.recording import messages
from replay.simulation import FrameBlock, Layout

Column = NDArray[Any]
Columns = dict[str, Column]

WORLD = "world"
"""The coordinate frame that every link's transform starts from."""
COLLISION_FIELDS = ("level", "clearance", "evaluated", "undecided")
DISTANCE_SCALARS = ("status", "distance", "shape", "triangle", "case")
DISTANCE_VECTORS = ("point", "point_sensor", "normal")
CAPACITIVE_FIELDS = ("capacitance", "output_voltage", "delta_output", "saturated", "touching", "per_object")

_SECOND = 1_000_000_000
_WIDE_SECONDS = 1 << 34  # an example time stamp whose varints have five bytes: room for 2^35 s
_WIDE_NANOS = 1 << 29
_STAMP = {"seconds": _WIDE_SECONDS, "nanos": _WIDE_NANOS}


@dataclass(frozen=True, eq=False)
class FrameTopic:
    """A topic with one message a frame.

    Attributes:
        name: the topic.
        type: name of its message type.
        shape: what its messages have in common.
        columns: takes a block and returns its values by field path.
    """

    name: str
    type: str
    shape: MessageShape
    columns: Callable[[FrameBlock], Columns]

    def encode(self, block: FrameBlock, channel: int) -> MessageRows:
        """Return the block's messages as records of an MCAP channel."""
        rows = MessageRows(channel, block.time, block.first, self.shape.length)
        self.shape.fill(rows.data)
        written: dict[int, Slot] = {}
        for path, values in self.columns(block).items():
            slot = self.shape.slots.get(path)
            if slot is None:  # an array without elements
                continue
            same = written.setdefault(id(values), slot)  # one time stamp stands in many places
            if same is not slot and same.is_like(slot):
                slot.copy(rows.data, same)
            else:
                slot.write(rows.data, values)
        return rows


def frame_topics(layout: Layout, *, collision: bool, distance: bool, capacitive: bool) -> Iterator[FrameTopic]:
    """Yield the topics of a recording that have a message in every frame, `/joint_states` last.

    The last one marks a block as complete for those who salvage a cut file.
    """
    yield _topic("/tf", messages.TRANSFORMS, _transforms_example(layout), _transforms(layout))
    if collision:
        pairs = len(layout.pairs)
        example = {"level": [1] * pairs, "clearance": [1.0] * pairs, "evaluated": [True] * pairs}
        yield _topic("/collision", messages.COLLISION, {**example, "undecided": [True] * pairs}, _collision)
    for index, name in enumerate(layout.distance_sensors if distance else ()):
        vectors = {field: {"x": 1.0, "y": 1.0, "z": 1.0} for field in DISTANCE_VECTORS}
        scalars = {"status": 1, "distance": 1.0, "shape": 1, "triangle": 1, "case": 1}
        yield _topic(f"/distance/{name}", messages.DISTANCE, {**scalars, **vectors}, _distance(index))
    for index, name in enumerate(layout.capacitive_sensors if capacitive else ()):
        flags = {"saturated": True, "touching": True, "per_object": [1.0] * len(layout.objects)}
        volts = {"capacitance": 1.0, "output_voltage": 1.0, "delta_output": 1.0}
        yield _topic(f"/capacitive/{name}", messages.CAPACITIVE, {**volts, **flags}, _capacitive(index))
    yield _topic("/joint_states", messages.JOINTS, _joints_example(layout), _joints)


def _topic(name: str, type_: str, example: Mapping[str, Any], columns: Callable[[FrameBlock], Columns]) -> FrameTopic:
    message = messages.message_class(type_)(**example)
    return FrameTopic(name, type_, _shape(type_, message.SerializeToString(deterministic=True)), columns)


@functools.lru_cache(maxsize=64)  # sensors are alike, and so are the runs of a night
def _shape(type_: str, example: bytes) -> MessageShape:
    shape = shape_of(messages.message_class(type_).DESCRIPTOR, example)
    assert shape is not None, f"the example of {type_} leaves a field out"
    return shape


def _stamps(block: FrameBlock, *prefixes: str) -> Columns:
    seconds, nanos = block.time // _SECOND, block.time % _SECOND
    return {
        f"{prefix}.{part}": values for prefix in prefixes for part, values in (("seconds", seconds), ("nanos", nanos))
    }


def _joints_example(layout: Layout) -> dict[str, Any]:
    return {
        "timestamp": _STAMP,
        "joints": [{"name": name, "position": 1.0, "velocity": 1.0} for name in layout.joints],
    }


def _joints(block: FrameBlock) -> Columns:
    columns = _stamps(block, "timestamp")
    for joint in range(block.joint_positions.shape[1]):
        columns[f"joints[{joint}].position"] = block.joint_positions[:, joint]
        columns[f"joints[{joint}].velocity"] = block.joint_velocities[:, joint]
    return columns


def _transforms_example(layout: Layout) -> dict[str, Any]:
    ones = {"x": 1.0, "y": 1.0, "z": 1.0}
    frames = ({"parent_frame_id": WORLD, "child_frame_id": name} for name in layout.links)
    return {
        "transforms": [
            {"timestamp": _STAMP, "translation": ones, "rotation": {**ones, "w": 1.0}, **frame} for frame in frames
        ]
    }


def _transforms(layout: Layout) -> Callable[[FrameBlock], Columns]:
    def columns(block: FrameBlock) -> Columns:
        prefixes = [f"transforms[{link}]" for link in range(len(layout.links))]
        result = _stamps(block, *(f"{prefix}.timestamp" for prefix in prefixes))
        for link, prefix in enumerate(prefixes):
            for axis, letter in enumerate("xyz"):
                result[f"{prefix}.translation.{letter}"] = block.link_poses[:, link, axis, 3]
            for axis, letter in enumerate("xyzw"):
                result[f"{prefix}.rotation.{letter}"] = block.link_quaternions[:, link, axis]
        return result

    return columns


def _collision(block: FrameBlock) -> Columns:
    assert block.collision is not None
    return {field: getattr(block.collision, field) for field in COLLISION_FIELDS}


def _distance(sensor: int) -> Callable[[FrameBlock], Columns]:
    def columns(block: FrameBlock) -> Columns:
        assert block.distance is not None
        result = {field: getattr(block.distance, field)[:, sensor] for field in DISTANCE_SCALARS}
        for field in DISTANCE_VECTORS:
            values = getattr(block.distance, field)[:, sensor]
            result |= {f"{field}.{letter}": values[:, axis] for axis, letter in enumerate("xyz")}
        return result

    return columns


def _capacitive(sensor: int) -> Callable[[FrameBlock], Columns]:
    def columns(block: FrameBlock) -> Columns:
        assert block.capacitive is not None
        return {field: getattr(block.capacitive, field)[:, sensor] for field in CAPACITIVE_FIELDS}

    return columns
