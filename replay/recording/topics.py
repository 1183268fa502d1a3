"""Which topic carries which columns of a frame block: one table, read from both sides.

A topic's messages all have one shape (`replay.logs.wire`): it is found from an example message, made by the protobuf
library with a value other than zero in every field, and then filled for whole blocks at once.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from replay.collision.columns import CollisionColumns
from replay.guarding.columns import GuardColumns
from replay.kinematics.linkage import WORLD
from replay.logs.mcap_writer import MessageRows, rows_of_chunk
from replay.logs.wire import MessageShape, Slot, shape_of
from replay.numerics.arrays import Column
from replay.numerics.columns import Field, components
from replay.numerics.constants import SECOND
from replay.recording import messages
from replay.sensing.kinds import KINDS
from replay.simulation import FrameBlock, Layout

Columns = dict[str, Column]

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

    def encode(self, block: FrameBlock, channel: int) -> Iterator[MessageRows]:
        """Yield the block's messages as records of an MCAP channel, as many at once as go into a chunk."""
        columns = self.columns(block)
        step = rows_of_chunk(self.shape.length)
        for first in range(0, len(block.time), step):
            part = slice(first, first + step)
            rows = MessageRows(channel, block.time[part], block.first + first, self.shape.length)
            self.shape.fill(rows.data)
            written: dict[int, Slot] = {}
            for path, values in columns.items():
                slot = self.shape.slots.get(path)
                if slot is None:  # an array without elements
                    continue
                same = written.setdefault(id(values), slot)  # one time stamp stands in many places
                if same is not slot and same.is_like(slot):
                    slot.copy(rows.data, same)
                else:
                    slot.write(rows.data, values[part])
            yield rows


def frame_topics(layout: Layout, *, collision: bool, kinds: Mapping[str, Collection[Field]]) -> Iterator[FrameTopic]:
    """Yield the topics of a recording that have a message in every frame, `/joint_states` last.

    The last one marks a block as complete for those who salvage a cut file.

    Args:
        layout: the names behind the columns.
        collision: whether there are results of pairs.
        kinds: of sensors of which there are readings, and the fields of these.
    """
    yield _topic("/tf", messages.TRANSFORMS, _transforms_example(layout), _transforms(layout))
    if collision:
        example = _example(CollisionColumns.fields(), layout)
        yield _topic("/collision", messages.COLLISION, example, _collision)
    if layout.guards:
        yield _topic("/guards", messages.GUARDS, _example(GuardColumns.fields(), layout), _guards)
    for kind in KINDS.values():
        if kind.name in kinds:
            for index, name in enumerate(layout.sensors[kind.name]):
                fields = [field for field in kinds[kind.name] if layout.has(kind.name, name, field)]
                topic, example = kind.topic(name), _example(fields, layout)
                yield _topic(topic, kind.message, example, _reading(kind.name, index, fields))
    yield _topic("/joint_states", messages.JOINTS, _joints_example(layout), _joints)


def _example(fields: Collection[Field], layout: Layout) -> dict[str, Any]:
    """Return a message's values, none of them 0."""
    return {field.name: _ones(field, layout) for field in fields}


def _ones(field: Field, layout: Layout) -> Any:
    one = np.ones(1, dtype=field.type).tolist()
    if field.letters:
        return dict.fromkeys(field.letters, one[0])
    return one * len(getattr(layout, field.each)) if field.each else one[0]


def _topic(name: str, type_: str, example: Mapping[str, Any], columns: Callable[[FrameBlock], Columns]) -> FrameTopic:
    message = messages.message_class(type_)(**example)
    return FrameTopic(name, type_, _shape(type_, message.SerializeToString(deterministic=True)), columns)


@functools.lru_cache(maxsize=64)  # sensors are alike, and so are the runs of a night
def _shape(type_: str, example: bytes) -> MessageShape:
    shape = shape_of(messages.message_class(type_).DESCRIPTOR, example)
    assert shape is not None, f"the example of {type_} leaves a field out"
    return shape


def _stamps(block: FrameBlock, *prefixes: str) -> Columns:
    seconds, nanos = block.time // SECOND, block.time % SECOND
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


def world_frame(layout: Layout) -> str:
    """Return the frame that every link's transform starts from: "world", with a "_" more where a link is called so."""
    name = WORLD
    while name in layout.links:
        name += "_"
    return name


def _transforms_example(layout: Layout) -> dict[str, Any]:
    ones = {"x": 1.0, "y": 1.0, "z": 1.0}
    world = world_frame(layout)
    frames = ({"parent_frame_id": world, "child_frame_id": name} for name in layout.links)
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
    return {field.name: _values(block, block.collision, field) for field in block.collision.fields()}


def _guards(block: FrameBlock) -> Columns:
    assert block.guards is not None
    return {field.name: getattr(block.guards, field.name) for field in block.guards.fields()}


def _values(block: FrameBlock, columns: Any, field: Field) -> Column:
    """Return a column, or one that tells nothing in place of one that an older recording did not have."""
    values: Column | None = getattr(columns, field.name)
    if values is not None:
        return values
    first = columns.fields()[0]
    shape = getattr(columns, first.name).shape
    if field.each != first.each:
        shape = (*shape, len(getattr(block.layout, field.each)))
    shape = (*shape, len(field.letters)) if field.letters else shape
    return np.broadcast_to(np.array(field.nothing, dtype=field.type), shape)


def _reading(kind: str, sensor: int, fields: Collection[Field]) -> Callable[[FrameBlock], Columns]:
    def columns(block: FrameBlock) -> Columns:
        found: Columns = {}
        for field in fields:
            found |= components(field, getattr(block.readings[kind], field.name)[:, sensor])
        return found

    return columns
