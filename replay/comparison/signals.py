"""A recording as named scalar signals, grouped by field so that one array holds many signals.

A signal is one scalar column: (topic, field, name). Its full name joins them with slashes and leaves an empty name out:

    /collision/clearance/arc/bow|table/top       field `clearance` of the pair arc/bow|table/top
    /distance/corner_nw/point.x                  field `point.x` of the sensor corner_nw
    /capacitive/guard_1/per_object/phantom/body  field `per_object` of the sensor guard_1, shape phantom/body
    /joint_states/position/arc_rotation          field `position` of the joint arc_rotation
    /tf/rotation/arc                             rotation of the link arc, compared by angle [rad]
"""

from __future__ import annotations

import dataclasses
import enum
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from replay.recording.reader import Recording
    from replay.simulation import Layout

Column = NDArray[Any]


class Kind(enum.Enum):
    """How the values of a field are compared."""

    NUMBER = "number"
    ROTATION = "rotation"  # quaternions xyzw, by the angle between them
    LEVEL = "level"  # ordered states 0, 1, 2; an event when a state or a higher one begins or ends
    FLAG = "flag"  # false or true; an event when it begins or ends
    CATEGORY = "category"  # unordered states; an event when the state becomes another

    @property
    def is_state(self) -> bool:
        """Whether the field is compared as events rather than as numbers."""
        return self in (Kind.LEVEL, Kind.FLAG, Kind.CATEGORY)


@dataclass(frozen=True)
class Field:
    """One field of a topic.

    Attributes:
        name: as it stands in a signal's full name.
        unit: of its values; "" when they have none.
        gate: the field that says whether this one has a value at all, such as `status` for `distance`. In frames in
            which the gates of two runs disagree, the gate's event is the difference and this field's is its echo.
        open: states of a gate in which the fields behind it have a value.
        begins: names of the states from 1 on, for events: "contact" gives "contact begins" and "contact ends".
    """

    name: str
    kind: Kind = Kind.NUMBER
    unit: str = ""
    gate: str | None = None
    open: tuple[int, ...] = ()
    begins: tuple[str, ...] = ()


@dataclass(frozen=True, order=True, slots=True)
class Signal:
    """Identity of a scalar column; `unit` takes no part in it."""

    topic: str
    field: str
    name: str = ""
    unit: str = dataclasses.field(default="", compare=False)

    @property
    def full_name(self) -> str:
        """What rules match and reports show."""
        return "/".join(part for part in (self.topic, self.field, self.name) if part)

    @property
    def item(self) -> tuple[str, str]:
        """The sensor, pair, joint or link that the signal belongs to."""
        return self.topic, self.name


@dataclass(frozen=True, eq=False)
class Group:
    """The signals of one field: S columns of F frames.

    Attributes:
        field: what they share.
        signals: S signals in the order of the columns.
        values: (F, S), or (F, S, 4) for rotations.
        categories: texts of the values -1, 0, 1, ... of a category whose numbers mean nothing between recordings.
    """

    field: Field
    signals: tuple[Signal, ...]
    values: Column
    categories: tuple[str, ...] = ()

    @property
    def key(self) -> tuple[str, str]:
        """What a group has in common with the group of the same field in another recording."""
        return self.signals[0].topic.split("/")[1], self.field.name


JOINT_FIELDS = (Field("position"), Field("velocity"))
TRANSLATION_FIELDS = tuple(Field(f"translation.{axis}", unit="m") for axis in "xyz")
ROTATION_FIELD = Field("rotation", Kind.ROTATION, "rad")
COLLISION_FIELDS = (
    Field("level", Kind.LEVEL, begins=("overlap of bounds", "contact")),
    Field("evaluated", Kind.FLAG, open=(1,), begins=("evaluation of the clearance",)),
    Field("undecided", Kind.FLAG, begins=("undecided",)),
    Field("clearance", unit="m", gate="evaluated"),
)
STATUS_FIELD = Field("status", Kind.LEVEL, open=(1, 2), begins=("detection", "too close"))
DISTANCE_FIELD = Field("distance", unit="m", gate="status")
POINT_FIELDS = (("point", "m"), ("point_sensor", "m"), ("normal", ""))
INDEX_FIELDS = tuple(Field(name, Kind.CATEGORY, gate="status") for name in ("shape", "triangle", "case"))
CAPACITIVE_FIELDS = (
    Field("saturated", Kind.FLAG, open=(0,), begins=("saturation",)),
    Field("touching", Kind.FLAG, begins=("touch",)),
    Field("capacitance", unit="F", gate="saturated"),
    Field("output_voltage", unit="V", gate="saturated"),
    Field("delta_output", unit="V", gate="saturated"),
)
PER_OBJECT_FIELD = Field("per_object", unit="F", gate="saturated")


