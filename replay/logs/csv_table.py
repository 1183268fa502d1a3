"""CSV as people have it, as headings and cells: any separator, comments, empty columns, an excerpt's note."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from replay import limits
from replay.errors import RecordingError
from replay.logs.excerpt import EXCERPT

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", "|": "bars"}
_COMMENT = ("#", "%")
_IN_BRACKETS = re.compile(r"(.*\S)\s*\[([^\]]+)\]")


def unit_of(heading: str) -> tuple[str, str]:
    """Return a heading without the unit in brackets that it ends in, and that unit; "" for none."""
    found = _IN_BRACKETS.fullmatch(heading)
    return (found[1], found[2]) if found else (heading, "")


@dataclass(frozen=True)
class Format:
    """How a CSV log is written; None for what is to be found out.

    Attributes:
        time: heading of the column with the times; None: `time`, or `time [UNIT]`.
        unit: that it counts in, a key of `units`; None: the one in its heading, or s.
        units: nanoseconds by unit.
        separator: between cells.
        decimal: "." or ",".
    """

    time: str | None
    unit: str | None
    units: Mapping[str, Fraction]
    separator: str | None = None
    decimal: str | None = None


class CsvTable:
    """The cells of a file.

    Attributes:
        begin: number of lines before the first row.
        separator: between its cells.
        headings: by column; "" for none.
        time: heading of the times.
        lines: number of the line of each row.
        columns: the cells of all rows, by column.
        origin: the note on the file that this is a part of, else empty.
    """

    def __init__(self, name: str, data: bytes, format: Format) -> None:
        """Read a file; RecordingError as of `read_csv`."""
        if len(data) > limits.TEXT_LOG:
            raise RecordingError(name, f"has {len(data)} bytes; at most {limits.TEXT_LOG} of a CSV are read")
        if data.count(b"\n") + data.count(b"\r") > limits.CELLS:
            raise RecordingError(name, f"has more than {limits.CELLS} lines")
        text = _text(name, data)
        self._name = name
        self._format = format
        lines = io.StringIO(text, newline="").readlines()
        self.origin = _origin(lines[0]) if lines else {}
        stated = re.fullmatch(r"sep=(.)\s*", lines[0], re.IGNORECASE) if lines else None
        first = next((i for i, line in enumerate(lines) if i >= bool(stated) and _holds_data(line)), None)
        if first is None:
            raise RecordingError(name, "has no headings in its first line, such as time,joint")
        candidates = (
            [format.separator or (stated[1] if stated else "")] if format.separator or stated else [*SEPARATORS]
        )
        before = next((line for line in reversed(lines[:first]) if line.lstrip().startswith(_COMMENT)), "")
        chosen = self._headings(lines[first], candidates)
        self.begin = first + 1
        if chosen is None and before:
            chosen = self._headings(before.lstrip().lstrip("".join(_COMMENT)), candidates)
            self.begin = first
        if chosen is None:
            raise RecordingError(name, self._without_time(lines[first], candidates))
        self.separator, self.headings, self.time = chosen
        named = [heading for heading in self.headings if heading]
        if len(set(named)) != len(named):
            raise RecordingError(name, f"has a heading twice; its columns are {_some(named)}")
        if len(lines) * len(self.headings) > limits.CELLS:
            rule = f"has {len(lines)} lines of {len(self.headings)} columns; at most {limits.CELLS} cells are read"
            raise RecordingError(name, rule)
        self.lines: list[int] = []
        rows = []
        for line, cells in self._cells(lines):
            self.lines.append(line)
            rows.append(cells if len(cells) == len(self.headings) else self._fitted(line, cells))
        columns = zip(*rows, strict=True) if rows else ((),) * len(self.headings)
        self.columns = [tuple(map(str.strip, column)) for column in columns]

    def _headings(self, line: str, candidates: Sequence[str]) -> tuple[str, list[str], str] | None:
        """Return separator, headings and the heading of the times, where there is such a one."""
        for separator in candidates:
            headings = [heading.strip() for heading in self._split(line, separator)]
            while headings and not headings[-1]:  # columns without a heading are passed over
                del headings[-1]
            if len(headings) > limits.COLUMNS:
                raise RecordingError(self._name, f"has {len(headings)} columns; at most {limits.COLUMNS} are read")
            time = self._time_among(headings)
            if time is not None:
                return separator, headings, time
        return None

    def _split(self, line: str, separator: str) -> list[str]:
        try:
            return next(csv.reader([line], delimiter=separator), [])
        except csv.Error as error:
            raise RecordingError(self._name, f"cannot be read as CSV: {error}") from None

    def _time_among(self, headings: Sequence[str]) -> str | None:
        wanted = self._format.time or "time"
        if wanted in headings:
            return wanted
        units = [h for h in headings if unit_of(h)[0] == "time" and unit_of(h)[1] in self._format.units]
        return units[0] if self._format.time is None and len(units) == 1 else None

    def _without_time(self, line: str, candidates: Sequence[str]) -> str:
        by_separator = {s: self._split(line, s) for s in candidates}
        separator = max(candidates, key=lambda s: len(by_separator[s]))
        headings = [heading.strip() for heading in by_separator[separator]]
        rule = f"has no column {self._format.time or 'time'!r}; its columns are {_some(headings)}"
        other = [s for s in SEPARATORS if s in line and s not in candidates]
        if len(headings) == 1 and other:
            return f"{rule}; its cells seem to be separated by {SEPARATORS[other[0]]}: state separator"
        if len(headings) == 1 and len(line.split()) > 1:
            return f"{rule}; its cells seem to be separated by spaces: separate them by commas"
        if all(map(_digits, headings)):
            return f"{rule}: numbers; write headings above them, such as time,joint"
        return f"{rule}; name the one with the times in time.column"

    def _cells(self, lines: Sequence[str]) -> Iterator[tuple[int, list[str]]]:
        numbers = [k for k in range(self.begin, len(lines)) if not lines[k].lstrip().startswith(_COMMENT)]
        reader = csv.reader((lines[k] for k in numbers), delimiter=self.separator, strict=True)
        try:
            for cells in reader:
                if any(map(str.strip, cells)):
                    yield numbers[reader.line_num - 1] + 1, cells
        except csv.Error as error:
            raise RecordingError(self._name, f"cannot be read as CSV: {error}") from None

    def _fitted(self, line: int, cells: list[str]) -> list[str]:
        """Return a line's cells, as many as headings: what is missing or more than those must be empty."""
        count = len(self.headings)
        row = cells[:count] + [""] * (count - len(cells))
        if any(cell.strip() for cell in cells[count:]) or any(self.headings[len(cells) :]):
            rule = f"line {line} has {len(cells)} cells, its headings are {count}"
            if self.separator == "," and len(cells) > count and all(_digits(cell) for cell in cells):
                rule += "; if its numbers have decimal commas, separate the cells by semicolons"
            raise RecordingError(self._name, rule)
        return row


