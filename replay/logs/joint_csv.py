"""Joint logs in CSV: columns of numbers, with decimal points or commas, over times or dates."""

from __future__ import annotations

import csv
import io
import itertools
import math
import re
from collections.abc import Collection, Mapping, Sequence
from fractions import Fraction

import numpy as np

from replay.errors import RecordingError
from replay.logs.csv_table import CsvTable, Format, noted, unit_of
from replay.logs.joint_log import JointLog, Series, leading_zeros, unrepeated
from replay.logs.times import date_nanoseconds, nanoseconds
from replay.numerics.arrays import Floats, Integers

_WITH_COMMA = re.compile(r"[-+]?[0-9]*,[0-9]+([eE][-+]?[0-9]+)?")
_WITH_POINT = re.compile(r"[-+]?[0-9]*\.[0-9]*([eE][-+]?[0-9]+)?")
_WORDS = {"true": 1.0, "false": 0.0}
_NOT_FINITE = re.compile(r"[-+]?(nan|inf|infinity)", re.IGNORECASE)
_DATE_LIKE = re.compile(r"[0-9]{1,4}[-./][0-9]{1,2}[-./][0-9]{1,4}|[0-9]{1,2}:[0-9]{2}")


def read_csv(name: str, data: bytes, format: Format, needed: Collection[str], max_gap: int) -> JointLog:
    """Return the columns of a CSV log by their headings.

    Headings stand in the first line that is no comment, or in the last comment before the numbers. Empty lines,
    comments (# or %) and columns without a heading are passed over; an empty cell is no sample; a line that is there
    twice is one.

    Args:
        name: of the file, for messages.
        data: its bytes, in UTF-8.
        format: how it is written.
        needed: headings of columns that must hold numbers; any other one that holds something else is passed over.
        max_gap: longest time [ns] between samples that is bridged.

    Raises:
        RecordingError: the file is empty or not UTF-8, there is no such column, a line has another number of cells, or
            a cell is no finite number, or a time beyond 146 years.
    """
    return CsvNumbers(name, CsvTable(name, data, format), format, needed, max_gap).log()


