"""A log of the real machine that a scenario's readings are compared with, as it is written."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, WithJsonSchema, model_validator

from replay.language.fields import Flag, Name, Part, rejected
from replay.language.units import DIMENSION_OF, ClockOffset, LongestGap, Number
from replay.scenario.motion import TimeColumnPart
from replay.scenario.problems import did_you_mean


def _unit(value: object) -> object:
    if isinstance(value, str) and value not in DIMENSION_OF:
        raise rejected(f"is no unit; {did_you_mean(value, DIMENSION_OF, what='units are')}")
    return value


def _listed(value: object) -> object:
    return value if isinstance(value, list | tuple) else [value]


Numbers = Annotated[
    tuple[Number, ...],
    BeforeValidator(_listed),
    WithJsonSchema({"anyOf": [{"type": "number"}, {"type": "array", "items": {"type": "number"}}]}),
]


class MeasuredTimePart(TimeColumnPart):
    """The times of a log's samples."""

    stamp: Literal["message", "log"] | None = None
    """Of messages: their own time stamps (where they have none, and when left out, the times of the log), or always
    the times at which they were logged."""


class MeasuredSignalPart(Part):
    """The channel of a log that measures a signal."""

    topic: Annotated[str, Field(min_length=1)] | None = None
    """Topic of the messages; with `field`."""
    field: Annotated[str, Field(min_length=1, max_length=400)] | None = None
    """Path to the value in a message: `range`, `pose.position.x`, `data[0]`, `position[elbow]` of joint states."""
    column: Annotated[str, Field(min_length=1)] | None = None
    """Heading of the column of a .csv file."""
    unit: Annotated[str, BeforeValidator(_unit)] | None = None
    """Unit of the values; when left out, the one in brackets in a CSV heading, or the signal's SI unit."""
    nothing: Numbers = ()
    """Values, in the log's unit, that stand for nothing detected; NaN and infinities always do."""
    clock: Name | None = None
    """The one of `clocks` that its times are on; the log's own when left out."""
    fit: Flag = False
    """Whether simulated values are scaled and shifted to fit the measured ones best before they are judged."""

    @model_validator(mode="after")
    def _has_one_place(self) -> Self:
        if (self.topic is None) != (self.field is None):
            missing = "field" if self.field is None else "topic"
            raise rejected(f"needs a {missing} too; messages are named by topic and field")
        if (self.topic is None) == (self.column is None):
            what = "names nothing in the log" if self.topic is None else "names messages and a column"
            raise rejected(f"{what}; give topic and field of messages, or the column of a .csv file")
        return self


class ClockPart(Part):
    """How a clock of the log runs beside the scenario's time."""

    offset: ClockOffset = None
    """Time [s] that is added to times of the log to get those of the scenario, or `estimate`, the default: found from
    the signals, with its interval. Times of a log that counts from 1970 begin at its first sample."""
    drift: Literal["none", "estimate"] = "none"
    """Whether the clock may run faster or slower by a share, which is then estimated too."""


class MeasuredMapPart(ClockPart):
    """What of a log measures which signals, and when."""

    time: MeasuredTimePart | None = None
    """Times of the samples."""
    separator: Literal[",", ";", "\t", "|"] | None = None
    """What separates the cells of a .csv file; found in its headings when left out."""
    decimal: Literal[".", ","] | None = None
    """Decimal sign of a .csv file; found in its numbers when left out."""
    signals: Annotated[dict[str, MeasuredSignalPart], Field(min_length=1)]
    """The log's channel by full name of a signal; `/events/contact/arm/rod|table/top` is true while it lasts."""
    clocks: dict[Name, ClockPart] = Field(default_factory=dict)
    """Further clocks, for signals whose times in the log are not on its own one."""
    max_gap: LongestGap = 1.0
    """Longest time [s] between two samples that is bridged; frames in a longer one have no measured value."""

    @model_validator(mode="after")
    def _names_are_known(self) -> Self:
        for name, signal in self.signals.items():
            if not name.startswith("/"):
                rule = "is no signal's full name: its topic, field and name, such as /distance/tip/distance"
                raise rejected(rule, ("signals", name))
            if signal.clock is not None and signal.clock not in self.clocks:
                raise rejected(
                    f"is not one of `clocks`; {did_you_mean(signal.clock, self.clocks)}", ("signals", name, "clock")
                )
        for clock in self.clocks:
            if all(signal.clock != clock for signal in self.signals.values()):
                raise rejected("is the clock of no signal", ("clocks", clock))
        return self

    def clock(self, name: str | None) -> ClockPart:
        """Return one of the clocks; None is the log's own."""
        return self if name is None else self.clocks[name]

    def clock_names(self) -> Sequence[str | None]:
        """Return the clocks that signals are on, each once."""
        return tuple(dict.fromkeys(signal.clock for signal in self.signals.values()))


class MeasuredPart(MeasuredMapPart):
    """A log of the real machine, beside which the scenario's signals are put."""

    file: Annotated[str, Field(min_length=1)]
    """A .mcap, .csv, ROS 1 .bag or ROS 2 .db3 file, or a ROS 2 bag's folder, inside the scenario's folder tree."""