def _some(headings: Sequence[str]) -> str:
    """Return headings for a message, the first of many."""
    shown = ", ".join(repr(heading[:60]) for heading in headings[:20])
    return f"[{shown}{', ...' if len(headings) > 20 else ''}]"


def _text(name: str, data: bytes) -> str:
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise RecordingError(name, "is UTF-16 text; save it as UTF-8")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise RecordingError(
            name, f"line {line}: byte 0x{data[error.start]:02x} is not UTF-8; save it as UTF-8"
        ) from None


def _holds_data(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith(_COMMENT)


def is_excerpt(data: bytes) -> bool:
    """Return whether a file says that it was cut out of another one."""
    return data.startswith(f"# {EXCERPT} of ".encode())


def noted(origin: Mapping[str, str]) -> str:
    """Return the first line of an excerpt, which says where it comes from."""
    return f"# {EXCERPT} of {origin.get('name', '')}, sha256 {origin.get('sha256', '')}\n"


def _origin(line: str) -> dict[str, str]:
    found = re.fullmatch(rf"# {EXCERPT} of (.*), sha256 ([0-9a-f]{{64}})\s*", line)
    return {"name": found[1], "sha256": found[2]} if found else {}


def _digits(cell: str) -> bool:
    return bool(re.fullmatch(r"\s*[-+]?[0-9.]*\s*", cell))
