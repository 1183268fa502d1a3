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
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from replay.collision.columns import Between, CollisionColumns
from replay.comparison.moments import Moments, moments
from replay.guarding.columns import GuardColumns
from replay.numerics.arrays import Column
from replay.numerics.columns import Columns, Field, Kind, components
from replay.sensing.kinds import KINDS

if TYPE_CHECKING:
    from replay.recording.reader import Recording
    from replay.simulation import Layout

SCHEMAS = "/schemas"
"""Begins the name of a field in changes and rules: `/schemas/collision/clearance`."""


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
        moments: what the recording knows of its states' beginnings and ends beyond its frames.
        between: whether the recording looked between its frames.
    """

    field: Field
    signals: tuple[Signal, ...]
    values: Column
    categories: tuple[str, ...] = ()
    moments: Moments | None = None
    between: bool = False

    @property
    def key(self) -> tuple[str, str]:
        """What a group has in common with the group of the same field in another recording."""
        return self.signals[0].topic.split("/")[1], self.field.name


JOINT_FIELDS = (Field("position"), Field("velocity"))
BETWEEN_FRAMES = ("between", "clearance_bound")
"""Fields of pairs that tell nothing when the model does not look between the frames."""
TRANSLATION_FIELDS = tuple(Field(f"translation.{axis}", unit="m") for axis in "xyz")
ROTATION_FIELD = Field("rotation", Kind.ROTATION, "rad")


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
    if recording.collision is not None:
        between = looked_between(recording)
        for field_ in _gates_first(recording.collision.present()):
            signals = _signals("/collision", field_, layout.pairs)
            known = None
            if field_.name == "level" and between:
                known = moments(field_, layout.pairs, "/collision", recording.events, recording.time)
            yield Group(field_, signals, getattr(recording.collision, field_.name), (), known, between)
    if recording.guards is not None:
        for field_ in recording.guards.fields():
            signals = _signals("/guards", field_, getattr(layout, field_.each))
            yield Group(field_, signals, getattr(recording.guards, field_.name))
    for kind, columns in recording.readings.items():
        sensors = layout.sensors[kind]
        for field_ in _gates_first(columns.present()):
            having = [k for k, sensor in enumerate(sensors) if layout.has(kind, sensor, field_)]
            topics = [KINDS[kind].topic(sensors[k]) for k in having]
            values = getattr(columns, field_.name)
            told = values if len(having) == len(sensors) else values[:, having]
            yield from _of_sensors(topics, field_, told, layout)


def silent_fields(recording: Recording) -> set[tuple[str, str]]:
    """Return the keys of the groups that a recording cannot have: its format is older, or its model does not look."""
    columns = {"collision": recording.collision, **recording.readings}
    found = {
        (topic, field_.name)
        for topic, group in columns.items()
        if group is not None
        for field_ in group.fields()
        if getattr(group, field_.name) is None
    }
    return found if looked_between(recording) else found | {("collision", name) for name in BETWEEN_FRAMES}


def looked_between(recording: Recording) -> bool:
    """Return whether a recording says what lies between its frames: its format and its model do."""
    between = None if recording.collision is None else recording.collision.between
    return between is not None and bool((between != Between.NOT_LOOKED).any())


def _gates_first(fields: Sequence[Field]) -> list[Field]:
    return sorted(fields, key=lambda field_: field_.gate is not None)


def _of_sensors(topics: Sequence[str], field_: Field, values: Column, layout: Layout) -> Iterator[Group]:
    """Yield a field of all sensors of a kind: a vector letter by letter."""
    names = getattr(layout, field_.each) if field_.each else ("",)
    categories = ("nothing", *getattr(layout, field_.names)) if field_.names else ()
    for name, column in components(field_, values).items():
        part = dataclasses.replace(field_, name=name)
        signals = tuple(Signal(topic, name, each, field_.unit) for topic in topics for each in names)
        yield Group(part, signals, column.reshape(len(column), len(signals)), categories)


def places(layout: Layout, topic: str, format: int) -> tuple[object, int]:
    """Return the names that a topic's columns stand for, and how many signals it has in a format of recordings.

    Two topics of the same bytes are the same signals when these names are the same.
    """
    match group := topic.split("/")[1]:
        case "joint_states":
            return (layout.joints, layout.joint_units), len(JOINT_FIELDS) * len(layout.joints)
        case "tf":
            return layout.links, (len(TRANSLATION_FIELDS) + 1) * len(layout.links)
        case "collision":
            return layout.pairs, len(_of_format(CollisionColumns, format)) * len(layout.pairs)
        case "guards":
            each = [len(getattr(layout, field_.each)) for field_ in GuardColumns.fields()]
            return (layout.guards, layout.joints), sum(each)
    known = _of_format(KINDS[group].columns, format) if group in KINDS else []
    fields = [field_ for field_ in known if not field_.optional]
    meant = {names: getattr(layout, names) for field_ in fields for names in (field_.each, field_.names) if names}
    counts = (len(meant[field_.each]) if field_.each else len(field_.letters) or 1 for field_ in fields)
    return meant, sum(counts)


def _of_format(columns: type[Columns], format: int) -> list[Field]:
    return [field_ for field_ in columns.fields() if field_.since <= format]


def _signals(topic: str, field_: Field, names: Sequence[str], units: Sequence[str] | None = None) -> tuple[Signal, ...]:
    return tuple(
        Signal(topic, field_.name, name, field_.unit if units is None else units[k]) for k, name in enumerate(names)
    )


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
