"""A log of the real machine: which channel measures which signal, checked and converted to SI."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from fractions import Fraction
from typing import TYPE_CHECKING

import numpy as np

from replay.errors import InvalidValue, Problem, count
from replay.language.node import KeyPath
from replay.logs.csv_table import unit_of as bracketed
from replay.logs.excerpt import joined
from replay.logs.field_csv import read_columns
from replay.logs.field_log import FieldLog, Place, Window, read_fields
from replay.logs.joint_log import EPOCH
from replay.logs.message_log import open_message_log
from replay.numerics.arrays import Floats, Integers
from replay.scenario.log_file import LogFile, csv_format, open_log, reading
from replay.scenario.measured_signals import continuous_positions, dimension_of, unit_of
from replay.scenario.recorded_series import Unusable, unwrapped
from replay.scenario.source import Library

if TYPE_CHECKING:
    from replay.scenario.measured import MeasuredMapPart, MeasuredSignalPart
    from replay.scenario.model import Scenario
    from replay.scenario.recorded import RecordedMotion

PATH: KeyPath = ("measured",)
MEASURED = "measured"
"""What an original says of its use if nothing of the simulation depends on it."""
BESIDE = 3 * 10**9
"""Time [ns] before and after the scenario that is kept of a log whose offset is given, so that it can be checked."""


@dataclass(frozen=True, eq=False)
class MeasuredSeries:
    """What a log says of one signal.

    Attributes:
        time: (n,) [s] on the log's clock, increasing.
        value: (n,) in SI; NaN where nothing was detected.
        turn: angles [rad] that are so far apart are one, as the encoder of a continuous joint has them; 0 for none.
    """

    time: Floats
    value: Floats
    turn: float = 0.0


@dataclass
class MeasuredLog:
    """What a log says of a scenario's signals.

    Attributes:
        series: by the signal's full name.
        begin: time of the log's first sample [ns]; `zero` the time at which the log's clock is taken to be 0: the first
            sample's where it counts from 1970, else 0.
        problems: what is wrong; with any, the rest is of no use.
        notes: what a reader should know.
        origin: name and SHA-256 of the file that the log is, or was cut out of.
    """

    series: dict[str, MeasuredSeries] = field(default_factory=dict)
    begin: int = 0
    zero: int = 0
    problems: list[Problem] = field(default_factory=list)
    notes: list[Problem] = field(default_factory=list)
    origin: Mapping[str, str] = field(default_factory=dict)
    _cut: Callable[[Window | None, Mapping[str, str]], bytes] | None = None
    _window: Window | None = None
    _file: LogFile | None = None

    def excerpt(self, recorded: RecordedMotion | None) -> bytes:
        """Return a file with what the comparison needs of the log, and what a motion of the same log does.

        What is an excerpt already stays as it is.
        """
        assert self._cut is not None
        if self._file is not None:
            return self._file.data
        own = self._cut(self._window, self.origin)
        if recorded is None or not recorded.published:
            return own
        return joined(recorded.excerpt, own, lambda data: open_message_log(self.origin["name"], data))

    def without_file(self) -> MeasuredLog:
        """Return the same, without what an excerpt is made of: the log's file, which may be large."""
        return MeasuredLog(self.series, self.begin, self.zero, self.problems, self.notes, self.origin)


def read(
    scenario: Scenario,
    written: MeasuredMapPart,
    library: Library,
    name: str,
    problem: Callable[[KeyPath, str], Problem],
    recorded: RecordedMotion | None = None,
) -> MeasuredLog:
    """Return what a log says of a scenario's signals.

    Args:
        scenario: whose signals they are.
        written: which channels measure which of them.
        library: where files are.
        name: of the log in the library: a file, or a ROS 2 bag's folder.
        problem: returns that a rule is broken at a path of the language, with its place.
        recorded: what the same log says of the scenario's motion, if it moves the scenario too.
    """
    found = MeasuredLog()
    try:
        places = {signal: _place(scenario, signal, part) for signal, part in written.signals.items()}
        file = _opened(written, library, name)
        log = _read(written, file, set(places.values()), recorded)
    except Unusable as error:
        found.problems.append(problem(error.path, error.rule))
        return found
    if log.left_out:
        rule = f"begins with {count(log.left_out, 'sample')} stamped 0, before its clock was there; left out"
        found.notes.append(problem((*PATH, "file"), rule))
    found.origin = dict(log.origin) or {"name": name, "sha256": file.sha256}
    found.begin, found.zero = log.begin, log.begin if log.begin >= EPOCH else 0
    found._window = _window(scenario, written, found.zero)
    found._file = file if log.origin else None
    found._cut = log.cut
    seconds: dict[int, Floats] = {}
    continuous = continuous_positions(scenario)
    left = Counter(places.values())
    for signal, part in written.signals.items():
        place = places[signal]
        left[place] -= 1
        series = log.series[place] if left[place] else log.series.pop(place)  # logs may be large
        shared = seconds.setdefault(id(series.time), _seconds(series.time, found.zero, found._window))
        factor = _factor(unit_of(scenario, signal), part)
        value = _converted(series.value[_inside(series.time, found._window)], part, factor)
        turn = math.tau if signal in continuous else 0.0
        if turn:
            there = np.isfinite(value)
            value = value.copy()
            value[there] = unwrapped(value[there], turn)
        found.series[signal] = MeasuredSeries(shared, value, turn)
    return found


