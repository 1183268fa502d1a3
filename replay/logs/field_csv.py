"""Columns of readings in CSV: numbers, also those that are not finite, and true and false, over times or dates."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from replay.errors import RecordingError
from replay.logs.csv_long import LongNumbers, is_long
from replay.logs.csv_table import CsvTable, Format
from replay.logs.field_log import FieldLog, Window, in_order, in_window
from replay.logs.joint_csv import CsvNumbers


def read_columns(
    name: str,
    data: bytes,
    format: Format,
    headings: Collection[str],
    max_gap: int,
    also: tuple[Collection[int], Collection[str]] = ((), ()),
) -> FieldLog:
    """Return some columns of a CSV log; what a file looks like, and what of it is passed over, is as of `read_csv`.

    Args:
        name: of the file, for messages.
        data: its bytes, in UTF-8.
        format: how it is written.
        headings: of the columns; an empty cell is no sample.
        max_gap: longest time [ns] between samples that is bridged.
        also: rows and headings that an excerpt keeps beside these.

    Raises:
        RecordingError: as `read_csv`; or there is no such column, or no number in it, or two for one moment.
    """
    numbers = (
        LongNumbers(name, data, format, headings, max_gap)
        if is_long(data)
        else CsvNumbers(name, CsvTable(name, data, format), format, headings, max_gap, readings=True)
    )
    table = numbers.table
    series = {}
    for heading in headings:
        if heading not in table.headings or heading == table.time:
            known = [other for other in table.headings if other and other != table.time][:50]
            raise RecordingError(name, f"has no column {heading!r}; its columns are {known}")
        found = numbers.series(table.headings.index(heading), heading)
        if found is None:
            raise RecordingError(name, f"has no sample in column {heading!r}")
        series["", heading] = in_order(name, f"column {heading!r}", found.time, found.value)
    time = np.array(numbers.times, dtype=np.int64)
    begin = min(int(one.time[0]) for one in series.values())

    def cut(window: Window | None, origin: Mapping[str, str]) -> bytes:
        kept = in_window(time, window, begin)
        kept[: numbers.skip] = False
        rows = {*np.flatnonzero(kept).tolist(), *also[0]}
        return numbers.cut(sorted(rows), origin, also[1])

    return FieldLog(series, begin, numbers.skip, cut, table.origin)
