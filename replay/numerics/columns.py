"""Columns of results, each described where it is declared: its type and unit, when it says nothing, what is told of it.

Everything that has to be done with every column (messages and back, tables, events, charts, comparison) goes by these
descriptions.
"""

from __future__ import annotations

import dataclasses
import enum
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray


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
        name: as it stands in messages and in a signal's full name.
        kind: how its values are compared; of `Columns` it follows from their type, but for states that have no order.
        unit: of its values; "" when they have none.
        gate: the field that says whether this one has a value at all, such as `status` for `distance`. In frames in
            which the gates of two runs disagree, the gate's event is the difference and this field's is its echo.
        open: states of a gate in which the fields behind it have a value.
        events: what begins with each state from 1 on ("contact" gives "contact begins" and "contact ends"), and
            Foxglove's log level of its beginning; none where a recording tells nothing of it.
        begins: names of the states from 1 on for differences, where they are others than those of `events`.
        label: what tables call it; its name in words when left out.
        spoken: what sentences call it; its name in words when left out.
        states: the enumeration that names its values.
        letters: of the components of a vector, a last axis of the column.
        each: the names of the layout that it has a value for each of, a last axis of the column; "" for one value. A
            sensor's field with `each` has no letters, events, chart or beam.
        names: the names of the layout that its values count; what is below 0 names nothing.
        chart: title of the chart that shows it over time; "" for none.
        beam: it is a point in world coordinates, drawn at the end of a line from its sensor.
        type: of the values.
        most: largest value of one that counts or is a state; what its type or `states` allow when left out.
        nothing: the value when there is nothing to tell; of `Columns` it follows from the type unless it is a state.
        since: version of the recording format that first holds it; the column of an older recording is None.
        signal: it is there only of sensors with a signal chain, see `Layout.signals`; NaN of the others.
        optional: whether the column may be None; it follows from its type. A sensor's that is None is not recorded.
    """

    name: str = ""
    kind: Kind = Kind.NUMBER
    unit: str = ""
    gate: str | None = None
    open: tuple[int, ...] = ()
    events: Mapping[str, int] = dataclasses.field(default_factory=dict)
    begins: tuple[str, ...] = ()
    label: str = ""
    spoken: str = ""
    states: type[enum.IntEnum] | None = None
    letters: str = ""
    each: str = ""
    names: str = ""
    chart: str = ""
    beam: bool = False
    type: np.dtype[Any] = dataclasses.field(default_factory=lambda: np.dtype(np.float64))
    most: int = 0
    nothing: float = np.nan
    since: int = 1
    signal: bool = False
    optional: bool = False


class Columns:
    """Base of groups of columns: dataclasses whose attributes are annotated with their `Field`; others are none."""

    @classmethod
    @functools.cache
    def fields(cls) -> tuple[Field, ...]:
        """Return the description of each column, in order."""
        hints = get_type_hints(cls, include_extras=True)
        columns = (field.name for field in dataclasses.fields(cls) if hasattr(hints[field.name], "__metadata__"))  # type: ignore[arg-type]
        return tuple(_described(name, *get_args(hints[name])) for name in columns)

    def present(self) -> tuple[Field, ...]:
        """Return the description of each column that there is, in order: an older recording may lack some."""
        return tuple(field for field in self.fields() if getattr(self, field.name) is not None)

    @classmethod
    def nothing(cls, frames: int, sensors: int, **counts: int) -> Self:
        """Return columns that tell nothing; `counts` says how many names there are of what a field has `each` of."""
        values = {}
        for field in cls.fields():
            if field.optional:
                continue
            rest = (counts[field.each],) if field.each else (len(field.letters),) if field.letters else ()
            values[field.name] = np.full((frames, sensors, *rest), field.nothing, dtype=field.type)
        return cls(**values)


def _described(name: str, array: Any, field: Field) -> Field:
    """Return the description of a column, with what follows from its name and type."""
    optional = type(None) in get_args(array)
    array = next(part for part in (*get_args(array), array) if get_origin(part) is np.ndarray)  # X of "X | None"
    dtype = np.dtype(get_args(get_args(array)[1])[0])
    kinds = {"f": Kind.NUMBER, "b": Kind.FLAG}
    most = max(field.states) if field.states else field.most
    if not most and dtype.kind != "f":
        most = 1 if dtype.kind == "b" else int(np.iinfo(dtype).max)
    nothing = {"f": np.nan, "i": -1}.get(dtype.kind, 0)
    unordered = field.states is not None and field.kind is Kind.CATEGORY
    return dataclasses.replace(
        field,
        name=name,
        kind=Kind.LEVEL if field.states and not unordered else kinds.get(dtype.kind, Kind.CATEGORY),
        label=field.label or name.replace("_", " "),
        spoken=field.spoken or name.replace("_", " "),
        begins=field.begins or tuple(field.events),
        most=most,
        type=dtype,
        nothing=nothing if np.isnan(field.nothing) else field.nothing,
        optional=optional,
    )


def components(field: Field, values: NDArray[Any]) -> dict[str, NDArray[Any]]:
    """Return the values (n, ...) of a field by name, those of a vector by `name.letter`."""
    if not field.letters:
        return {field.name: values}
    return {f"{field.name}.{letter}": values[..., k] for k, letter in enumerate(field.letters)}