def _place(scenario: Scenario, signal: str, part: MeasuredSignalPart) -> Place:
    """Return where the log has a signal; Unusable where there is no such signal, or not in such a unit."""
    path = (*PATH, "signals", signal)
    try:
        unit = unit_of(scenario, signal)
    except ValueError as error:
        raise Unusable(path, str(error)) from None
    dimension = dimension_of(unit)
    if part.unit is not None and (dimension is None or part.unit not in dimension.units):
        units = f"; units are {', '.join(dimension.units)}" if dimension else ", which has none; leave it out"
        raise Unusable((*path, "unit"), f"is no unit of this signal{units}")
    return (part.topic, part.field or "") if part.topic is not None else ("", part.column or "")


def _opened(written: MeasuredMapPart, library: Library, name: str) -> LogFile:
    stamp = None if written.time is None else written.time.stamp
    column = None if written.time is None else written.time.column or written.time.unit
    of_tables = {"time": column, "separator": written.separator, "decimal": written.decimal}
    file = open_log(library, name, PATH, of_tables=of_tables, of_messages={"time": stamp})
    for signal, part in written.signals.items():
        if (part.topic is None) is (file.messages is not None):
            option, what = ("column", "topic and field") if file.messages is not None else ("topic", "column")
            raise Unusable((*PATH, "signals", signal, option), f"has no effect with this log; name {what}")
    return file


def _read(
    written: MeasuredMapPart, file: LogFile, places: Collection[Place], recorded: RecordedMotion | None
) -> FieldLog:
    max_gap, chosen = round(Fraction(repr(written.max_gap)) * 10**9), sorted(places)
    with reading(PATH):
        if file.messages is None:
            format = csv_format(written.time, written.separator, written.decimal)
            headings = [heading for _, heading in chosen]
            also = ((), ()) if recorded is None else (recorded.rows, recorded.headings)
            return read_columns(file.shown, file.table, format, headings, max_gap, also)
        stamped = written.time is None or written.time.stamp != "log"
        try:
            return read_fields(file.shown, file.messages, chosen, stamped=stamped, max_gap=max_gap)
        except InvalidValue as error:
            signal = next(name for name, part in written.signals.items() if part.field == error.value)
            raise Unusable((*PATH, "signals", signal, "field"), error.rule) from None


def _window(scenario: Scenario, written: MeasuredMapPart, zero: int) -> Window | None:
    """Return the time of the log that is of interest; None for all where an offset is to be found."""
    offsets = [written.clock(name).offset for name in written.clock_names()]
    known = [offset for offset in offsets if offset is not None]
    if len(known) < len(offsets):
        return None
    beside = BESIDE + math.ceil(written.max_gap * 1e9)
    end = math.ceil(Fraction(scenario.duration) * 10**9)
    return zero - round(max(known) * 1e9) - beside, zero + end - round(min(known) * 1e9) + beside


def _factor(unit: str, part: MeasuredSignalPart) -> float:
    """Return what a value of the log is multiplied with to be one of a signal's SI unit."""
    dimension = dimension_of(unit)
    if dimension is None:
        return 1.0
    headed = bracketed(part.column or "")[1]
    return float(dimension.units[part.unit or (headed if headed in dimension.units else dimension.si)])


def _inside(time: Integers, window: Window | None) -> slice:
    """Return which samples are in the time of interest."""
    if window is None:
        return slice(None)
    first, last = np.searchsorted(time, [window[0], window[1] + 1]).tolist()
    return slice(first, last)


def _seconds(time: Integers, zero: int, window: Window | None) -> Floats:
    seconds: Floats = (time[_inside(time, window)] - zero) / 1e9
    return seconds


def _converted(value: Floats, part: MeasuredSignalPart, factor: float) -> Floats:
    """Return values in SI, NaN for those that stand for nothing."""
    nothing = ~np.isfinite(value)
    if part.nothing:
        nothing |= np.isin(value, part.nothing)
    if factor != 1.0:
        value = value * factor
    return np.where(nothing, np.nan, value) if nothing.any() else value
