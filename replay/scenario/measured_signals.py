"""The signals of a scenario's recording that a log may measure, with their units, as far as its text tells them."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from replay.collision.columns import CollisionColumns
from replay.guarding.columns import GuardColumns
from replay.language.units import DIMENSIONS, Dimension
from replay.numerics.columns import Columns, Field, Kind
from replay.scenario.names import SCALAR_JOINTS
from replay.scenario.problems import did_you_mean
from replay.sensing.kinds import KINDS

if TYPE_CHECKING:
    from replay.scenario.model import Scenario

EVENTS = "/events"
"""Begins the name of a signal that is true while what an event tells lasts: `/events/contact/arm/rod|table/top`."""
_POSITION = "/joint_states/position/"
_DIMENSIONS = {dimension.si: dimension for dimension in DIMENSIONS}


def unit_of(scenario: Scenario, name: str) -> str:
    """Return the SI unit of a signal by its full name; "" for one that has none.

    Names of pairs, of guards and of what events tell are not looked up: only a recording has them all.

    Raises:
        ValueError: there is no such signal, or its values are no numbers; says so, and what works.
    """
    known = dict(_told(scenario))
    if name in known:
        return known[name]
    for prefix, unit in _beginnings(scenario):
        if name.startswith(prefix) and len(name) > len(prefix):
            return unit
    if name.startswith("/tf/rotation/"):
        raise ValueError("is a rotation, which is no number; compare joints, or translation.x, .y and .z")
    raise ValueError(f"is no signal of the recording; {did_you_mean(name, known, what='signals are')}")


def continuous_positions(scenario: Scenario) -> set[str]:
    """Return the full names of positions of continuous joints, whose encoders begin anew every turn."""
    return {
        f"{_POSITION}{part.joint.name or link}"
        for link, part in scenario.links.items()
        if part.joint.type == "continuous"
    }


def dimension_of(unit: str) -> Dimension | None:
    """Return the dimension that a unit is the SI unit of; None for ""."""
    return _DIMENSIONS.get(unit)


def _told(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield the signals whose names the text tells, with their units."""
    for kind in KINDS:
        for sensor in scenario.sensors.of(kind):
            for name, field in _names(KINDS[kind].columns):
                if not field.each:
                    yield f"{KINDS[kind].topic(sensor)}/{name}", field.unit
    for link, part in scenario.links.items():
        if part.joint.type in SCALAR_JOINTS:
            unit = "m" if part.joint.type == "prismatic" else "rad"
            yield f"{_POSITION}{part.joint.name or link}", unit
            yield f"/joint_states/velocity/{part.joint.name or link}", f"{unit}/s"
    for link in scenario.links:
        for axis in "xyz":
            yield f"/tf/translation.{axis}/{link}", "m"


def _beginnings(scenario: Scenario) -> Iterator[tuple[str, str]]:
    """Yield how names of other signals begin, with their units."""
    for kind in KINDS:
        for sensor in scenario.sensors.of(kind):
            for name, field in _names(KINDS[kind].columns):
                if field.each:
                    yield f"{KINDS[kind].topic(sensor)}/{name}/", field.unit
    of_topics: dict[str, type[Columns]] = {"/collision": CollisionColumns, "/guards": GuardColumns}
    for topic, columns in of_topics.items():
        for name, field in _names(columns):
            yield f"{topic}/{name}/", field.unit
    of_states: list[type[Columns]] = [CollisionColumns, *(KINDS[kind].columns for kind in KINDS)]
    for states in of_states:
        for field in states.fields():
            for event in field.events:
                yield f"{EVENTS}/{event}/", ""


def _names(columns: type[Columns]) -> Iterator[tuple[str, Field]]:
    """Yield the names of a group's fields, those of vectors by component; not those that count names."""
    for field in columns.fields():
        if field.kind is Kind.CATEGORY and field.states is None:
            continue
        for name in [f"{field.name}.{letter}" for letter in field.letters] or [field.name]:
            yield name, field