def groups(recording: Recording) -> Iterator[Group]:
    """Yield all signals of a recording, field by field; a gate comes before what it gates.

    The arrays are views of the recording's own columns wherever that can be.
    """
    yield from (group for group in _all_groups(recording) if group.signals)


def _all_groups(recording: Recording) -> Iterator[Group]:
    layout = recording.layout
    for field_, values, suffix in zip(
        JOINT_FIELDS, (recording.joint_positions, recording.joint_velocities), ("", "/s"), strict=True
    ):
        units = [unit + suffix for unit in layout.joint_units]
        yield Group(field_, _signals("/joint_states", field_, layout.joints, units), values)
    for axis, field_ in enumerate(TRANSLATION_FIELDS):
        yield Group(field_, _signals("/tf", field_, layout.links), recording.link_poses[:, :, axis, 3])
    yield Group(ROTATION_FIELD, _signals("/tf", ROTATION_FIELD, layout.links), recording.link_quaternions)
    yield from _collision(recording)
    yield from _distance(recording)
    yield from _capacitive(recording)


def _collision(recording: Recording) -> Iterator[Group]:
    if recording.collision is None:
        return
    for field_ in COLLISION_FIELDS:
        signals = _signals("/collision", field_, recording.layout.pairs)
        yield Group(field_, signals, getattr(recording.collision, field_.name))


def _distance(recording: Recording) -> Iterator[Group]:
    columns = recording.distance
    if columns is None:
        return
    topics = [f"/distance/{sensor}" for sensor in recording.layout.distance_sensors]
    for field_ in (STATUS_FIELD, DISTANCE_FIELD):
        yield Group(field_, _per_topic(topics, field_), getattr(columns, field_.name))
    for name, unit in POINT_FIELDS:
        for axis, letter in enumerate("xyz"):
            field_ = Field(f"{name}.{letter}", unit=unit, gate="status")
            yield Group(field_, _per_topic(topics, field_), getattr(columns, name)[:, :, axis])
    for field_ in INDEX_FIELDS:
        shapes = ("nothing", *recording.layout.shapes) if field_.name == "shape" else ()
        yield Group(field_, _per_topic(topics, field_), getattr(columns, field_.name), shapes)


def _capacitive(recording: Recording) -> Iterator[Group]:
    columns = recording.capacitive
    if columns is None:
        return
    topics = [f"/capacitive/{sensor}" for sensor in recording.layout.capacitive_sensors]
    for field_ in CAPACITIVE_FIELDS:
        yield Group(field_, _per_topic(topics, field_), getattr(columns, field_.name))
    signals = tuple(
        Signal(topic, PER_OBJECT_FIELD.name, shape, PER_OBJECT_FIELD.unit)
        for topic in topics
        for shape in recording.layout.objects
    )
    yield Group(PER_OBJECT_FIELD, signals, columns.per_object.reshape(len(columns.per_object), len(signals)))


def places(layout: Layout, topic: str) -> tuple[object, int]:
    """Return the names that a topic's columns stand for, and how many signals it has.

    Two topics of the same bytes are the same signals when these names are the same.
    """
    match topic.split("/")[1]:
        case "joint_states":
            return (layout.joints, layout.joint_units), len(JOINT_FIELDS) * len(layout.joints)
        case "tf":
            return layout.links, (len(TRANSLATION_FIELDS) + 1) * len(layout.links)
        case "collision":
            return layout.pairs, len(COLLISION_FIELDS) * len(layout.pairs)
        case "distance":
            return layout.shapes, 2 + 3 * len(POINT_FIELDS) + len(INDEX_FIELDS)
        case "capacitive":
            return layout.objects, len(CAPACITIVE_FIELDS) + len(layout.objects)
    return (), 0


def _signals(topic: str, field_: Field, names: Sequence[str], units: Sequence[str] | None = None) -> tuple[Signal, ...]:
    return tuple(
        Signal(topic, field_.name, name, field_.unit if units is None else units[k]) for k, name in enumerate(names)
    )


def _per_topic(topics: Sequence[str], field_: Field) -> tuple[Signal, ...]:
    return tuple(Signal(topic, field_.name, "", field_.unit) for topic in topics)


def unify_categories(a: Group, b: Group) -> tuple[Column, Column, tuple[str, ...]]:
    """Return both groups' values as codes of one common list of texts, and that list.

    Shapes are matched by name: one more shape in a scene renumbers the others and changes no reading. Values without
    texts (triangle numbers) are returned as they are.
    """
    if not a.categories or a.categories == b.categories:
        return a.values, b.values, a.categories
    texts = tuple(dict.fromkeys((*a.categories, *b.categories)))
    code = {text: k - 1 for k, text in enumerate(texts)}
    return _recode(a, code), _recode(b, code), texts


def _recode(group: Group, code: dict[str, int]) -> Column:
    table = np.array([code[text] for text in group.categories], dtype=np.int32)
    codes: Column = table[group.values + 1]
    return codes
