"""Long tables of plain numbers: columns of a CSV log that would not fit into memory cell by cell, many lines at a time.

What is no plain number is read as in any other table, and no more of it than such a table may hold.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from replay import limits
from replay.errors import RecordingError
from replay.logs.csv_table import SEPARATORS, CsvTable, Format, noted
from replay.logs.joint_csv import CsvNumbers
from replay.logs.joint_log import Series, leading_zeros, unrepeated
from replay.numerics.arrays import Flags, Floats

_HEAD = 1 << 20
"""Bytes at the beginning that hold the headings, and numbers enough to tell how they are written."""
_BLOCK = 4 << 20
_TIME = 8
"""Numbers that take as much memory as a time, which is exact."""


def is_long(data: bytes) -> bool:
    """Return whether a file holds more than is read cell by cell."""
    if len(data) > limits.TEXT_LOG:
        return True
    return data.count(b"\n") + max(data.count(separator.encode()) for separator in SEPARATORS) > limits.CELLS


class LongNumbers(CsvNumbers):
    """The numbers of a long table: as those of any other, of the columns that are needed."""

    def __init__(self, name: str, data: bytes, format: Format, needed: Collection[str], max_gap: int) -> None:
        """Read a file; arguments are those of `read_columns`.

        Raises:
            RecordingError: as `read_columns`; or it is larger than long tables may be, or a line is a comment, has
                quotes or another number of cells.
        """
        head = CsvTable(name, data[: data.rfind(b"\n", 0, _HEAD) + 1], format)
        self._data = data
        super().__init__(name, head, format, needed, max_gap, readings=True)
        columns = [head.headings.index(heading) for heading in sorted(self.headings - {head.time})]
        if len(data) > limits.LONG_LOG:
            raise RecordingError(name, f"has {len(data)} bytes; at most {limits.LONG_LOG} of a CSV are read")
        if data.count(b"\n") * (len(columns) + _TIME) > limits.LONG_CELLS:
            rule = f"has more than {limits.LONG_CELLS} cells in the {len(columns) + 1} columns that are needed"
            rule += f", each time counted as {_TIME}"
            raise RecordingError(name, rule)
        self._odd = 0
        self.times = []
        lines = data.count(b"\n") + 1
        self._values = {column: np.empty(lines) for column in columns}
        self._there = {column: np.empty(lines, dtype=np.bool_) for column in columns}
        for block in self._blocks([self._at, *columns]):
            row = len(self.times)
            self.times += self._read_times(list(map(str.strip, block.column(0).to_pylist())), row)
            rows = slice(row, len(self.times))
            for column in columns:
                found = self._floats(block.column(str(column)), column, row)
                self._values[column][rows], self._there[column][rows] = found
        self.skip = leading_zeros(self.times, max_gap)
        self._time = np.array(self.times, dtype=np.int64)

    def series(self, column: int, heading: str) -> Series | None:
        """Return the samples of a column, once; columns without empty cells share their times."""
        count = len(self._time)
        values, there = self._values.pop(column)[:count], self._there.pop(column)[:count]
        there[: self.skip] = False
        if there.all():
            time, row = self._time, np.arange(len(values))
        else:
            time, values, row = self._time[there], values[there], np.flatnonzero(there)
        if (time[1:] > time[:-1]).all():
            return Series(time, values, row) if len(row) else None
        first = unrepeated(time, values)
        return Series(time[first], values[first], row[first])

    def cut(self, rows: Sequence[int], origin: Mapping[str, str], also: Collection[str] = ()) -> bytes:
        """Return some lines and the columns that were needed, and others, cell by cell as they are written."""
        kept = {self.table.time, *self.headings, *also}
        columns = [k for k, heading in enumerate(self.table.headings) if heading in kept]
        chosen, begin = np.array(rows, dtype=np.int64), 0
        out = io.StringIO()
        out.write(noted(origin))
        writer = csv.writer(out, delimiter=self.table.separator, lineterminator="\n")
        writer.writerow([self.table.headings[k] for k in columns])
        for block in self._blocks(columns):
            first, last = np.searchsorted(chosen, [begin, begin + block.num_rows])
            cells = block.take(chosen[first:last] - begin).to_pydict().values()
            writer.writerows(zip(*(map(str.strip, column) for column in cells), strict=True))
            begin += block.num_rows
        return out.getvalue().encode()

    def _blocks(self, columns: Sequence[int]) -> Iterator[Any]:
        """Yield the cells of some lines after the other, as text, by the column's number."""
        import pyarrow
        from pyarrow.csv import ConvertOptions, ParseOptions, ReadOptions, open_csv

        needed = [str(column) for column in columns]
        try:
            yield from open_csv(
                pyarrow.BufferReader(self._data),
                ReadOptions(
                    use_threads=False,
                    block_size=_BLOCK,
                    skip_rows=self.table.begin,
                    column_names=[str(column) for column in range(len(self.table.headings))],
                ),
                ParseOptions(delimiter=self.table.separator, quote_char=False),
                ConvertOptions(
                    column_types=dict.fromkeys(needed, pyarrow.string()),
                    include_columns=needed,
                    strings_can_be_null=False,
                ),
            )
        except pyarrow.ArrowInvalid as error:
            reason = str(error).partition("\n")[0][:200]
            rule = f"is no plain table, of which alone more than {limits.CELLS} cells are read: {reason}"
            raise RecordingError(self._name, rule) from None

    def _floats(self, cells: Any, column: int, row: int) -> tuple[Floats, Flags]:
        """Return the numbers in cells, and which are not empty.

        Args:
            cells: of a column, as pyarrow has them.
            column: which.
            row: the first one's.
        """
        import pyarrow
        from pyarrow import compute

        try:
            if self._decimal == ".":
                values = compute.cast(cells, pyarrow.float64()).to_numpy(zero_copy_only=False) + 0.0
                if np.isfinite(values).all():
                    return values, np.ones(len(values), dtype=np.bool_)
        except pyarrow.ArrowInvalid:
            pass  # what is empty, a word, or no number is told apart below
        texts = list(map(str.strip, cells.to_pylist()))
        self._odd += len(texts)
        if self._odd > limits.CELLS:
            raise RecordingError(self._name, f"has more than {limits.CELLS} cells among some that are no plain numbers")
        there = np.array(list(map(bool, texts)), dtype=np.bool_)
        values = np.full(len(texts), np.nan)
        index = np.flatnonzero(there)
        values[index] = self._checked(index + row, [texts[k] for k in index.tolist()], self.table.headings[column])
        return values, there

    def _line(self, row: int) -> int:
        """Return the number of the line that a row is in."""
        for number, line in enumerate(io.BytesIO(self._data), 1):
            row -= number > self.table.begin and bool(line.strip(b"\r\n"))
            if row < 0:
                return number
        return self.table.begin