class CsvNumbers:
    """The numbers of a table.

    Attributes:
        table: its cells.
        times: of its rows [ns].
        skip: leading rows that are left out: their times are 0, as before a clock is there.
        headings: of the columns that are needed.
    """

    def __init__(
        self,
        name: str,
        table: CsvTable,
        format: Format,
        needed: Collection[str],
        max_gap: int,
        *,
        readings: bool = False,
    ) -> None:
        """Read the times of a table.

        Args:
            name, format, needed, max_gap: as of `read_csv`.
            table: the file's cells.
            readings: columns may also hold what is not finite, and true and false, as positions may not.
        """
        self._name = name
        self._readings = readings
        self.table = table
        self._format = format
        self.headings = {h for h in table.headings if h in needed or (_joint(h) in needed and not readings)}
        self._at = table.headings.index(table.time)
        self._decimal = format.decimal or self._found_decimal()
        self._unit = self._time_unit()
        self._zones: set[str] = set()
        self.times = self._read_times(table.columns[self._at], 0)
        self.skip = leading_zeros(self.times, max_gap)

    def log(self) -> JointLog:
        """Return all columns that hold numbers as joints."""
        table, times = self.table, self.times
        joints = {}
        for column, heading in enumerate(table.headings):
            if heading and column != self._at:
                series = self.series(column, heading)
                if series is not None:
                    joints[heading] = series
        if not joints:
            raise RecordingError(self._name, "has no samples of joints")
        first, last = self.skip, max(range(self.skip, len(times)), key=times.__getitem__)
        later = (index for index in range(first, len(times)) if times[index] > times[first])
        return JointLog(
            joints=joints,
            frames={},
            begin=min(times[first:]),
            end=times[last],
            anchor=(first, *itertools.islice(later, 1), last),
            left_out=self.skip,
            cut=self.cut,
            origin=table.origin,
            published=False,
            headings=(table.time, *sorted(self.headings)),
        )

    def series(self, column: int, heading: str) -> Series | None:
        """Return the samples of a column; None without any, or if it holds something else and is not needed."""
        cells = self.table.columns[column]
        row = np.array([k for k in range(self.skip, len(cells)) if cells[k]], dtype=np.int64)
        values = self._checked(row, [cells[k] for k in row.tolist()], heading)
        if values is None or not len(row):
            return None
        time = np.array(self.times, dtype=np.int64)[row]
        first = unrepeated(time, values)
        return Series(time[first], values[first], row[first])

    def _checked(self, row: Integers, cells: Sequence[str], heading: str) -> Floats | None:
        """Return the numbers in cells of some rows; None if they hold something else and the column is not needed."""
        values = _values(cells, self._decimal, _WORDS if self._readings else {})
        wrong = np.flatnonzero(~np.isfinite(values)).tolist()
        if self._readings:
            wrong = [k for k in wrong if not _NOT_FINITE.fullmatch(cells[k])]
        if wrong and heading in self.headings:
            raise RecordingError(self._name, self._no_number(int(row[wrong[0]]), heading, cells[wrong[0]]))
        return None if wrong else values

    def _found_decimal(self) -> str:
        """Return the sign between whole and decimal digits: a comma where numbers have one and none has a point."""
        read = {*self.headings, self.table.time}
        columns = [c for h, c in zip(self.table.headings, self.table.columns, strict=True) if h in read]
        comma = self._first_line(columns, ",", _WITH_COMMA)
        if comma is None:
            return "."
        point = self._first_line(columns, ".", _WITH_POINT)
        if point is not None:
            rule = f"has a decimal point in line {point} and a decimal comma in line {comma}; write one of the two"
            raise RecordingError(self._name, rule)
        return ","

    def _first_line(self, columns: Sequence[Sequence[str]], sign: str, form: re.Pattern[str]) -> int | None:
        """Return the first line with a cell of a form, which has a sign in it."""
        if not any(sign in cell for column in columns for cell in column):
            return None
        rows = zip(self.table.lines, *columns, strict=True)
        return next((line for line, *cells in rows if any(map(form.fullmatch, cells))), None)

    def _time_unit(self) -> Fraction:
        unit = self._format.unit or unit_of(self.table.time)[1]
        return self._format.units.get(unit, self._format.units["s"])

    def _read_times(self, cells: Sequence[str], row: int) -> list[int]:
        """Return the times [ns] in cells, of which the first is that of a row."""
        times, zones = [], self._zones
        for index, cell in enumerate(cells, row):
            try:
                time = nanoseconds(cell.replace(",", ".") if self._decimal == "," else cell, self._unit)
                kind = ""
                if time is None:
                    date = date_nanoseconds(cell)
                    if date is None:
                        raise RecordingError(self._name, self._no_number(index, self.table.time, cell))
                    time, kind = date[0], "with" if date[1] else "without"
            except OverflowError:
                raise RecordingError(self._name, f"{self._place(index)}: {cell[:60]} is beyond 146 years") from None
            except ValueError as error:
                raise RecordingError(self._name, f"{self._place(index)}: {cell[:60]!r} is no date: {error}") from None
            times.append(time)
            zones.add(kind)
            if len(zones) > 1:
                told = "dates and numbers" if "" in zones else "dates with and without a time zone"
                raise RecordingError(self._name, f"{self._place(index)}: times are {told}; write one of the two")
        if zones - {""} and self._format.unit is not None:
            raise RecordingError(self._name, "has dates as times, which time.unit has no effect on; leave it out")
        if not times:
            raise RecordingError(self._name, "has no samples of joints")
        return times

    def _place(self, index: int) -> str:
        return f"line {self._line(index)}, column {self.table.time!r}"

    def _line(self, row: int) -> int:
        """Return the number of the line that a row is in."""
        return self.table.lines[row]

    def _no_number(self, index: int, heading: str, cell: str) -> str:
        rule = f"line {self._line(index)}, column {heading!r}: {cell[:60]!r} is not a finite number"
        if heading == self.table.time and _DATE_LIKE.match(cell):
            return f"{rule} or a date such as 2024-05-01T12:00:00.5Z"
        if "," in cell and "." in cell:
            return f"{rule}; leave out the marks between thousands"
        if "," in cell and self._decimal == ".":
            return f"{rule}; if the comma is a decimal one, state decimal: ','"
        if "." in cell and self._decimal == ",":
            return f"{rule}; if the point is a decimal one, state decimal: '.'"
        return rule

    def cut(self, rows: Sequence[int], origin: Mapping[str, str], also: Collection[str] = ()) -> bytes:
        """Return some lines and the columns that were needed, and others, cell by cell as they are written."""
        kept = {self.table.time, *self.headings, *also}
        columns = [k for k, h in enumerate(self.table.headings) if h in kept]
        out = io.StringIO()
        out.write(noted(origin))
        writer = csv.writer(out, delimiter=self.table.separator, lineterminator="\n")
        writer.writerow([self.table.headings[k] for k in columns])
        writer.writerows([[self.table.columns[k][index] for k in columns] for index in rows])
        return out.getvalue().encode()


def _joint(heading: str) -> str:
    """Return the joint that a column of `replay export` holds the position of."""
    return unit_of(heading)[0].removesuffix(" position")


def _values(cells: Sequence[str], decimal: str, words: Mapping[str, float]) -> Floats:
    """Return the numbers in cells, and what words stand for; NaN for what is neither."""
    if decimal == ",":
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        if not any("_" in cell for cell in cells):
            return np.array(list(map(float, cells)), dtype=np.float64) + 0.0
    except ValueError:
        pass
    return np.array([_value(cell, words) for cell in cells], dtype=np.float64)


def _value(cell: str, words: Mapping[str, float]) -> float:
    if words and cell.lower() in words:
        return words[cell.lower()]
    try:
        return math.nan if "_" in cell else float(cell)  # 1_000 is a number to Python only
    except ValueError:
        return math.nan
