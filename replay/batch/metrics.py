"""The numbers of a night: a table for tools, metrics.parquet, and what a history keeps of them."""

from __future__ import annotations

import io
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from replay.batch.case import CaseResult
from replay.logs.part_file import write_file
from replay.scenario.measures import COLUMNS

MAIN = "clearance.min"
"""The number whose curve over the last nights a night's page shows."""
_DIGITS = 9
"""Digits that a history keeps of a number."""
_TEXTS = ("scenario", "name", "unit", "subject")


def rows(results: Iterable[CaseResult]) -> Iterator[dict[str, Any]]:
    """Yield a row for each number of each scenario; its keys are `COLUMNS`."""
    for result in results:
        yield from (measure.as_json(result.name) for measure in result.measures)


def write_metrics(path: Path, results: Iterable[CaseResult]) -> None:
    """Write the numbers of scenarios as a Parquet file with the columns `COLUMNS`; WriteError as of `write_file`."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = pa.schema([(name, pa.string() if name in _TEXTS else pa.float64()) for name in COLUMNS])
    stream = io.BytesIO()
    pq.write_table(pa.Table.from_pylist(list(rows(results)), schema), stream, compression="zstd")
    write_file(path, stream.getvalue())


def for_history(results: Iterable[CaseResult]) -> tuple[dict[str, dict[str, float]], dict[str, str]]:
    """Return the numbers by name and scenario, and their units by name."""
    found: dict[str, dict[str, float]] = {}
    units: dict[str, str] = {}
    for result in results:
        for measure in result.measures:
            if measure.value is not None:
                units[measure.name] = measure.unit
                found.setdefault(measure.name, {})[result.name] = float(f"{measure.value:.{_DIGITS}g}")
    return found, units
